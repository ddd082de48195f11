# SPDX-License-Identifier: BSD-3-Clause
"""The particle set: poses, weights, maps and paths, and what one processed scan does to them."""
import zlib

import numpy as np

from m2wr_gmapping.filter import filter_kernels as kernels
from m2wr_gmapping.filter import resampling
from m2wr_gmapping.filter.kld_sampling import next_count
from m2wr_gmapping.filter.motion_model import sample_motion
from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps
from m2wr_gmapping.filter.trajectory import TrajectoryTree
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.track_layout import DEPENDENT

FROZEN_HITS = 20            # a mean of that many hits is known to a few millimetres
POSE_FLOOR = np.array([0.001, 0.001, 0.0005])       # least deviation of a proposal [m, m, rad]
DRAWN = 0.3                 # share of a draw that is taken


def stream(seed, name):
    """Return the random generator of one user; adding another user changes nobody's numbers."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


class ParticleFilter:
    """Particles with a map and a path each.

    Parameters
    ----------
    config : GmappingConfig
    matcher : object
        ``match(maps, reading, starts, predictions, prior, minimum_score)`` returning result rows of ``match_kernels``.
    start : (3,) float64
        Pose of all particles before the first scan, in ``map``.

    Attributes
    ----------
    poses : (N, 3) float64
        In ``map``.
    log_weights, weight_sums : (N,) float64
        Of the scans since the last resampling; of the whole path, but for a constant.
    weights : (N,) float64
        Of the last processed scan, before it was resampled unless their number changed then; sum to 1.
    """

    def __init__(self, config, matcher, start):
        count = config["particles"]
        self._least, self._most = config["min_particles"], count
        self._matcher, self._noise = matcher, config.noise
        self._gain, self._resample_below = config["ogain"], config["resampleThreshold"]     # for each particle
        self._rng_motion, self._rng_resample = stream(config["seed"], "motion"), stream(config["seed"], "resampling")
        self.poses = np.tile(np.asarray(start, float), (count, 1))
        self.log_weights, self.weight_sums = np.zeros(count), np.zeros(count)
        self.weights = np.full(count, 1.0 / count)
        self.maps = TileMaps(count, config["delta"], NEVER if config["compatible"] else FROZEN_HITS)
        self.tree = TrajectoryTree(count)
        self.resamplings = 0

    @property
    def count(self):
        """Number of particles."""
        return len(self.poses)

    @property
    def best(self):
        """Index of the particle whose path is the most probable."""
        return int(self.weight_sums.argmax())

    @property
    def n_eff(self):
        """Effective number of particles."""
        return resampling.effective_number(self.weights)

    def normals(self):
        """Return one row of standard normal numbers for each particle."""
        return self._rng_motion.standard_normal((self.count, 3))

    def drift(self, step):
        """Move all particles by an odometry step, with noise."""
        self.poses = sample_motion(self.poses, step, self._noise, self.normals())

    def match(self, reading, starts, predictions, prior, minimum_score, sample):
        """Move each particle to the best match near its prediction and weigh it.

        Parameters
        ----------
        starts, predictions : (N, 3) float64
            Where the matches begin, and where odometry has the particles.
        prior : (3,) float64
            Inverse variances that keep the match near the pose, along the pose's axes.
        minimum_score : float
            A match of this score or less is not taken.
        sample : (3,) float64 or None
            Deviations of the motion; the pose is then drawn from the product of motion and match instead of its mode.

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
            kernels.draw(rows, np.maximum(sample, POSE_FLOOR), self.normals(), DRAWN, DEPENDENT, self.weight_sums,
                         poses)
        self.poses, self.weights = poses, np.empty(self.count)
        kernels.weigh(rows, mk.LOG_LIKELIHOOD, self._gain * self.count, self.log_weights, self.weights)
        return rows

    def resample(self):
        """Resample if too few particles carry the weight, or it takes more or fewer; return the ancestors or None."""
        count, best = self.count, self.best
        if self._least < self._most:
            count = next_count(self.poses, best, self._least, self._most)
        if count == self.count and self.n_eff >= self._resample_below * count:
            return None
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

    def register(self, reading):
        """Write the scan into every map at the particle's pose and extend every path; False if it did not fit."""
        self.tree.extend(self.poses)
        return self.maps.register_all(self.poses, reading.points)

    def begin_on(self, ground):
        """Give all particles one map that was there before: end points (2, M) of ``ground``, seen from their pose."""
        self.tree.extend(self.poses)
        if ground.points.shape[1]:
            self.maps.register_path(0, self.poses[:1], [ground])
            self.maps.resample(np.zeros(self.count, np.int64))

    def replace_past(self, path, readings):
        """Give all particles one common past along corrected poses.

        Parameters
        ----------
        path : (K, 3) float64
            Corrected poses of the best particle at all processed scans. What the others knew was where they were in
            maps of their own, which are gone: they begin anew beside it.
        readings : sequence of K objects with ``points``
        """
        for particle in range(self.count):
            self.maps.clear(particle)
        self.maps.register_path(0, path, readings)
        self.maps.resample(np.zeros(self.count, np.int64))
        self.poses = np.tile(path[-1], (self.count, 1))
        self.tree.replace(path[:-1], self.poses)
        self.log_weights[:] = self.weight_sums[:] = 0.0
