# SPDX-License-Identifier: BSD-3-Clause
"""Monte Carlo localization: scans and odometry in, the robot's pose on a map out."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Mapping, Optional

import numpy as np

from m2wr_maps.se2 import compose, inverse, wrap
from m2wr_navigation.localization.odometry_calibration import OdometryCalibration
from m2wr_navigation.localization.particle_filter import CERTAIN, Cluster, ParticleFilter
from m2wr_navigation.localization.sensor_models import LEAST_SHARE, MATCH_ROUNDS, match

if TYPE_CHECKING:
    from m2wr_navigation.localization.beams import Beams
    from m2wr_navigation.localization.localization_map import LocalizationMap
    from m2wr_node.array_types import FloatArray

#: Least deviations of the filter's pose when a scan is matched: particles may agree on a pose that is off by a cell
#: [m, m, rad].
LEAST_DEVIATION = np.array([0.03, 0.03, 0.015])
LEARN_SHARE = 0.6           # of the beams that must end near obstacles, for errors of the odometry to be learnt
TRACK = 0.3                 # m: the filter's pose and the track of the calibration differ by more: one of them is wrong
ONE_PLACE = 0.5             # share of the weight from which the heaviest cluster is the place, and scans are matched


@dataclass(frozen=True)
class Outcome:
    """What a scan has led to.

    Attributes
    ----------
    updated : bool
        Whether the particles were weighed by this scan.
    injected : int
        Number of random particles that were added.
    estimate : Cluster or None
        The pose, after a resampling or a new start; None: no new one is due.
    map_from_odom : (3,) float64 or None
        Pose of the odometry's frame on the map; None: not known yet.
    share : float
        Of the beams with a return that end near obstacles of the map, seen from the pose; NaN: there are none, or there
        is no pose yet.
    weight : float
        Share of the particles' weight that agrees on the pose.
    """

    updated: bool
    injected: int
    estimate: Optional[Cluster]
    map_from_odom: Optional[FloatArray]
    share: float
    weight: float


class Localizer:
    """Decides when to update the filter and when to draw new particles, and fits scans in between.

    Parameters
    ----------
    grid : LocalizationMap
    values : mapping of str to object
        Parameters of ``amcl_parameters``.
    rng : numpy.random.Generator

    Attributes
    ----------
    filter : ParticleFilter
    map_from_odom : (3,) float64 or None
    pose : (3,) float64 or None
        Of the base on the map at the newest scan.
    last : Cluster or None
        The newest estimate that was due.
    calibration : OdometryCalibration
        What odometry does wrong; without ``odom_learning`` nothing.
    """

    def __init__(self, grid: LocalizationMap, values: Mapping[str, Any], rng: np.random.Generator) -> None:
        self.grid, self.values, self._rng = grid, values, rng
        self.filter = ParticleFilter(values, rng)
        self.map_from_odom: Optional[FloatArray] = None
        self.pose: Optional[FloatArray] = None
        self.last: Optional[Cluster] = None
        self._mean: Optional[FloatArray] = None         # of the heaviest cluster, relative to odometry
        self._covariance: FloatArray = np.eye(3)
        self._weight = 0.0                              # of the heaviest cluster
        self._odom: Optional[FloatArray] = None         # at the last update
        self.calibration = OdometryCalibration()
        self._measured: FloatArray = np.zeros(3)        # odometry at the newest scan, as it came
        self._due: Dict[str, bool] = {}                 # by laser
        self._forced = self._fresh = False
        self._updates = 0

    # ---- what users ask for

    def start_at(self, mean: FloatArray, covariance: FloatArray, forced: bool = False) -> None:
        """Start again around a pose.

        Parameters
        ----------
        mean : (3,) float64
            x, y [m], theta [rad] in the map's frame.
        covariance : (3, 3) float64
        forced : bool
            Whether to update with the next scan once more.
        """
        self.filter.start_at(np.asarray(mean, float), np.asarray(covariance, float))
        self._restart(forced)

    def start_anywhere(self) -> None:
        """Start again with particles in the whole free space."""
        self.filter.start_anywhere(self.grid)
        self._restart(False)

    def _restart(self, forced: bool) -> None:
        self.calibration.lose()
        self._odom, self._updates, self._forced, self._fresh = None, 0, forced, True
        self._weight = 0.0

    def force_update(self) -> None:
        """Update the filter with the next scan of each laser, although the robot has not moved."""
        self._forced = True

    def set_map(self, grid: LocalizationMap) -> None:
        """Take another map; the particles have to be started again."""
        self.grid, self.map_from_odom, self.pose, self.last = grid, None, None, None

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other parameters, and start again around the newest estimate; without one the particles stay.

        Parameters
        ----------
        values : mapping of str to object
        """
        self.values = self.filter.values = values
        if not values["odom_learning"]:
            self.calibration.forget()
        if self.last is not None:
            self.start_at(self.last.pose, self.last.covariance)

    # ---- scans

    def process(self, laser: str, beams: Beams, odom_pose: FloatArray) -> Outcome:
        """Take a scan.

        Parameters
        ----------
        laser : str
            Which laser it is from; its frame.
        beams : Beams
        odom_pose : (3,) float64
            Pose of the base in the odometry's frame at the scan's time.

        Returns
        -------
        Outcome
        """
        self._measured = np.asarray(odom_pose, float)
        outcome = self._process(laser, beams, self.calibration.step(self._measured))
        if self.values["odom_learning"] and outcome.share >= LEARN_SHARE and outcome.weight >= CERTAIN:
            self._learn(beams)
        return outcome

    def _learn(self, beams: Beams) -> None:
        """Let the calibration of the odometry look at a scan that fits."""
        calibration = self.calibration
        if not calibration.is_due:
            return
        assert self.pose is not None
        track = calibration.track
        if track is None or np.hypot(*(track - self.pose)[:2]) > TRACK:
            calibration.begin(self.pose)
            return
        found = match(track, calibration.covariance, beams, self.grid, self.values)
        if found.share >= LEARN_SHARE and np.isfinite(found.pose).all():
            calibration.look(found.pose, found.covariance)

    def _process(self, laser: str, beams: Beams, odom_pose: FloatArray) -> Outcome:
        """Take a scan; ``odom_pose`` is that of the corrected odometry."""
        self._due.setdefault(laser, True)
        if self._odom is None:
            self._odom = odom_pose
            self._due = dict.fromkeys(self._due, True)
        elif self._moved(odom_pose) or self._forced:
            self._due, self._forced = dict.fromkeys(self._due, True), False
        if not self._due[laser]:
            return self._between_updates(beams, odom_pose)
        self.filter.move(self._odom, odom_pose)
        fit = self.filter.sense(beams, self.grid)
        self._odom = odom_pose
        if fit is None:                     # the next scan may be of use
            return self._between_updates(beams, odom_pose)
        self._due[laser] = False
        self._updates += 1
        cluster = self.filter.best_cluster()
        resample = not self._updates % self.values["resample_interval"]
        injected = self.filter.resample(beams, self.grid) if resample else 0
        self._mean, self._covariance = between_odometry(cluster.pose, odom_pose), cluster.covariance
        self._weight = cluster.weight
        share = self._locate(beams, cluster.pose)
        if not (resample or self._fresh):
            return Outcome(True, injected, None, self.map_from_odom, share, self._weight)
        self._fresh = False
        assert self.pose is not None
        self.last = Cluster(self.pose, cluster.covariance, cluster.weight)
        return Outcome(True, injected, self.last, self.map_from_odom, share, self._weight)

    def _moved(self, odom_pose: FloatArray) -> bool:
        assert self._odom is not None
        way = np.abs(odom_pose - self._odom)
        return bool(way[0] > self.values["update_min_d"] or way[1] > self.values["update_min_d"]
                    or abs(float(wrap(way[2]))) > self.values["update_min_a"])

    def _between_updates(self, beams: Beams, odom_pose: FloatArray) -> Outcome:
        share = float("nan")
        if self._mean is not None and not self._fresh:
            share = self._locate(beams, compose(self._mean, odom_pose))
        return Outcome(False, 0, None, self.map_from_odom, share, self._weight)

    def _locate(self, beams: Beams, pose: FloatArray) -> float:
        """Set ``map_from_odom`` from the filter's pose, or from that of a scan fitted around it.

        Along a single wall the track of the calibration knows more than the filter, whose pose wanders by its draws.
        """
        covariance, track = self._covariance + np.diag(LEAST_DEVIATION ** 2), self.calibration.track
        rounds = MATCH_ROUNDS if self.values["scan_matching"] and self._weight >= ONE_PLACE else 0
        if rounds and track is not None and np.hypot(*(track - pose)[:2]) <= TRACK:
            pose, covariance = track, self.calibration.covariance
        better, share, _ = match(pose, covariance, beams, self.grid, self.values, rounds)
        if rounds and share >= LEAST_SHARE and np.isfinite(better).all():
            pose = better
        self.pose, self.map_from_odom = pose, between_odometry(pose, self._measured)
        return share


def between_odometry(pose: FloatArray, odom_pose: FloatArray) -> FloatArray:
    """Return the pose of the odometry's frame on the map.

    Parameters
    ----------
    pose : (3,) float64
        Of the base on the map.
    odom_pose : (3,) float64
        Of the base in the odometry's frame.
    """
    return compose(pose, inverse(odom_pose))
