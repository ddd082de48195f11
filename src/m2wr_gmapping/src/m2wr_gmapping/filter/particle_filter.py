# SPDX-License-Identifier: BSD-3-Clause
"""Particle filter: poses, weights, maps and paths of the particles, and their update by one processed scan."""
from __future__ import annotations

import math
import zlib
from typing import TYPE_CHECKING, Optional, Sequence, Union

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.filter import filter_kernels as kernels
from m2wr_gmapping.filter import resampling
from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps
from m2wr_gmapping.filter.trajectory import TrajectoryTree
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.odometry_kernels import user_noise
from m2wr_maps.se2 import compose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.frontend.hill_climb import HillClimbMatcher
    from m2wr_gmapping.frontend.matcher import FastMatcher
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray, IndexArray

    Matcher = Union[FastMatcher, HillClimbMatcher]

LEAST_DEVIATION = 1e-6      # of a proposal, so that its inverse is finite [m, m, rad]
MOST_TILES = 3 << 14        # beyond those of one map: 36 MiB, so that a process stays below 150 MiB


def stream(seed: int, name: str) -> np.random.Generator:
    """Return a random generator of its own for one purpose; new purposes do not change the numbers of others.

    Parameters
    ----------
    seed : int
        Seed of the run.
    name : str
        Name of the purpose.
    """
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


class ParticleFilter:
    """A set of particles, each with a map and a path.

    Parameters
    ----------
    config : GmappingConfig
    matcher : FastMatcher or HillClimbMatcher
    start : (3,) float64
        Pose of all particles before the first scan, in ``map``.

    Attributes
    ----------
    poses : (N, 3) float64
        In ``map``.
    log_weights, weight_sums : (N,) float64
        Log-likelihoods of the scans since the last resampling; of the whole path, up to a constant.
    weights : (N,) float64
        Weights at the last processed scan, before resampling unless the number of particles changed; sum 1.
    """

    def __init__(self, config: GmappingConfig, matcher: Matcher, start: ArrayLike) -> None:
        count = config["particles"]
        self._least, self._most = config["min_particles"], count
        self._matcher, self._noise = matcher, config.noise
        self._gain, self._resample_below = config["ogain"], config["resampleThreshold"]     # per particle
        self._most_tiles = math.inf if config["compatible"] else MOST_TILES
        self._rng_motion, self._rng_resample = stream(config["seed"], "motion"), stream(config["seed"], "resampling")
        self.poses = np.tile(np.asarray(start, float), (count, 1))
        self.log_weights, self.weight_sums = np.zeros(count), np.zeros(count)
        self.weights = np.full(count, 1.0 / count)
        self.maps = TileMaps(count, config["delta"], NEVER if config["compatible"] else
                             tuning.PARTICLES.frozen_hits)
        self.tree = TrajectoryTree(count)
        self.resamplings = 0

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self.poses)

    @property
    def best(self) -> int:
        """Index of the particle with the most probable path."""
        return int(self.weight_sums.argmax())

    @property
    def n_eff(self) -> float:
        """Effective number of particles."""
        return resampling.effective_number(self.weights)

    def normals(self) -> FloatArray:
        """Return one row of standard normal numbers for each particle."""
        return self._rng_motion.standard_normal((self.count, 3))

    def drift(self, step: FloatArray) -> None:
        """Move all particles by an odometry step (3,) [m, m, rad], with noise."""
        self.poses = compose(self.poses, step + np.array(user_noise(self._noise, *step)) * self.normals())

    def match(self, reading: ScanReading, starts: FloatArray, predictions: FloatArray, prior: FloatArray,
              minimum_score: float, sample: Optional[FloatArray]) -> FloatArray:
        """Move each particle to the best match near its prediction, and weight it.

        Parameters
        ----------
        reading : ScanReading
            The scan.
        starts : (N, 3) float64
            Start poses in ``map``.
        predictions : (N, 3) float64
            Poses predicted by odometry.
        prior : (3,) float64
            Inverse variances along the axes of the prediction.
        minimum_score : float
            A match with this score or less is rejected.
        sample : (3,) float64 or None
            Standard deviations of the motion. The pose is drawn from the product of motion and match; None: its mode is
            used.

        Returns
        -------
        (N, 13) float64
            Result rows of the matches.
        """
        rows = self._matcher.match(self.maps, reading, starts, predictions, prior, minimum_score)
        poses = np.empty((self.count, 3))
        if sample is None:
            self.weight_sums += rows[:, mk.LOG_LIKELIHOOD]
            poses[:] = rows[:, :3]
        else:
            kernels.draw(rows, np.maximum(sample, LEAST_DEVIATION), self.normals(),
                         tuning.PARTICLES.drawn, tuning.MATCHING.dependent, self.weight_sums, poses)
        self.poses, self.weights = poses, np.empty(self.count)
        kernels.weigh(rows, mk.LOG_LIKELIHOOD, self._gain * self.count, self.log_weights, self.weights)
        return rows

    def resample(self) -> Optional[IndexArray]:
        """Resample if too few particles carry the weight, their number changes, or their maps need too much memory.

        In the last case half as many ancestors are drawn, and each has two descendants.

        Returns
        -------
        (N,) int64 or None
            The ancestors.
        """
        count, best = self.count, self.best
        if self._least < self._most:
            count = resampling.next_count(self.poses, best, self._least, self._most)
        # the first condition follows from the second one, and is fast
        is_full = self.maps.used > self._most_tiles and self.maps.private_tiles(best) > self._most_tiles
        if count == self.count and self.n_eff >= self._resample_below * count and not is_full:
            return None
        if is_full:      # not systematic: that would keep all maps if every second particle has the same one
            drawn = self._rng_resample.choice(self.count, (count + 1) // 2, p=self.weights)
            drawn[0] = best
            ancestors = np.repeat(drawn, 2)[:count]
        else:
            ancestors = resampling.systematic_resample(
                self.weights, self._rng_resample.random(), count, best if count != self.count else None)
        if count != self.count:
            self.weights = np.full(count, 1.0 / count)
        self.poses = self.poses[ancestors]
        self.weight_sums = self.weight_sums[ancestors]
        self.log_weights = np.zeros(count)
        self.maps.resample(ancestors)
        self.tree.resample(ancestors)
        self.resamplings += 1
        return ancestors

    def register(self, reading: ScanReading) -> bool:
        """Write the scan into every map and extend every path; return False if it did not fit."""
        self.tree.extend(self.poses)
        return self.maps.register(self.poses, reading.points)

    def begin_on(self, ground: ScanReading) -> None:
        """Give all particles one initial map: the end points (2, M) of ``ground``, relative to their pose."""
        self.tree.extend(self.poses)
        self.maps.register(self.poses[:1], ground.points)
        self.maps.resample(np.zeros(self.count, np.int64))

    def replace_past(self, path: FloatArray, readings: Sequence[ScanReading]) -> None:
        """Give all particles one common past along corrected poses.

        The individual maps of the other particles are dropped, so all particles restart at the end of the path.

        Parameters
        ----------
        path : (K, 3) float64
            Corrected poses of the best particle at all processed scans.
        readings : sequence of K ScanReading
            Scans of the path's nodes.
        """
        self.maps.clear()
        self.maps.register_path(path, readings)
        self.maps.resample(np.zeros(self.count, np.int64))
        self.poses = np.tile(path[-1], (self.count, 1))
        self.tree.replace(path[:-1], self.poses)
        self.log_weights[:] = self.weight_sums[:] = 0.0
