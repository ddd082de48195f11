# SPDX-License-Identifier: BSD-3-Clause
"""Grid mapping from laser scans and odometry: the class behind the node and the replay."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Tuple, Union

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.backend.loop_closing import LoopCloser
from m2wr_gmapping.backend.route import distances_along
from m2wr_gmapping.backend.step_history import StepHistory, path_of
from m2wr_gmapping.backend.turned_path import looks_alike
from m2wr_gmapping.filter import resampling
from m2wr_gmapping.filter.particle_filter import ParticleFilter
from m2wr_gmapping.frontend.hill_climb import HillClimbMatcher
from m2wr_gmapping.frontend.matcher import NO_PRIOR, WINDOW_MOST, FastMatcher
from m2wr_gmapping.frontend.occlusion import Conflict, conflict_with_nearest
from m2wr_gmapping.frontend.scan import LaserModel, ScanReading
from m2wr_gmapping.frontend.scan_gaps import ScanGaps
from m2wr_gmapping.frontend.standstill import Standstill
from m2wr_gmapping.frontend.tilt_detection import TiltDetector
from m2wr_gmapping.frontend.track import NAMES
from m2wr_gmapping.frontend.tracking import Tracker
from m2wr_gmapping.frontend.view_memory import ViewMemory
from m2wr_maps.occupancy import Occupancy
from m2wr_maps.se2 import between, compose, inverse
from m2wr_node.thread_team import ThreadTeam

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_gmapping.config import GmappingConfig
    from m2wr_maps.saved_map import SavedMap
    from m2wr_node.array_types import FloatArray

LEVEL = (0.0, 0.0)
FARTHEST_ODOMETRY = 1e9     # limit of coordinates: differences of larger ones lose precision [m]


@dataclass(frozen=True)
class Update:
    """Effect of one scan.

    Attributes
    ----------
    processed : bool
        Whether the filter used the scan: weights, paths and maps have changed.
    tracked : bool
        Whether the scan was matched.
    pose : (3,) float64
        Best estimate of the centred laser in ``map`` now.
    """

    processed: bool
    tracked: bool
    pose: FloatArray


def is_usable(odom_pose: FloatArray, stamp: float) -> bool:
    """Return whether odometry pose and stamp are finite and within their limits.

    Parameters
    ----------
    odom_pose : (3,) float64
        [m, m, rad]
    stamp : float
        [s]
    """
    return all(abs(value) < FARTHEST_ODOMETRY for value in odom_pose.tolist()) and math.isfinite(stamp)


def continued_turn(turn: float, expected: float) -> float:
    """Return the rotation of a step: more than half a turn if the robot kept turning as before.

    The difference of two headings does not tell a rotation from one of a full turn more or less. That matters if
    odometry has a wrong scale.

    Parameters
    ----------
    turn : float
        Difference of the headings [rad].
    expected : float
        Rotation if the robot turned as fast as in the step before [rad].
    """
    is_opposite = turn * expected < 0.0 and min(abs(turn), abs(expected)) > 0.5 * math.pi
    return turn + math.copysign(2.0 * math.pi, expected) if is_opposite else turn


class Mapper:
    """A particle filter over grid maps, fed one scan at a time.

    Parameters
    ----------
    config : GmappingConfig
    laser : LaserModel
        For the base frame of the paths.
    """

    _odom: FloatArray           # these four from the first scan on
    _distance: float
    _turn: float
    _last_processed: float

    def __init__(self, config: GmappingConfig, laser: LaserModel) -> None:
        self.config, self.laser = config, laser
        self._workers = ThreadTeam(config["threads"])
        self._plain: bool = config["compatible"]
        self._dense: bool = config["track_between"] and not self._plain
        self._matcher: Union[HillClimbMatcher, FastMatcher]
        self._tracker: Optional[Tracker] = None
        self._loops: Optional[LoopCloser] = None
        self._history = StepHistory()
        if self._plain:
            self._matcher = HillClimbMatcher(config, self._workers)
        else:
            self._matcher = matcher = FastMatcher(config, self._workers)
            self._tracker = Tracker(matcher, config.noise, self._dense, laser.base_from_sensor, laser.view)
            if config["loop_closing"]:
                self._loops = LoopCloser(matcher, config["delta"], self._history)
        self._motion, self._gaps, self._standstill = ViewMemory(), ScanGaps(), Standstill()
        self._level = TiltDetector(config["delta"], laser.max_range)
        self.filter: Optional[ParticleFilter] = None
        self.readings: List[ScanReading] = []
        self.stamps: List[float] = []
        self._occupancy = Occupancy([config[name] for name in ("xmin", "ymin", "xmax", "ymax")], config["delta"],
                                    config["occ_thresh"])
        self.given = 0                  # nodes of the path that are not scans: 1 with a saved map
        self._stamp = self._rate = 0.0      # time of the newest scan [s], and the robot's rate of rotation then [rad/s]
        # (stamp, index of the processed scan before, pose relative to it)
        self._between: List[Tuple[float, int, FloatArray]] = []

    @property
    def particles(self) -> ParticleFilter:
        """The filter; there is none before the first scan, which is a RuntimeError."""
        if self.filter is None:
            raise RuntimeError("the mapper has no particles before its first scan")
        return self.filter

    @property
    def processed(self) -> int:
        """Number of scans that the filter has used."""
        return len(self.stamps) - self.given

    @property
    def tracked(self) -> int:
        """Number of scans between processed ones that were matched as well."""
        return len(self._between)

    def reading(self, ranges: ArrayLike) -> ScanReading:
        """Return the ScanReading of one message's ranges (B,) for ``process``; raises ScanError."""
        return self.laser.reading(ranges, self.config["lskip"], 0.0 if self._plain else tuning.SCANS.merge_gap)

    def process(self, reading: ScanReading, odom_pose: ArrayLike, stamp: float,
                slope: Tuple[float, float] = LEVEL) -> Update:
        """Take one scan.

        Parameters
        ----------
        reading : ScanReading
            From ``reading``.
        odom_pose : (3,) float64
            Pose of the centred laser in ``odom`` when the scan was taken.
        stamp : float
            Its time [s].
        slope : (2,) float
            Slope of the laser's plane, see ``LaserModel.slope``. Scans of a pitching robot are postponed if possible.

        Returns
        -------
        Update

        Raises
        ------
        ValueError
            If the pose or the stamp is not finite, or the pose is too far.
        """
        odom = np.asarray(odom_pose, float)
        if not is_usable(odom, stamp):
            raise ValueError("odometry pose {} at {} is not finite or too far: expected numbers below {:g}".format(
                odom.tolist(), stamp, FARTHEST_ODOMETRY))
        particles = self.filter
        if particles is None:
            return self._first(reading, odom, stamp)
        tracker, tracked, step = self._tracker, False, between(self._odom, odom)
        step[2] = continued_turn(float(step[2]), self._rate * (stamp - self._stamp))
        if stamp > self._stamp:
            self._rate = float(step[2]) / (stamp - self._stamp)
        self._odom, self._stamp = odom, stamp
        self._gaps.add(stamp)
        self._standstill.add(stamp, step)
        if tracker is None:
            distance, turn, moved = math.hypot(step[0], step[1]), abs(float(step[2])), False
            particles.drift(step)
        else:
            distance, turn, moved = tracker.advance(step)
        self._distance += distance
        self._turn += turn
        due = self._due(stamp)
        if tracker is None:
            pass
        elif self._level.is_tilted(slope, reading.points, distance) and self._level.is_rocking:
            due = False
        elif due or (self._dense and (moved or self._motion.has_changed(reading))):
            self._motion.remember(reading)
            reading = self._level.level_part(reading)
            best = particles.best
            tracked = tracker.match(particles.maps, best, particles.poses[best], reading, self._conflict_of(reading),
                                    self._standstill.unexplained)
            if tracker.agrees:
                self._standstill.explain()
            # the robot may have moved without odometry; a slip has to be confirmed first
            due = (due or self._has_moved(tracker.rel)) and not tracker.undecided
        elif self._dense and tracker.agrees:        # the view has not changed
            self._standstill.explain()
        if due:
            self._process_fully(reading, stamp)
        elif tracker is not None and tracked and not tracker.undecided:    # else the path follows odometry
            self._between.append((stamp, len(self.stamps) - 1, tracker.rel))
        return Update(due, tracked, self.pose)

    def _first(self, reading: ScanReading, odom_pose: FloatArray, stamp: float) -> Update:
        self.filter = ParticleFilter(self.config, self._matcher, odom_pose)
        self.filter.register(reading)
        self._odom, self._stamp = odom_pose, stamp
        self._remember(reading, stamp)
        return Update(True, False, self.pose)

    def begin_on(self, saved: SavedMap, start: ArrayLike, reading: ScanReading, odom_pose: ArrayLike,
                 stamp: float) -> None:
        """Start on a saved map; call this before ``process`` of the first scan.

        The map is the first node of every path, at the origin. Loop closing does not move it.

        Parameters
        ----------
        saved : SavedMap
            Its resolution must be the parameter ``delta``.
        start : (3,) float
            Approximate pose of the centred laser in ``map``. The best match around it is used, within
            ``start_window`` of ``tuning``.
        reading, odom_pose, stamp
            The first scan, as for ``process``.

        Raises
        ------
        ValueError
            If a pose or the stamp is not finite, or a pose is too far.
        """
        pose, odom = np.asarray(start, float), np.asarray(odom_pose, float)
        if not (is_usable(pose, stamp) and is_usable(odom, stamp)):
            raise ValueError("start {} and odometry {} at {}: expected finite numbers below {:g}".format(
                pose, odom, stamp, FARTHEST_ODOMETRY))
        ground = ScanReading.of_walls(saved.walls())
        particles = ParticleFilter(self.config, self._matcher, np.zeros(3))
        particles.begin_on(ground)
        if isinstance(self._matcher, FastMatcher) and reading.beams.shape[1]:
            pose = self._matcher.search(particles.maps, 0, reading, pose, WINDOW_MOST, NO_PRIOR)
        particles.poses[:] = pose
        self.filter, self.given = particles, 1
        self._occupancy = Occupancy.on(saved, self.config["occ_thresh"])
        self._odom, self._stamp = odom, stamp
        self._remember(ground, stamp)
        self._distance = np.inf         # makes the first scan due
        if self._tracker is not None:
            self._tracker.relax_prior()

    def reset_odometry(self, odom_pose: ArrayLike) -> None:
        """Continue with an odometry that was reset; the robot is assumed to be at the pose of the last scan."""
        self._odom, self._rate = np.asarray(odom_pose, float), 0.0

    @property
    def odometry(self) -> FloatArray:
        """Odometry pose (3,) of the centred laser at the last scan."""
        return self._odom.copy()

    def _remember(self, reading: ScanReading, stamp: float) -> None:
        if self.readings:
            self.readings[-1].compact()
        self.readings.append(reading)
        self.stamps.append(stamp)
        self._distance = self._turn = 0.0
        self._gaps.restart()
        self._standstill.restart()
        if self._tracker is not None:
            self._tracker.restart()
            self._motion.remember(reading)
        self._last_processed = stamp

    def due_at(self, odom_pose: ArrayLike, stamp: float) -> bool:
        """Return whether the next scan would be processed, by distance, rotation or time.

        Parameters
        ----------
        odom_pose : (3,) float64
            Pose of the centred laser in ``odom`` [m, m, rad].
        stamp : float
            Time of the scan [s].
        """
        step = between(self._odom, np.asarray(odom_pose, float))
        return self._due(stamp, float(np.hypot(step[0], step[1])), abs(float(step[2])))

    def _due(self, stamp: float, further: float = 0.0, turn: float = 0.0) -> bool:
        config = self.config
        return bool(self._distance + further >= config["linearUpdate"]
                    or self._turn + turn >= config["angularUpdate"]
                    or 0.0 <= config["temporalUpdate"] < stamp - self._last_processed)

    def _conflict_of(self, reading: ScanReading) -> Callable[[FloatArray], Conflict]:
        """Return a function that tells how much a scan at a pose (3,) conflicts with the recent scans around it.

        Older scans would conflict by the drift of the path since then, which is no slip.
        """
        recent: Optional[Tuple[FloatArray, List[ScanReading]]] = None

        def conflict(pose: FloatArray) -> Conflict:
            nonlocal recent
            if recent is None:
                path = self.particles.tree.path(self.particles.best)
                along = distances_along(path)
                first = int(np.searchsorted(along, along[-1] - tuning.SEARCH.reach))
                recent = path[first:], self.readings[first:]
            return conflict_with_nearest(pose, reading, *recent, tuning.OCCLUSION.scans)
        return conflict

    def _has_moved(self, rel: FloatArray) -> bool:
        """Return whether a pose relative to the last processed scan is far enough for the next one."""
        return bool(math.hypot(rel[0], rel[1]) >= self.config["linearUpdate"]
                    or abs(float(rel[2])) >= self.config["angularUpdate"])

    def _process_fully(self, reading: ScanReading, stamp: float) -> None:
        particles, tracker, doubtful, turned = self.particles, self._tracker, False, 0.0
        anchors, least = particles.poses, self.config["minimumScore"]
        if tracker is None:
            particles.match(reading, anchors, anchors, np.zeros(3), least, None)
        else:
            starts, predictions = np.empty_like(anchors), np.empty_like(anchors)
            variances, inverse, spread = tracker.predict_particles(anchors, starts, predictions)
            rows = particles.match(reading, starts, predictions, inverse, least, spread)
            best = particles.best
            tracker.learn(particles.maps, best, anchors[best], predictions[best], reading, rows[best],
                          self._history.next_record())
            self._history.set_information(rows[best], variances)
            disagreed = tracker.has_slipped or tracker.is_doubtful
            turned = tracker.turned
            doubtful = (self._gaps.allow_turn(disagreed, self._standstill.longest) or turned != 0.0
                        or tracker.is_unexplained)
        particles.resample()
        particles.register(reading)
        self._remember(reading, stamp)
        if tracker is not None and self._history.due:
            self._recalibrate()
        if self._loops is not None:
            path = particles.tree.path(particles.best)
            if doubtful:
                self._history.mark_doubtful(looks_alike(path, self.readings, turned))
            self._replace_path(self._loops.search(path, self.readings))

    def _recalibrate(self) -> None:
        """Correct the path by the present calibration of odometry and mount; not on a saved map."""
        if self._tracker is None or self.given:
            return
        self._history.checked()
        path = self.particles.tree.path(self.particles.best)
        if self._loops is not None and self._loops.graph.links:
            self._replace_path(self._loops.recalibrate(path))
            return
        corrected = path_of(path[0], self._history.corrected(path))
        if (np.abs(corrected - path)[:, :2] > tuning.PARTICLES.same[0]).any():
            self._replace_path(corrected)

    def _replace_path(self, path: Optional[FloatArray]) -> None:
        if path is not None:
            self.particles.replace_past(path, self.readings)

    def finish(self) -> None:
        """Apply the last corrections to path and maps; call this after the last scan, or before saving."""
        if self.filter is None:
            return
        self._recalibrate()
        if self._loops is not None:
            self._replace_path(self._loops.conclude(self.filter.tree.path(self.filter.best), self.readings))

    def calibration(self) -> Dict[str, float]:
        """Return the estimated systematic errors of odometry and mount, each with its standard deviation.

        ``laser_x``, ``laser_y`` [m] and ``laser_yaw`` [rad] are to be added to the mount in the robot's model;
        ``distance`` and ``rotation`` are relative errors of odometry, ``drift`` its rotation per metre [rad/m].
        """
        if self._tracker is None:
            return {}
        found, values = {}, self._tracker.calibration
        deviations = np.sqrt(values.covariance.diagonal())
        for k, name in enumerate(NAMES):
            found[name], found[name + "_deviation"] = round(float(values.value[k]), 5), round(float(deviations[k]), 5)
        return found

    def info(self) -> Dict[str, Any]:
        """Return counts for the log."""
        found: Dict[str, Any] = {}
        loops = self._loops
        if self._tracker is not None:
            found["odometry_noise"] = self._tracker.noise.scale.round(3).tolist()
            found["calibration"] = self.calibration()
        if loops is not None:
            found.update(searches=loops.graph.searches, wide_searches=loops.wide_searches,
                         links=len(loops.graph.links), closures=loops.graph.closures)
        return found

    @property
    def beyond(self) -> bool:
        """Whether the maps have reached their size limit."""
        return self._occupancy.beyond or (self.filter is not None and self.filter.maps.beyond > 0)

    @property
    def pose(self) -> FloatArray:
        """Best estimate (3,) of the centred laser in ``map`` at the last scan."""
        particles, tracker = self.particles, self._tracker
        best = particles.poses[particles.best]
        return best.copy() if tracker is None else compose(best, tracker.rel)

    @property
    def map_from_odom(self) -> FloatArray:
        """Transform (3,) that takes odometry coordinates to map coordinates."""
        return compose(self.pose, inverse(self._odom))

    @property
    def entropy(self) -> float:
        """Entropy of the normalised weights, between 0 and ln(particles)."""
        return resampling.entropy(self.particles.weights)

    def occupancy(self, exact: bool = True) -> SavedMap:
        """Return the map (SavedMap) of the best particle's path.

        To make a map on another thread, call ``map_request`` between two scans and pass the result to ``map_of`` there.

        Parameters
        ----------
        exact : bool
            Whether scans that moved by less than the error of a step are traced again.
        """
        return self.map_of(*self.map_request(), exact=exact)

    def last_map(self) -> SavedMap:
        """Return the map of the best particle's path with little memory: the particles' maps are released.

        No scan can be processed any more.
        """
        self.particles.maps.release()
        return self._occupancy.draw(*self.map_request())

    def map_request(self) -> Tuple[FloatArray, List[ScanReading]]:
        """Return the input of ``map_of``: the best path (K, 3) and its readings."""
        return self.particles.tree.path(self.particles.best), list(self.readings)

    def map_of(self, path: FloatArray, readings: List[ScanReading], exact: bool = False) -> SavedMap:
        """Return the map (SavedMap) of a path.

        Only one thread may call this, and with paths in the order of ``map_request``.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the best particle [m, m, rad].
        readings : sequence of K ScanReading
        exact : bool
            See ``occupancy``.
        """
        # the best particle alternates between paths that differ by millimetres
        self._occupancy.update(path, readings, 0.0 if exact else tuning.PARTICLES.same)
        return self._occupancy.grid()

    def base_poses(self, poses: ArrayLike) -> FloatArray:
        """Return poses (..., 3) of the base from those of the centred laser."""
        return compose(poses, inverse(self.laser.base_from_sensor))

    def trajectory(self, between_too: bool = True) -> Tuple[FloatArray, FloatArray]:
        """Return stamps (K,) and base poses (K, 3) of the best particle's path.

        With ``between_too`` it includes the scans that were matched between processed ones.
        """
        path = self.particles.tree.path(self.particles.best)
        stamps, poses = self.stamps[self.given:], list(path[self.given:])
        if between_too:
            for stamp, index, rel in self._between:
                stamps.append(stamp)
                poses.append(compose(path[index], rel))
        order = np.argsort(np.array(stamps), kind="stable")
        return np.array(stamps)[order], self.base_poses(np.array(poses).reshape(-1, 3)[order])

    def close(self) -> None:
        """End the threads."""
        self._workers.close()
