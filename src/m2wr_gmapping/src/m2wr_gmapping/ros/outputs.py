# SPDX-License-Identifier: BSD-3-Clause
"""Publishers of the node, in threads that do not block scans: map, transform, pose, diagnostics."""
from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid, Path
from nav_msgs.srv import GetMap
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from m2wr_gmapping.replay.run_statistics import peak_memory_mib
from m2wr_gmapping.ros.pose_covariance import covariance, normalise
from m2wr_maps.ros.message_conversion import (
    ArrayMapAnswer,
    covariance36,
    grid_message,
    path_message,
    pose_message,
    poses_message,
)
from m2wr_maps.ros.scan_input import Intake
from m2wr_maps.scan_account import EARLY, NO_TRANSFORM, PASSED_OVER, REFUSED
from m2wr_maps.se2 import compose, inverse

if TYPE_CHECKING:
    import genpy
    from numpy.typing import ArrayLike

    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_gmapping.mapper import Mapper, Update
    from m2wr_maps.ros.message_conversion import ArrayGrid
    from m2wr_maps.saved_map import SavedMap
    from m2wr_node.array_types import FloatArray

DIAGNOSTICS_PERIOD = 1.0    # [s], wall
SHORTEST_WAIT, LONGEST_WAIT = 0.001, 0.05     # between two polls of the clock [s], wall
SHORTEST_PERIOD = 0.001     # least period of the transform [s]
RATE_SPAN = 0.1             # interval over which the rate of the clock is measured [s], wall
LATE = 0.5                  # share of the queue above which diagnostics warn


class MapTopics:
    """``map``, ``map_metadata`` and ``~entropy``, all latched, and the service ``dynamic_map`` with the newest map."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        self._info = rospy.Publisher("map_metadata", MapMetaData, queue_size=1, latch=True)
        self._entropy = rospy.Publisher("~entropy", Float64, queue_size=1, latch=True)
        self._newest: Optional[ArrayGrid] = None
        self._service = rospy.Service("dynamic_map", GetMap, self._answer)

    def publish(self, grid: SavedMap, entropy: float) -> ArrayGrid:
        """Publish a map.

        Parameters
        ----------
        grid : SavedMap
        entropy : float
            Entropy of the particles' weights; published if it is above 0.

        Returns
        -------
        ArrayGrid
            The message.
        """
        message = grid_message(grid.data, grid.resolution, (*grid.origin, 0.0), self._frame, rospy.Time.now())
        self._newest = message
        self._map.publish(message)
        self._info.publish(message.info)
        if entropy > 0.0:
            self._entropy.publish(Float64(entropy))
        return message

    def _answer(self, _: object) -> ArrayMapAnswer:
        if self._newest is None:
            raise rospy.ServiceException("there is no map yet: no scan has been processed")
        return ArrayMapAnswer(self._newest)


class MapOutput:
    """Makes and publishes the map in a thread; of waiting requests only the newest is kept.

    Attributes
    ----------
    made : int
        Maps published.
    last_ms : float
        Wall time of the last one [ms].
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._topics = MapTopics(frame)
        self._path = rospy.Publisher("~path", Path, queue_size=1, latch=True)
        self._news = threading.Condition()
        self._request: Optional[Tuple[Mapper, FloatArray, List[ScanReading], List[float], float]] = None
        self._closed = False
        self.made, self.last_ms, self.total_ms = 0, 0.0, 0.0
        self.busy = threading.Lock()            # locked while a map is made, which changes the counts of its mapper
        self._thread = threading.Thread(target=self._work, name="map", daemon=True)
        self._thread.start()

    def ask(self, mapper: Mapper) -> None:
        """Request a map; call this between two scans."""
        path, readings = mapper.map_request()
        with self._news:
            self._request = mapper, path, readings, mapper.stamps[mapper.given:], mapper.entropy
            self._news.notify()

    def forget(self) -> None:
        """Drop the waiting request."""
        with self._news:
            self._request = None

    def _work(self) -> None:
        while True:
            with self._news:
                while self._request is None and not self._closed:
                    self._news.wait()
                request, self._request = self._request, None
                if self._closed or request is None:
                    return
            try:
                with self.busy:
                    self._publish(*request)
            except rospy.ROSException:
                return                              # ROS has shut down
            except Exception as error:              # the node continues; the next map may succeed
                rospy.logerr_throttle(5.0, "the map could not be made: %s: %s" % (type(error).__name__, error))
            del request                             # release the mapper while waiting

    def _publish(self, mapper: Mapper, path: FloatArray, readings: List[ScanReading], stamps: List[float],
                 entropy: float) -> None:
        began = time.perf_counter()
        message = self._topics.publish(mapper.map_of(path, readings), entropy)
        self._path.publish(path_message(mapper.base_poses(path[mapper.given:]), stamps, message.header))
        self.made += 1
        self.last_ms = 1e3 * (time.perf_counter() - began)
        self.total_ms += self.last_ms

    def close(self) -> None:
        """End the thread; returns when the current map is done."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join()


class TransformOutput:
    """Publishes map -> odom in ROS time, the identity before the first scan.

    The clock is polled in wall time. Waiting for each clock message, a thousand per second at ten times real time, used
    more CPU time than the filter.
    """

    def __init__(self, config: GmappingConfig) -> None:
        self._parent, self._child = config["map_frame"].lstrip("/"), config["odom_frame"].lstrip("/")
        self.period: float = config["transform_publish_period"]
        self.delay: float = config["tf_delay"]
        self._lock = threading.Lock()
        self._pose: FloatArray = np.zeros(3)
        self._publisher = rospy.Publisher("/tf", TFMessage, queue_size=100)
        threading.Thread(target=self._work, name="transform", daemon=True).start()

    def set(self, map_from_odom: ArrayLike) -> None:
        """Set the transform (3,) to publish."""
        with self._lock:
            self._pose = np.asarray(map_from_odom, float)

    def _work(self) -> None:
        pace = Pace()
        while not rospy.is_shutdown():
            period, now = self.period, rospy.get_time()
            if period <= 0.0:
                pace = Pace()
                rospy.rostime.wallsleep(0.2)
            elif pace.due(now, max(period, SHORTEST_PERIOD)):
                try:
                    self._send(rospy.Time.from_sec(now + self.delay))
                except rospy.ROSException:
                    return
            else:
                rospy.rostime.wallsleep(pace.wait_time(now, time.monotonic()))

    def _send(self, stamp: genpy.Time) -> None:
        with self._lock:
            pose = self._pose
        message = TransformStamped(child_frame_id=self._child)
        message.header.frame_id, message.header.stamp = self._parent, stamp
        placed = pose_message(pose)
        message.transform.rotation = placed.orientation
        message.transform.translation.x, message.transform.translation.y = placed.position.x, placed.position.y
        self._publisher.publish(TFMessage([message]))


class Pace:
    """Timer on a clock that may be fast, slow, paused or jump back."""

    def __init__(self) -> None:
        self._next: Optional[float] = None
        self._rate = 1.0                        # of the clock
        self._since: Optional[Tuple[float, float]] = None       # clock and wall time of the last measurement

    def due(self, now: float, period: float) -> bool:
        """Return whether the timer is due, and set its next time.

        Parameters
        ----------
        now : float
            Time of the clock [s]; 0 before the first clock message.
        period : float
            [s]
        """
        if not now:
            return False
        if self._next is None or self._next > now + period:         # the first one, or time has jumped back
            self._next = now
        if now < self._next:
            return False
        # missed times are skipped
        self._next = self._next + period if self._next + period > now else now + period
        return True

    def wait_time(self, now: float, wall: float) -> float:
        """Return the wall time until the next poll [s], by the recent rate of the clock.

        Parameters
        ----------
        now : float
            Time of the clock [s].
        wall : float
            Wall time [s].
        """
        if self._since is None:
            self._since = now, wall
        elif wall - self._since[1] >= RATE_SPAN:
            self._rate, self._since = max(0.0, (now - self._since[0]) / (wall - self._since[1])), (now, wall)
        if self._next is None or not self._rate:
            return LONGEST_WAIT
        return min(max((self._next - now) / self._rate, SHORTEST_WAIT), LONGEST_WAIT)


class PoseOutput:
    """Publishes the best pose of the base with every matched scan, and the particles with every processed one."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._pose = rospy.Publisher("~pose", PoseWithCovarianceStamped, queue_size=10, latch=True)
        self._particles = rospy.Publisher("~particles", PoseArray, queue_size=1, latch=True)

    def publish(self, mapper: Mapper, update: Update, stamp: genpy.Time) -> None:
        """Publish the result of one scan.

        Parameters
        ----------
        mapper : Mapper
        update : Update
        stamp : genpy.Time
        """
        particles = mapper.particles
        weights = normalise(particles.log_weights, mapper.config["ogain"] * len(particles.poses))
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.header.stamp = self._frame, stamp
        message.pose.pose = pose_message(mapper.base_poses(update.pose))
        message.pose.covariance = covariance36(covariance(particles.poses, weights, particles.best))
        self._pose.publish(message)
        if update.processed:
            back = inverse(mapper.laser.base_from_sensor)
            self._particles.publish(poses_message(compose(particles.poses, back), self._frame, stamp))


class Diagnostics:
    """Counts, times and memory on ``/diagnostics``, once a second of wall time.

    Parameters
    ----------
    intake : Intake
    counts : callable
        Returns (mapper or None, wall times of the last scans [ms]).
    maps : MapOutput
    limit : int
        Scans that may wait.
    """

    def __init__(self, intake: Intake, counts: Callable[[], Tuple[Optional[Mapper], Sequence[float]]], maps: MapOutput,
                 limit: int) -> None:
        self._intake, self._counts, self._maps, self._limit = intake, counts, maps, limit
        self._dropped = 0
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        threading.Thread(target=self._work, name="diagnostics", daemon=True).start()

    def _work(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._publisher.publish(self._message())
            except rospy.ROSException:
                return
            rospy.rostime.wallsleep(DIAGNOSTICS_PERIOD)

    def _message(self) -> DiagnosticArray:
        mapper, times = self._counts()
        intake, account = self._intake, self._intake.account
        new, self._dropped = intake.dropped - self._dropped, intake.dropped
        values: List[Tuple[str, Any]] = [
                  ("scans", intake.arrived), ("waiting", intake.waiting), ("dropped", intake.dropped),
                  ("refused", account.count(REFUSED)), ("passed over", account.count(PASSED_OVER)),
                  ("time jumps", intake.generation),
                  ("maps", self._maps.made),
                  ("last map [ms]", "%.1f" % self._maps.last_ms),
                  ("mean map [ms]", "%.1f" % (self._maps.total_ms / max(1, self._maps.made))),
                  ("without transform", account.count(NO_TRANSFORM)),
                  ("before the first transform", account.count(EARLY)),
                  *(("not used, " + reason, count) for reason, count in account.unused.items()),
                  ("peak memory [MiB]", peak_memory_mib())]
        status = DiagnosticStatus(name="%s: mapping" % rospy.get_name().lstrip("/"), hardware_id="slam_gmapping",
                                  level=DiagnosticStatus.OK, message="mapping")
        if mapper is None:
            status.message = "waiting for the first scan"
        else:
            values += [("processed", mapper.processed), ("tracked", mapper.tracked)]
            if mapper.filter is None:
                values.append(("particles", mapper.config["particles"]))
            else:
                values += [("particles", mapper.filter.count),
                           ("effective particles", "%.1f" % mapper.filter.n_eff),
                           ("resamplings", mapper.filter.resamplings)]
            values += sorted(mapper.info().items())
        if times:
            values += [("mean time of a scan [ms]", "%.2f" % np.mean(times)), ("longest [ms]", "%.2f" % max(times))]
        if new > 0:
            status.level, status.message = DiagnosticStatus.WARN, "%d scans dropped in the last second" % new
        elif mapper is not None and mapper.beyond:
            status.level, status.message = DiagnosticStatus.WARN, "the map has reached its size limit"
        elif intake.lacks:
            status.level, status.message = DiagnosticStatus.WARN, "no " + intake.lacks
        elif intake.waiting > LATE * self._limit:
            status.level, status.message = DiagnosticStatus.WARN, "%d scans wait" % intake.waiting
        status.values = [KeyValue(key, str(value)) for key, value in values]
        message = DiagnosticArray(status=[status])
        message.header.stamp = rospy.Time.now()
        return message
