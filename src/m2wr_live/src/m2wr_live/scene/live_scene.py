# SPDX-License-Identifier: BSD-3-Clause
"""State of a simulation as pages show it: world, robots, beams, trails, goals, maps and paths, in one fixed frame."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Collection, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from m2wr_live.scene.annotations import Annotations
from m2wr_live.scene.relief import Relief, height_of, read_relief
from m2wr_live.scene.shapes import MarkerShapes
from m2wr_live.scene.tables import Row, read_table
from m2wr_view.errors import ViewError
from m2wr_view.frames import Frames, matrices_of, matrix_of, planar

if TYPE_CHECKING:
    from m2wr_live.scene.robot_model import RobotModel
    from m2wr_node.array_types import FloatArray, Int8Array

JUMP = 0.5                  # m between two samples; more means that the robot was placed there and did not drive
TRAIL_STEP = 0.03           # m between two points of a trail
MOST_TRAIL = 6000           # points of a robot's trail; older ones are dropped
MOST_BEAMS = 180            # drawn of a scan
BEAMS_OF_ALL = 360          # drawn of all scans together, but at least
LEAST_BEAMS = 24            # of each; beams are most of what a browser draws
MOST_POINTS = 2000          # of a path or of a set of particles
MOST_CELLS = 1 << 24        # of a map
MOST_MARKS = 200            # hit points, and leave points
UPDATES = "_updates"        # end of the topic with the changes of a map
_REWIND = 0.5               # s; a clock that goes back further was reset


class Robot:
    """One robot: its looks, its link poses in the fixed frame (4, 4), and where it has been.

    Attributes
    ----------
    trail : list of (float, float, float, bool)
        x, y [m], height of the ground there [m], and whether the robot drove here from the point before.
    first : int
        Number of points that were dropped before ``trail``.
    """

    def __init__(self, name: str, prefix: str, model: RobotModel) -> None:
        self.name, self.prefix, self.model = name, prefix, model
        self.poses: Dict[str, FloatArray] = {}
        self.trail: List[Tuple[float, float, float, bool]] = []
        self.first = 0

    @property
    def pose(self) -> Optional[FloatArray]:
        """Pose (4, 4) of the root link, or None if it is not known yet."""
        return self.poses.get(self.model.root)

    def follow(self, relief: Optional[Relief]) -> None:
        """Extend the trail to the present pose, on the ground."""
        pose = self.pose
        if pose is None:
            return
        x, y = float(pose[0, 3]), float(pose[1, 3])
        last = self.trail[-1] if self.trail else None
        step = math.inf if last is None else math.hypot(x - last[0], y - last[1])
        if step > TRAIL_STEP:
            self.trail.append((x, y, height_of(relief, x, y), step <= JUMP))
            if len(self.trail) > MOST_TRAIL:
                dropped = MOST_TRAIL // 4
                del self.trail[:dropped]
                self.first += dropped


class Grid(NamedTuple):
    """A map: ``pose`` (4, 4) of its first cell's corner, ``resolution`` [m] and ``cells`` (rows, columns) int8."""

    pose: FloatArray
    resolution: float
    cells: Int8Array


class LiveScene:
    """What is known of a running or recorded simulation.

    Attributes
    ----------
    now : float
        Simulated time [s].
    robots : dict of str to Robot
    models_with_looks : dict of str to Robot
        Other models that have looks of their own, instead of markers.
    beams : dict of str to (n, 2, 3) float64
        Beams by topic: where they start and end [m].
    paths, particles : dict of str to (n, 3) float64
        Points [m] by topic.
    grids : dict of str to Grid
    relief : Relief or None
        Ground that is not level.
    annotations : dict of str to Annotations
        Markers for viewers, such as frontiers, by topic.
    tables : dict of str to list of Row
        Tables by topic, such as the scores of paths.
    state : str
        Of Bug 2.
    hits, leaves : list of (float, float)
        Points of Bug 2 [m].
    values : dict of str to str
        The newest diagnostics of the simulation.
    run : int
        Increases when simulated time goes back: all that belongs to the run is dropped.
    """

    def __init__(self) -> None:
        self.now, self.run = 0.0, 0
        self.markers, self.frames = MarkerShapes(), Frames()
        self.robots: Dict[str, Robot] = {}
        self.models: Dict[str, RobotModel] = {}
        self._looks: Dict[str, Callable[[], RobotModel]] = {}       # by name of the model
        self._robot_names: Set[str] = set()
        self.models_with_looks: Dict[str, Robot] = {}
        self._link_poses: Dict[str, FloatArray] = {}        # (4, 4)
        self.beams: Dict[str, FloatArray] = {}
        self.paths: Dict[str, FloatArray] = {}
        self.particles: Dict[str, FloatArray] = {}
        self.grids: Dict[str, Grid] = {}
        self.relief: Optional[Relief] = None
        self.annotations: Dict[str, Annotations] = {}
        self.tables: Dict[str, List[Row]] = {}
        self.state = ""
        self.hits: List[Tuple[float, float]] = []
        self.leaves: List[Tuple[float, float]] = []
        self.values: Dict[str, str] = {}
        self._names: Sequence[str] = ()
        self._known: Optional[Tuple[object, ...]] = None

    @property
    def frame(self) -> str:
        """The fixed frame, whose axes are those of the world."""
        return self.markers.frame or "odom"

    # ---- messages ----------------------------------------------------------------------------------------------

    def take_time(self, now: float) -> None:
        """Take the simulated time [s]."""
        if now < self.now - _REWIND:
            self.forget_run()
        self.now = now

    def forget_run(self) -> None:
        """Drop what belongs to a run that was reset."""
        for robot in self.robots.values():
            robot.trail, robot.first = [], 0
        self.hits, self.leaves, self.beams, self.state = [], [], {}, ""
        self.run += 1

    def take_links(self, names: Sequence[str], poses: FloatArray) -> None:
        """Take the true poses of links (``model::link``) or models.

        Parameters
        ----------
        names : sequence of str
        poses : (n, 7) float64
            Position [m] and quaternion x y z w, in the world.
        """
        if names is not self._names and list(names) != list(self._names):
            self._names = names
        with np.errstate(invalid="ignore", over="ignore"):
            matrices = matrices_of(poses)
        finite = np.isfinite(matrices).all(axis=(1, 2)).tolist()
        self._link_poses = {name: matrix for name, matrix, known in zip(names, matrices, finite) if known}

    def take_description(self, source: str, model: RobotModel) -> None:
        """Take the looks of robots.

        Parameters
        ----------
        source : str
            Where the description comes from; one of the same source is replaced.
        model : RobotModel
        """
        self.models[source] = model
        self._known = None

    def take_looks(self, looks: Dict[str, Callable[[], RobotModel]], robots: Collection[str]) -> None:
        """Take the looks of models of the simulation; those of robots are for robots that no description fits.

        Parameters
        ----------
        looks : dict of str to callable
            By name of the model; read when they are needed.
        robots : collection of str
            Names of those that are robots.
        """
        self._looks, self._known = looks, None
        self._robot_names = set(robots)

    def take_transforms(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage; transforms that are not finite are ignored."""
        for entry in message.transforms:
            move, turn = entry.transform.translation, entry.transform.rotation
            position, quaternion = (move.x, move.y, move.z), (turn.x, turn.y, turn.z, turn.w)
            if all(map(math.isfinite, position)) and math.isfinite(sum(part * part for part in quaternion)):
                self.frames.set_pose(entry.header.frame_id, entry.child_frame_id, position, quaternion)

    def take_scan(self, topic: str, message: Any) -> None:
        """Take a scan; its beams start where its frame is now.

        Parameters
        ----------
        topic : str
        message : sensor_msgs.msg.LaserScan
        """
        pose = self.pose_of(message.header.frame_id, topic)
        ranges = np.asarray(message.ranges, dtype=float)
        if pose is None or not ranges.size:
            return
        share = BEAMS_OF_ALL // max(1, len(self.beams))
        count = min(ranges.size, MOST_BEAMS, max(LEAST_BEAMS, share))
        chosen = np.unique(np.linspace(0, ranges.size - 1, count).astype(int))
        angle = message.angle_min + message.angle_increment * chosen
        far = ranges[chosen]
        far = np.where(np.isnan(far) | (far < message.range_min), 0.0, np.minimum(far, message.range_max))
        ends = np.column_stack((far * np.cos(angle), far * np.sin(angle), np.zeros(len(far))))
        beams = np.empty((len(far), 2, 3))
        beams[:, 0], beams[:, 1] = pose[:3, 3], ends.dot(pose[:3, :3].T) + pose[:3, 3]
        if np.all(np.isfinite(beams)):
            self.beams[topic] = beams

    def take_points(self, topic: str, message: Any, particles: bool) -> None:
        """Take a nav_msgs/Path, or a geometry_msgs/PoseArray as particles.

        Parameters
        ----------
        topic : str
        message : nav_msgs.msg.Path or geometry_msgs.msg.PoseArray
        particles : bool
        """
        pose = self.pose_of(message.header.frame_id, topic)
        poses = message.poses if particles else [stamped.pose for stamped in message.poses]
        step = max(1, math.ceil(len(poses) / MOST_POINTS))
        points = np.array([(entry.position.x, entry.position.y, entry.position.z) for entry in poses[::step]])
        if len(poses) and step > 1 and not particles:       # a path keeps its end
            end = poses[-1].position
            points = np.vstack((points, (end.x, end.y, end.z)))
        if pose is None or not np.all(np.isfinite(points)):
            return
        target = self.particles if particles else self.paths
        target[topic] = points.reshape(-1, 3).dot(pose[:3, :3].T) + pose[:3, 3]

    def take_map(self, topic: str, message: Any) -> None:
        """Take a map.

        Parameters
        ----------
        topic : str
        message : nav_msgs.msg.OccupancyGrid

        Raises
        ------
        ViewError
            If it has another number of values than of cells, or too many.
        """
        info, cells = message.info, np.array(message.data, dtype=np.int8)
        if not 0 < info.width * info.height <= MOST_CELLS or cells.size != info.width * info.height:
            raise ViewError("map on %s of %d x %d cells has %d values; expected one per cell, at most %d"
                            % (topic, info.width, info.height, cells.size, MOST_CELLS))
        origin, turn = info.origin.position, info.origin.orientation
        pose = self.pose_of(message.header.frame_id, topic)
        corner = matrix_of((origin.x, origin.y, origin.z), (turn.x, turn.y, turn.z, turn.w))
        if pose is None or not (np.all(np.isfinite(corner)) and 0.0 < info.resolution < math.inf):
            return
        self.grids[topic] = Grid(pose.dot(corner), info.resolution, cells.reshape(info.height, info.width))

    def take_map_update(self, topic: str, message: Any) -> None:
        """Take a change of a map that is known; one of another map is ignored.

        Parameters
        ----------
        topic : str
            Of the changes: that of the map and ``_updates``.
        message : map_msgs.msg.OccupancyGridUpdate

        Raises
        ------
        ViewError
            If it has another number of values than of cells, or does not lie in the map.
        """
        name = topic[:-len(UPDATES)] if topic.endswith(UPDATES) else topic
        grid = self.grids.get(name)
        if grid is None:
            return
        rows, columns = grid.cells.shape
        values = np.array(message.data, dtype=np.int8)
        if not (0 <= message.x <= message.x + message.width <= columns
                and 0 <= message.y <= message.y + message.height <= rows
                and values.size == message.width * message.height):
            raise ViewError("change on %s: %d values for %d x %d cells from (%d, %d) on; expected one per cell, in the "
                            "map of %d x %d cells" % (topic, values.size, message.width, message.height, message.x,
                                                      message.y, columns, rows))
        cells = grid.cells.copy()           # pages may be drawing the old ones
        cells[message.y:message.y + message.height, message.x:message.x + message.width] = values.reshape(
            message.height, message.width)
        self.grids[name] = grid._replace(cells=cells)

    def take_annotations(self, topic: str, message: Any) -> None:
        """Take markers for viewers.

        Parameters
        ----------
        topic : str
        message : visualization_msgs.msg.MarkerArray
        """
        self.annotations.setdefault(topic, Annotations()).update(
            message.markers, self.now, lambda frame: self.pose_of(frame, topic))

    def take_ground(self, message: Any) -> None:
        """Take a visualization_msgs/MarkerArray with all ground that is not level."""
        self.relief = read_relief(message.markers)

    def take_table(self, topic: str, message: Any) -> None:
        """Take a table.

        Parameters
        ----------
        topic : str
        message : diagnostic_msgs.msg.DiagnosticArray
        """
        self.tables[topic] = read_table(message)

    def take_mark(self, left: bool, point: Any) -> None:
        """Take a hit or leave point of Bug 2.

        Parameters
        ----------
        left : bool
            Whether it is a leave point.
        point : geometry_msgs.msg.Point
        """
        marks, place = self.leaves if left else self.hits, (point.x, point.y)
        if place not in marks and len(marks) < MOST_MARKS and all(map(math.isfinite, place)):
            marks.append(place)

    # ---- robots ------------------------------------------------------------------------------------------------

    def update(self) -> None:
        """Bring the robots to the newest poses, and extend their trails."""
        known = (tuple(self._names), len(self.frames.names()), len(self.models))
        if known != self._known:
            self._known = known
            self._find_robots()
        for robot in self.robots.values():
            self._place(robot)
            robot.follow(self.relief)
        for model in self.models_with_looks.values():
            self._place(model)

    def _find_robots(self) -> None:
        """Find the robots that the descriptions fit: models with such links, otherwise frames with such names."""
        links: Dict[str, List[str]] = {}
        for scoped in self._names:
            owner, _, link = scoped.partition("::")
            links.setdefault(owner, []).append(link)
        frames = set(self.frames.names())
        found: Dict[str, Tuple[str, RobotModel]] = {}
        for model in self.models.values():
            own = set(model.links)
            for name, parts in links.items():
                if parts != [""] and set(parts) <= own and name not in found:
                    prefix = name + "/" if any(name + "/" + link in frames for link in model.links) else ""
                    found[name] = (prefix, model)
            if not any(used is model for _, used in found.values()):
                for frame in frames:
                    prefix = frame[:len(frame) - len(model.root)]
                    if frame.endswith(model.root) and prefix in ("", frame.rpartition("/")[0] + "/"):
                        found[prefix.strip("/") or model.name] = (prefix, model)
        for name in sorted(set(self._looks) & self._robot_names & set(links) - set(found)):
            model = self._looks[name]()
            if set(model.links) <= set(links[name]):        # where joints are is not known from looks
                found[name] = ("", model)
        self._find_looks(links)
        before = self.robots
        self.robots = {}
        for name, (prefix, model) in sorted(found.items()):
            old = before.get(name)
            self.robots[name] = old if old is not None and old.prefix == prefix and old.model is model else Robot(
                name, prefix, model)

    def _find_looks(self, links: Dict[str, List[str]]) -> None:
        """Find the models that are shown by their looks: all their links have poses."""
        before, self.models_with_looks = self.models_with_looks, {}
        for name in sorted(set(self._looks) & set(links) - self._robot_names):
            model, old = self._looks[name](), before.get(name)
            if model.shapes and set(model.links) <= set(links[name]):
                self.models_with_looks[name] = old if old is not None and old.model is model else Robot(name, "", model)

    def _place(self, robot: Robot) -> None:
        """Compute the link poses: the true ones, those of fixed joints, then those of tf, else joints are at 0."""
        model = robot.model
        for link in model.links:
            pose = self._link_poses.get(robot.name + "::" + link)
            if pose is None and link == model.root:
                pose = self._link_poses.get(robot.name)
            mount = model.mounts.get(link)
            if pose is not None:
                pass
            elif mount is None or not mount.fixed:
                parent = None if mount is None else robot.poses.get(mount.parent)
                pose = self.frames.between(self.frame, robot.prefix + link) if parent is None else None
                if parent is not None and mount is not None:
                    joint = self.frames.between(robot.prefix + mount.parent, robot.prefix + link)
                    pose = parent.dot(mount.origin if joint is None else joint)
            elif mount.parent in robot.poses:
                pose = robot.poses[mount.parent].dot(mount.origin)
            if pose is not None:
                robot.poses[link] = pose

    def pose_of(self, frame: str, topic: str = "") -> Optional[FloatArray]:
        """Return the pose (4, 4) of a frame in the fixed frame, or None if it is not known.

        Parameters
        ----------
        frame : str
        topic : str
            Where the frame was named; a robot whose namespace this is comes first.
        """
        frame = frame.lstrip("/")
        if frame in ("", self.frame, "world"):
            return np.eye(4)
        spaces = topic.split("/")
        for robot in sorted(self.robots.values(), key=lambda entry: entry.name not in spaces):
            link = frame[len(robot.prefix):] if frame.startswith(robot.prefix) else None
            if link in robot.poses:
                return robot.poses[link]
        return self.frames.between(self.frame, frame)

    def heading(self, name: str) -> Optional[FloatArray]:
        """Return x, y [m] and yaw [rad] (3,) of a robot, or None."""
        robot = self.robots.get(name)
        return None if robot is None or robot.pose is None else planar(robot.pose)
