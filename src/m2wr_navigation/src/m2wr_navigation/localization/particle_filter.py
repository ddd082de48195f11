# SPDX-License-Identifier: BSD-3-Clause
"""The particles: moved by odometry, weighed by scans, drawn again."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping, Optional

import numpy as np

from m2wr_navigation.localization import particle_kernels as kernels
from m2wr_navigation.localization.motion_kernels import move_differential, move_omnidirectional
from m2wr_navigation.localization.place_search import PlaceSearch
from m2wr_navigation.localization.sensor_models import INDEPENDENT, INDEPENDENT_APART, Fit, weigh

if TYPE_CHECKING:
    from m2wr_navigation.localization.beams import Beams
    from m2wr_navigation.localization.localization_map import LocalizationMap
    from m2wr_node.array_types import FloatArray

CONVERGED = 0.5             # all particles are this near to their mean, along x and y [m]; amcl's
CANDIDATES = 40             # poses that are tried for each particle, when the robot may be anywhere
LEAST_CENTRED = 20          # numbers from which their mean is removed: the deviation hardly suffers
CERTAIN = 0.95              # share of the weight from which one cluster is the only place
#: Deviations by which copies of a particle differ: half a cell of 5 cm, and what that is at 2 m [m, m, rad].
ROUGHNESS = np.array([0.02, 0.02, 0.01])


@dataclass(frozen=True)
class Cluster:
    """Particles that agree.

    Attributes
    ----------
    pose : (3,) float64
        Their mean: x, y [m], theta [rad].
    covariance : (3, 3) float64
        Of these particles only [m, m, rad].
    weight : float
        Their share of the weight.
    """

    pose: FloatArray
    covariance: FloatArray
    weight: float


class ParticleFilter:
    """A set of weighted poses.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of ``amcl_parameters``.
    rng : numpy.random.Generator

    Attributes
    ----------
    poses : (N, 3) float64
        x, y [m], theta [rad] in the map's frame.
    weights : (N,) float64
        With sum 1.
    slow, fast : float
        Averages of the weight before normalisation, while nearly all of it is in one place; 0: none yet.
    """

    def __init__(self, values: Mapping[str, Any], rng: np.random.Generator) -> None:
        self.values, self._rng = values, rng
        self.poses: FloatArray = np.zeros((1, 3))
        self.weights: FloatArray = np.ones(1)
        self.slow = self.fast = 0.0
        self._averaged = 0              # number of values in both
        self.anywhere = False           # the next scan chooses among many poses
        self.certain = True             # nearly all the weight is in one cluster
        self.search: Optional[PlaceSearch] = None       # while the robot may be in several places

    def _start(self, poses: FloatArray) -> None:
        self.poses, self.weights = np.ascontiguousarray(poses), np.full(len(poses), 1.0 / len(poses))
        self.slow, self.fast, self._averaged = 0.0, 0.0, 0
        self.anywhere, self.certain, self.search = False, True, None

    def start_at(self, mean: FloatArray, covariance: FloatArray) -> None:
        """Draw all particles from a normal distribution.

        Parameters
        ----------
        mean : (3,) float64
        covariance : (3, 3) float64
            Symmetric; negative eigenvalues count as 0.
        """
        sizes, axes = np.linalg.eigh(covariance)
        noise = self._rng.standard_normal((self.values["max_particles"], 3)) * np.sqrt(np.maximum(sizes, 0.0))
        poses = mean + (noise[:, None, :] * axes).sum(-1)      # no BLAS: its threads spin
        poses[:, 2] = (poses[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
        self._start(poses)

    def start_anywhere(self, grid: LocalizationMap) -> None:
        """Draw all particles from the whole free space; the next scan then chooses from many more poses."""
        self._start(grid.random_poses(self.values["max_particles"], self._rng))
        self.anywhere, self.certain, self.search = True, False, PlaceSearch()

    def move(self, before: FloatArray, after: FloatArray) -> None:
        """Move the particles as odometry did.

        Parameters
        ----------
        before, after : (3,) float64
            Poses of the base in the odometry's frame.
        """
        values = self.values
        step = after - before
        step[2] = (step[2] + math.pi) % (2.0 * math.pi) - math.pi
        alphas = np.array([values["odom_alpha%d" % k] for k in range(1, 6)])
        model = values["odom_model_type"]
        kernel = move_omnidirectional if model.startswith("omni") else move_differential
        kernel(self.poses, float(before[2]), step, alphas, model.endswith("corrected"),
               self._centred_noise(len(self.poses)))
        if self.search is not None:
            self.search.move(before, after)

    def _centred_noise(self, count: int) -> FloatArray:
        """Return normal numbers (count, 3) with mean 0: that of few numbers would move the pose without a reason."""
        noise = self._rng.standard_normal((count, 3))
        return noise - noise.mean(axis=0) if count >= LEAST_CENTRED else noise

    def sense(self, beams: Beams, grid: LocalizationMap) -> Optional[Fit]:
        """Weigh the particles by a scan.

        Parameters
        ----------
        beams : Beams
        grid : LocalizationMap

        Returns
        -------
        Fit or None
            How the particles fit; None if no beam could be used, then nothing has changed.
        """
        if self.anywhere and beams.hit.any():
            self.poses, self.anywhere = self._likely_poses(len(self.poses), beams, grid), False
            self.weights = np.full(len(self.poses), 1.0 / len(self.poses))
        fit = weigh(self.poses, beams, grid, self.values, self.converged,
                    INDEPENDENT if self.certain else INDEPENDENT_APART)
        if fit is None:
            return None
        weights = self.weights * np.exp(fit.log_weights - fit.log_weights.max())
        total = weights.sum()
        average = float((self.weights * fit.goodness).sum())
        self.weights = weights / total if total > 0.0 else np.full(len(weights), 1.0 / len(weights))
        if self.search is not None:
            self._look(self.search, fit.log_weights, beams, grid)
        if self.certain:        # of particles that are in several places, most do not fit
            self._averaged += 1
            self.slow = self._average(self.slow, average, self.values["recovery_alpha_slow"])
            self.fast = self._average(self.fast, average, self.values["recovery_alpha_fast"])
        return fit

    def _look(self, search: PlaceSearch, fit: FloatArray, beams: Beams, grid: LocalizationMap) -> None:
        """Let the places of a search share the weight; end it if one is left."""
        search.look(self.poses, fit, beams, grid, self.values)
        self.poses, self.weights = search.share_out(self.poses, self.weights, self._rng)
        if search.decided:
            self.search = None

    def _average(self, mean: float, value: float, rate: float) -> float:
        """Return an average with one value more: of all values, until the rate is the greater weight of the new one."""
        return mean + max(rate, 1.0 / self._averaged) * (value - mean) if rate > 0.0 else 0.0

    def _likely_poses(self, count: int, beams: Beams, grid: LocalizationMap) -> FloatArray:
        """Return poses (count, 3) of the whole free space, drawn by how well a scan fits from them."""
        poses = grid.random_poses(CANDIDATES * count, self._rng)
        fit = weigh(poses, beams, grid, self.values, False, INDEPENDENT_APART) if count else None
        if fit is None:
            return poses[:count]
        weights = np.exp(fit.log_weights - fit.log_weights.max())
        chosen = np.empty(count, np.int64)
        kernels.draw_systematically(weights / weights.sum(), self._rng.random(), chosen)
        return self._rng.permutation(poses[chosen])

    @property
    def converged(self) -> bool:
        """Whether all particles are near their mean."""
        away = np.abs(self.poses[:, :2] - (self.weights[:, None] * self.poses[:, :2]).sum(0))
        return bool((away <= CONVERGED).all())

    @property
    def effective(self) -> float:
        """Effective number of particles, 1 / sum(w^2)."""
        return 1.0 / float(np.square(self.weights).sum())

    def resample(self, beams: Beams, grid: LocalizationMap) -> int:
        """Draw particles by their weights, as many as their spread needs.

        If the scans fit worse than they did, a share of the particles is drawn from the whole map instead, by how well
        the scan fits there. So a robot that was carried away is found again.

        Parameters
        ----------
        beams : Beams
            Of the newest scan.
        grid : LocalizationMap

        Returns
        -------
        int
            Number of particles from the whole map.
        """
        # while there are several places, drawing without need would lose some of them by chance
        if (self.values["selective_resampling"] or not self.certain) and self.effective > 0.5 * len(self.weights):
            return 0
        most, rng = self.values["max_particles"], self._rng
        share = max(0.0, 1.0 - self.fast / self.slow) if self.slow > 0.0 and self.certain else 0.0
        if not (self.values["recovery_alpha_slow"] and self.values["recovery_alpha_fast"]):
            share = 0.0
        random = rng.random(most) < share
        newly_drawn = self._likely_poses(int(random.sum()), beams, grid)
        drawn = np.empty(most - len(newly_drawn), np.int64)
        kernels.draw_systematically(self.weights, rng.random(), drawn)
        poses = np.empty((most, 3))
        poses[random], poses[~random] = newly_drawn, self.poses[rng.permutation(drawn)]
        count = kernels.adaptive_count(poses, self.values["min_particles"], self.values["kld_err"],
                                       self.values["kld_z"])
        injected = int(random[:count].sum())
        drawn = np.empty(count - injected, np.int64)
        kernels.draw_systematically(self.weights, rng.random(), drawn)
        copies = self.poses[drawn] + ROUGHNESS * self._centred_noise(len(drawn))
        if self.certain and not injected and count >= LEAST_CENTRED:
            # the draw must not move the mean: along a single wall nothing would bring it back
            copies[:, :2] += (self.weights[:, None] * self.poses[:, :2]).sum(0) - copies[:, :2].mean(axis=0)
        self.poses = np.concatenate([copies, newly_drawn[:injected]])
        self.weights = np.full(count, 1.0 / count)
        return injected

    def best_cluster(self) -> Cluster:
        """Return the cluster with the greatest weight."""
        labels = np.empty(len(self.poses), np.int64)
        count = kernels.label_clusters(self.poses, labels)
        shares = np.bincount(labels, self.weights, count)
        best = int(np.argmax(shares))
        pose, covariance = np.empty(3), np.empty((3, 3))
        kernels.cluster_moments(self.poses, self.weights, labels, best, pose, covariance)
        self.certain = self.search is None and bool(shares[best] >= CERTAIN)
        return Cluster(pose, covariance, float(shares[best]))
