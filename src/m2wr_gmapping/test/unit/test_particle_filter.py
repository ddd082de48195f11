# SPDX-License-Identifier: BSD-3-Clause
"""Which particle is the best: what scans tell, against how far its path was drawn from where they matched."""
import numpy as np
import pytest

from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.filter import particle_filter
from m2wr_gmapping.filter.particle_filter import ParticleFilter
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.odometry_kernels import user_noise
from m2wr_gmapping.mapper import Mapper
from m2wr_maps.se2 import between

COUNT, STEP = 20, np.array([0.5, 0.0, 0.0])


class Matches:
    """A matcher that finds every particle where odometry has it, and some worse than others."""

    def __init__(self):
        self.cost = np.zeros(COUNT)

    def match(self, maps, reading, starts, predictions, prior, minimum_score):
        rows = np.zeros((COUNT, mk.RESULT_SIZE))
        rows[:, :3], rows[:, mk.COST] = predictions, self.cost
        return rows


@pytest.fixture
def driven():
    """Function: the filter after that many steps straight ahead."""
    def run(steps, cost=0.0, seed=0):
        matches = Matches()
        particles = ParticleFilter(GmappingConfig.from_mapping(dict(particles=COUNT, seed=seed)), matches, np.zeros(3))
        for _ in range(steps):
            predictions = particles.poses + STEP
            particles.match(None, predictions, predictions, None, 0.0, np.array([0.02, 0.02, 0.02]))
        matches.cost[:] = cost
        return particles, matches
    return run


@pytest.mark.parametrize("seed", range(3))
def test_undistinguished_paths_follow_odometry(driven, seed):
    particles, _ = driven(100, seed=seed)
    assert np.allclose(particles.poses[particles.best], [50.0, 0.0, 0.0], atol=1e-9)
    assert particles.poses[:, 2].std() > 0.02           # the others have gone their ways


@pytest.fixture
def with_maps(monkeypatch):
    """Function: a filter whose particles have each a map of about 40 tiles, with memory for 50."""
    def make(**parameters):
        monkeypatch.setattr(particle_filter, "MOST_TILES", 50)
        config = GmappingConfig.from_mapping(dict(particles=COUNT, **parameters))
        particles = ParticleFilter(config, Matches(), np.zeros(3))
        particles.tree.extend(particles.poses)
        rng = np.random.default_rng(1)
        for k in range(COUNT):
            particles.maps.register(particles.poses[k:k + 1], rng.uniform(-9.0, 9.0, (2, 40)), k)
        return particles
    return make


def test_fewer_maps_are_kept_if_memory_is_used_up(with_maps):
    particles = with_maps()
    particles.weight_sums[5] = 1.0
    private = []
    for _ in range(40):
        private.append(particles.maps.private_tiles(particles.best))
        if particles.resample() is None:
            break
        assert particles.count == COUNT and particles.weight_sums.max() == 1.0          # the best one is among them
    assert private[0] > 500 and private == sorted(private, reverse=True) and private[-1] <= 50 < particles.maps.used


def test_compatible_particles_keep_all_their_maps(with_maps):
    particles = with_maps(compatible=True)
    assert particles.resample() is None and particles.maps.private_tiles(0) > 500


def test_path_that_scans_support_becomes_the_best(driven):
    particles, matches = driven(10)
    first, other = particles.best, 7
    assert first != other
    matches.cost = np.where(np.arange(COUNT) == other, 0.0, 60.0)
    for _ in range(10):
        before = particles.poses.copy()
        particles.match(None, before + STEP, before + STEP, None, 0.0, np.array([0.02, 0.02, 0.02]))
    assert particles.best == other
    moved = particles.poses - before
    assert np.allclose(moved[other], STEP) and np.abs(moved[first] - STEP).max() > 1e-4


def test_drift_has_the_mean_and_deviation_of_the_model():
    step, pose = np.array([0.5, 0.1, 0.3]), np.array([1.0, 2.0, 0.7])
    config = GmappingConfig.from_mapping(dict(particles=10000, srr=0.1, srt=0.05, str=0.02, stt=0.1))
    particles = ParticleFilter(config, Matches(), pose)
    particles.drift(step)
    moved = between(pose, particles.poses)
    assert np.allclose(moved.mean(axis=0), step, atol=3e-3)
    assert np.allclose(moved.std(axis=0), user_noise(config.noise, *step), rtol=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_odometry_is_kept_without_laser_returns(laser, seed):
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=COUNT, seed=seed, linearUpdate=0.5)), laser)
    nothing, truth = mapper.reading(np.full(181, np.inf)), [k * STEP for k in range(60)]
    for k, pose in enumerate(truth):
        mapper.process(nothing, pose, 0.1 * k)
    assert mapper.processed == 60
    assert np.abs(between(truth, mapper.trajectory()[1])).max() < 1e-6
    mapper.close()


def test_particles_restart_from_the_optimised_path(driven, laser):
    particles, _ = driven(10)
    particles.log_weights[:], particles.weight_sums[:] = -np.arange(COUNT), np.arange(COUNT)
    rng = np.random.default_rng(0)
    particles.poses += rng.normal(size=(COUNT, 3))          # as after a long loop, each on a map of its own
    reading = laser.reading(np.full(181, 3.0))
    for _ in range(2):
        particles.register(reading)
    path = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.2]])
    particles.replace_past(path, [reading, reading])
    assert (particles.poses == path[-1]).all() and not particles.weight_sums.any() and not particles.log_weights.any()
    assert (particles.maps.table == particles.maps.table[0]).all() and (particles.maps.table[0] >= 0).any()
    for particle in range(COUNT):
        assert (particles.tree.path(particle) == path).all()
    before = particles.poses.copy()
    particles.match(None, before + STEP, before + STEP, None, 0.0, np.array([0.02, 0.02, 0.02]))
    away = particles.poses - before - STEP
    assert np.abs(away).max() < 0.05 and away.std(axis=0).min() > 1e-3      # what sets them apart is what was drawn
