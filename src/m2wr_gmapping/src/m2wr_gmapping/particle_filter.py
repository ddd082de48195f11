"""The particle set: poses, weights, maps and paths, and what one processed scan does to them."""
import zlib

import numpy as np

from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping import resampling
from m2wr_gmapping.matcher import DEPENDENT
from m2wr_gmapping.motion_model import sample_motion
from m2wr_gmapping.se2 import compose, wrap
from m2wr_gmapping.tile_maps import NEVER, TileMaps
from m2wr_gmapping.trajectory import TrajectoryTree

FROZEN_HITS = 20            # a mean of that many hits is known to a few millimetres
POSE_FLOOR = np.array([0.001, 0.001, 0.0005])       # least deviation of a proposal [m, m, rad]
DRAWN = 0.3


def stream(seed, name):
    """Return the random generator of one user; adding another user changes nobody's numbers."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


class ParticleFilter:
    """Particles with a map and a path each.

    Parameters
    ----------
    config : GmappingConfig
    matcher : object
        ``match(maps, reading, starts, predictions, prior)`` returning result rows of ``match_kernels``.
    start : (3,) float64
        Pose of all particles before the first scan, in ``map``.

    Attributes
    ----------
    poses : (N, 3) float64
        In ``map``.
    log_weights, weight_sums : (N,) float64
        Of the scans since the last resampling; of the whole path, but for a constant.
    weights : (N,) float64
        Of the last processed scan, before it was resampled; sum to 1.
    """

    def __init__(self, config, matcher, start):
        self._count = config["particles"]
        self._matcher, self._noise = matcher, config.noise
        self._gain = config["ogain"] * self._count
        self._resample_below = config["resampleThreshold"] * self._count
        self._rng_motion, self._rng_resample = stream(config["seed"], "motion"), stream(config["seed"], "resampling")
        self.poses = np.tile(np.asarray(start, float), (self._count, 1))
        self.log_weights, self.weight_sums = np.zeros(self._count), np.zeros(self._count)
        self.weights = np.full(self._count, 1.0 / self._count)
        self.maps = TileMaps(self._count, config["delta"], NEVER if config["compatible"] else FROZEN_HITS)
        self.tree = TrajectoryTree(self._count)
        self.resamplings = 0

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
        return self._rng_motion.standard_normal((self._count, 3))

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
        self.log_weights += rows[:, mk.LOG_LIKELIHOOD]
        poses = rows[:, :3].copy()
        if sample is None:
            self.weight_sums += rows[:, mk.LOG_LIKELIHOOD]
        else:
            self.weight_sums -= rows[:, mk.COST] / DEPENDENT
            poses = self._sampled(poses, rows[:, mk.INFORMATION:], np.maximum(sample, POSE_FLOOR))
        self.poses = poses
        self.weights = resampling.normalise(self.log_weights, self._gain)
        return rows

    def _sampled(self, poses, information, deviations):
        """Draw from Gaussians of the given information plus that of the motion, around the poses.

        Scans seldom tell particles apart by the little that each draw moves them, and what is drawn adds up: the best
        stays where its match has it, and a path is the less probable the further its poses were drawn from theirs.
        """
        h = information[:, (0, 1, 2, 1, 3, 4, 2, 4, 5)]
        h[:, ::4] += 1.0 / np.square(deviations)
        lower = np.linalg.cholesky(h.reshape(-1, 3, 3))
        normals = DRAWN * self.normals()
        normals[self.best] = 0.0
        self.weight_sums -= 0.5 * np.square(normals).sum(axis=1)
        return compose(poses, np.linalg.solve(np.transpose(lower, (0, 2, 1)), normals[..., None])[..., 0])

    def resample(self):
        """Resample if too few particles carry the weight; return the ancestors or None."""
        if self.n_eff >= self._resample_below:
            return None
        ancestors = resampling.systematic_resample(self.weights, self._rng_resample.random())
        self.poses = self.poses[ancestors]
        self.weight_sums = self.weight_sums[ancestors]
        self.log_weights[:] = 0.0
        self.maps.resample(ancestors)
        self.tree.resample(ancestors)
        self.resamplings += 1
        return ancestors

    def register(self, reading):
        """Write the scan into every map at the particle's pose and extend every path; False if it did not fit."""
        self.tree.extend(self.poses)
        if not reading.points.shape[1]:
            return True
        reach = float(np.hypot(reading.points[0], reading.points[1]).max())
        fits = self.maps.cover(self.poses[:, :2].min(axis=0) - reach, self.poses[:, :2].max(axis=0) + reach)
        self.maps.register_all(np.ascontiguousarray(self.poses), reading.points)
        return fits

    def begin_on(self, ground):
        """Give all particles one map that was there before: end points (2, M) of ``ground``, seen from their pose."""
        self.tree.extend(self.poses)
        if ground.points.shape[1]:
            pose = self.poses[0]
            reach = float(np.hypot(ground.points[0], ground.points[1]).max())
            self.maps.cover(pose[:2] - reach, pose[:2] + reach)
            self.maps.register(0, pose, ground.points)
            self.maps.resample(np.zeros(self._count, np.int64))

    def replace_past(self, path, readings):
        """Give all particles one common past along corrected poses.

        Parameters
        ----------
        path : (K, 3) float64
            Corrected poses of the best particle at all processed scans. The others keep their pose relative to it.
        readings : sequence of K objects with ``points``
        """
        offset = self.poses - self.poses[self.best]
        theta = path[-1, 2] - self.poses[self.best, 2]
        c, s = np.cos(theta), np.sin(theta)
        moved = np.stack([path[-1, 0] + c * offset[:, 0] - s * offset[:, 1],
                          path[-1, 1] + s * offset[:, 0] + c * offset[:, 1],
                          wrap(self.poses[:, 2] + theta)], -1)
        for particle in range(self._count):
            self.maps.clear(particle)
        for pose, reading in zip(path, readings):
            if reading.points.shape[1]:
                reach = float(np.hypot(reading.points[0], reading.points[1]).max())
                self.maps.cover(pose[:2] - reach, pose[:2] + reach)
                self.maps.register(0, pose, reading.points)
        self.maps.resample(np.zeros(self._count, np.int64))
        self.poses = moved
        self.tree.replace(path[:-1], moved)
        self.log_weights[:] = 0.0
