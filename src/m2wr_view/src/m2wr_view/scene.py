# SPDX-License-Identifier: BSD-3-Clause
"""State of a running robot and its world, from the messages received so far."""
from __future__ import annotations

import math
from array import array
from typing import TYPE_CHECKING, Any, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.errors import ViewError
from m2wr_view.frames import Frames, compose, inverse, matrix_of, planar, yaw_of
from m2wr_view.outlines import M2WR_FOOTPRINT
from m2wr_view.solids import Solids, ground_of, read_robot
from m2wr_view.team import JUMP, Team

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, Int8Array
    from m2wr_view.frames import Numbers
    from m2wr_view.outlines import Outline
    from m2wr_view.solids import Ground, Robot

TRAIL_STEP = 0.02       # m between two points of the trail
_HISTORY = 400          # poses kept for scans that arrive late
_MOST_NAMES, _LONGEST_NAME = 100, 30        # of places
_TEXT = 9               # Marker.TEXT_VIEW_FACING

#: Topics that are drawn, by name: message type, and the method of :class:`Scene` that takes the messages.
TOPICS = {
    "clock": ("rosgraph_msgs/Clock", "take_clock"),
    "odom": ("nav_msgs/Odometry", "take_odometry"),
    "tf": ("tf2_msgs/TFMessage", "take_transforms"),
    "tf_static": ("tf2_msgs/TFMessage", "take_transforms"),
    "m2wr/laser/scan": ("sensor_msgs/LaserScan", "take_scan"),
    "map": ("nav_msgs/OccupancyGrid", "take_map"),
    "gazebo/robot_states": ("gazebo_msgs/ModelStates", "take_robots"),
    "gazebo/world_markers": ("visualization_msgs/MarkerArray", "take_markers"),
    "gazebo/ground_markers": ("visualization_msgs/MarkerArray", "take_ground"),
    "delivery/places": ("visualization_msgs/MarkerArray", "take_places"),
    "robot_description": ("std_msgs/String", "take_description"),
    "bug2/state": ("std_msgs/String", "take_state"),
    "bug2/m_line": ("nav_msgs/Path", "take_line"),
    "bug2/hit_point": ("geometry_msgs/PointStamped", "take_hit_point"),
    "bug2/leave_point": ("geometry_msgs/PointStamped", "take_leave_point"),
}


class Scene:
    """Content of a picture; everything is in the odometry frame, in metres and radians.

    Attributes
    ----------
    now : float or None
        The newest time seen [s].
    pose : (3,) float64 or None
        x, y, yaw of the robot.
    trail : list of (float, float, str or None, bool)
        x, y, state, and whether the robot drove here from the point before.
    scan : LaserScan or None
        The newest one.
    grid : (transform (4, 4), resolution, (rows, columns) int8) or None
        The map, and how its first cell's corner lies.
    ground : list of Ground
        Pieces of ground that is not level.
    names : list of (float, float, str)
        Places and their names.
    team : Team
        All robots, where there are several and no topic of the names above has the odometry of one.
    version : int
        Increases when something changes that is not drawn in each picture.
    trail_version : int
        Increases when the trail is cleared.
    """

    def __init__(self) -> None:
        self.now: Optional[float] = None
        self.pose: Optional[FloatArray] = None
        self.state: Optional[str] = None
        self.trail: List[Tuple[float, float, Optional[str], bool]] = []
        self.hits: List[Tuple[float, float]] = []
        self.leaves: List[Tuple[float, float]] = []
        self.line: List[Tuple[float, float]] = []
        self.solids = Solids()
        self.ground: List[Ground] = []
        self.names: List[Tuple[float, float, str]] = []
        self.team = Team()
        self.robot: Optional[Robot] = None
        self.footprint: Sequence[Outline] = M2WR_FOOTPRINT
        self.scan: Any = None
        self.grid: Optional[Tuple[FloatArray, float, Int8Array]] = None
        self.version, self.trail_version = 0, 0
        self.frames, self.odom_frame = Frames(), "odom"
        self.base_frame: Optional[str] = None
        self._times: List[float] = []
        self._poses: List[FloatArray] = []
        self._map: Optional[Tuple[str, float, Int8Array, FloatArray]] = None        # frame, resolution, cells, origin
        self._odometry_seen = False

    @property
    def goal(self) -> Optional[Tuple[float, float]]:
        """Where the line to follow ends, or None."""
        return self.line[-1] if self.line else None

    # ---- messages ----------------------------------------------------------------------------------------------

    def take_clock(self, message: Any) -> None:
        """Process the time; if it goes back, everything that belongs to a run is cleared."""
        now = message.clock.to_sec()
        if self.now is not None and now < self.now - 0.5:
            self.forget_run()
        self.now = now

    def forget_run(self) -> None:
        """Drop what belongs to a run that was reset."""
        self.trail, self.hits, self.leaves = [], [], []
        self._times, self._poses, self.scan = [], [], None
        self.team.forget_paths()
        self.trail_version += 1

    def take_odometry(self, message: Any) -> None:
        """Take the robot's pose."""
        where, turn = message.pose.pose.position, message.pose.pose.orientation
        self._odometry_seen = True
        if message.header.frame_id:
            self.odom_frame = message.header.frame_id.lstrip("/")
        self.base_frame = (message.child_frame_id or self.base_frame or "").lstrip("/") or None
        yaw = yaw_of((turn.x, turn.y, turn.z, turn.w))
        self._move(message.header.stamp.to_sec(), np.array((where.x, where.y, yaw)))

    def place(self, now: float, pose: Numbers) -> None:
        """Set the robot's pose directly, without messages.

        Parameters
        ----------
        now : float
            Simulated time [s].
        pose : (3,) floats
            x, y [m] and yaw [rad], odometry frame.
        """
        self._odometry_seen = True
        self._move(now, np.asarray(pose, dtype=float))

    def _move(self, stamp: float, pose: FloatArray) -> None:
        if not np.all(np.isfinite(pose)):
            return
        if self._times and stamp < self._times[-1]:
            if stamp > self._times[-1] - 0.5:
                return                      # a little late: no news
            self.forget_run()
        if self.now is None or stamp > self.now:
            self.now = stamp
        self._times.append(stamp)
        self._poses.append(pose)
        if len(self._times) > _HISTORY:
            del self._times[:_HISTORY // 2], self._poses[:_HISTORY // 2]
        self.pose = pose
        last = self.trail[-1] if self.trail else None
        step = math.hypot(pose[0] - last[0], pose[1] - last[1]) if last else math.inf
        if last is None or step > TRAIL_STEP or last[2] != self.state:
            self.trail.append((float(pose[0]), float(pose[1]), self.state, step <= JUMP))

    def take_transforms(self, message: Any) -> None:
        """Take transforms; they give the pose of maps and lasers, and of the robot if there is no odometry."""
        for entry in message.transforms:
            move, turn = entry.transform.translation, entry.transform.rotation
            self.frames.set(entry.header.frame_id, entry.child_frame_id, matrix_of(
                (move.x, move.y, move.z), (turn.x, turn.y, turn.z, turn.w)))
            if not self._odometry_seen and entry.header.frame_id.lstrip("/") == self.odom_frame:
                self.base_frame = base = entry.child_frame_id.lstrip("/")
                odom_from_base = self.frames.between(self.odom_frame, base)
                if odom_from_base is not None:
                    self._move(entry.header.stamp.to_sec(), planar(odom_from_base))
        self._place_map()

    def take_scan(self, message: Any) -> None:
        """Take a scan."""
        self.scan = message

    def take_map(self, message: Any) -> None:
        """Take a map."""
        info = message.info
        cells = np.array(array("b", message.data))      # three times as fast as numpy alone
        if not info.width * info.height or cells.size != info.width * info.height:
            raise ViewError("map of %d x %d cells has %d values; expected one per cell"
                            % (info.width, info.height, cells.size))
        origin, turn = info.origin.position, info.origin.orientation
        self._map = (message.header.frame_id, info.resolution, cells.reshape(info.height, info.width), matrix_of(
            (origin.x, origin.y, origin.z), (turn.x, turn.y, turn.z, turn.w)))
        self.grid = None
        self._place_map()

    def _place_map(self) -> None:
        if self._map is None:
            return
        frame, resolution, cells, origin = self._map
        odom_from_map = self.frames.between(self.odom_frame, frame) if frame else np.eye(4)
        transform = (np.eye(4) if odom_from_map is None else odom_from_map).dot(origin)
        if self.grid is None or not np.allclose(self.grid[0], transform, atol=1e-3):
            self.grid = (transform, resolution, cells)
            self.version += 1

    def take_robots(self, message: Any) -> None:
        """Take the true poses of all robots; of a single one, and where there is odometry, nothing is drawn."""
        poses = {} if self._odometry_seen else {
            name: (pose.position.x, pose.position.y, yaw_of((pose.orientation.x, pose.orientation.y,
                                                             pose.orientation.z, pose.orientation.w)))
            for name, pose in zip(message.name, message.pose)}
        self.team.update(poses)

    def take_markers(self, message: Any) -> None:
        """Take markers of the world."""
        self.solids.update(message.markers)
        self.version += 1

    def take_ground(self, message: Any) -> None:
        """Take markers of ground."""
        found = [ground_of(marker) for marker in message.markers]
        self.ground = [ground for ground in found if ground is not None]
        self.version += 1

    def take_places(self, message: Any) -> None:
        """Take the texts among markers: names of places."""
        texts = [marker for marker in message.markers if marker.type == _TEXT][:_MOST_NAMES]
        self.names = [(place.x, place.y, marker.text[:_LONGEST_NAME]) for marker in texts
                      for place in [marker.pose.position] if math.isfinite(place.x) and math.isfinite(place.y)]
        self.version += 1

    def take_description(self, message: Any) -> None:
        """Take a robot description; its shapes from above are the robot's outline.

        Raises
        ------
        ViewError
            If it is no URDF.
        """
        self.robot = read_robot(message.data)
        self.footprint = self.robot.footprint or M2WR_FOOTPRINT

    def take_state(self, message: Any) -> None:
        """Take the state of Bug 2."""
        self.state = message.data

    def take_line(self, message: Any) -> None:
        """Take the line to follow; its end is the goal."""
        line = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
        if line != self.line:
            self.line = line
            self.version += 1

    def take_hit_point(self, message: Any) -> None:
        """Process a hit point of Bug 2."""
        self._mark(self.hits, message.point)

    def take_leave_point(self, message: Any) -> None:
        """Process a leave point of Bug 2."""
        self._mark(self.leaves, message.point)

    @staticmethod
    def _mark(points: List[Tuple[float, float]], point: Any) -> None:
        if (point.x, point.y) not in points:
            points.append((point.x, point.y))

    # ---- queries -----------------------------------------------------------------------------------------------

    def places(self) -> List[Tuple[float, float]]:
        """Return where the robots are [m]."""
        return [(pose[0], pose[1]) for pose in [self.pose, *(member.pose for member in self.team.members.values())]
                if pose is not None]

    def pose_at(self, stamp: float) -> Optional[FloatArray]:
        """Return the robot's pose (3,) at a time [s], between two known ones; the newest if it is later."""
        if not self._times:
            return self.pose
        index = int(np.searchsorted(self._times, stamp))
        if index <= 0 or index >= len(self._times):
            return self._poses[min(index, len(self._poses) - 1)]
        before, after = self._times[index - 1], self._times[index]
        share = (stamp - before) / (after - before) if after > before else 1.0
        one, two = self._poses[index - 1], self._poses[index]
        turn = math.remainder(two[2] - one[2], 2.0 * math.pi)
        return np.array((one[0] + share * (two[0] - one[0]), one[1] + share * (two[1] - one[1]), one[2] + share * turn))

    def _mount(self, frame: str) -> FloatArray:
        """Return the planar pose (3,) of the laser on the robot."""
        frame = frame.lstrip("/")
        if self.base_frame:
            matrix = self.frames.between(self.base_frame, frame)
            if matrix is not None:
                return planar(matrix)
        if self.robot is not None and frame.split("/")[-1] in self.robot.mounts:
            base = self.robot.mounts.get((self.base_frame or self.robot.root).split("/")[-1], np.eye(4))
            return planar(inverse(base).dot(self.robot.mounts[frame.split("/")[-1]]))
        return np.zeros(3)

    def rays(self) -> Optional[Tuple[FloatArray, FloatArray, BoolArray]]:
        """Return (origin (2,), ends (n, 2), hits (n,) bool) of the newest scan; None if its pose is unknown.

        A ray without a return ends at range_max; a return closer than range_min ends at the laser.
        """
        scan = self.scan
        if scan is None or not scan.ranges:
            return None
        pose = self.pose_at(scan.header.stamp.to_sec())
        if pose is None:
            return None
        laser = compose(pose, self._mount(scan.header.frame_id))
        ranges = np.asarray(scan.ranges, dtype=float)
        angles = laser[2] + scan.angle_min + scan.angle_increment * np.arange(len(ranges))
        hits = (ranges >= scan.range_min) & (ranges <= scan.range_max)      # false for nan and both infinities
        far = np.where(np.isnan(ranges) | (ranges < scan.range_min), 0.0, np.minimum(ranges, scan.range_max))
        return laser[:2], laser[:2] + far[:, None] * np.column_stack((np.cos(angles), np.sin(angles))), hits
