# SPDX-License-Identifier: BSD-3-Clause
"""How many particles there are where their number may change: few where they agree, all where they spread."""
import math
import statistics

import numpy as np
import pytest

from conftest import drive, odometry
from m2wr_gmapping import tuning
from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.filter.particle_filter import ParticleFilter
from m2wr_gmapping.filter.resampling import needed, systematic_resample
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.mapper import Mapper

FEWEST, MOST, STEP = 4, 40, np.array([0.5, 0.0, 0.0])


class Matches:
    """A matcher that finds every particle where odometry has it."""

    def match(self, maps, reading, starts, predictions, prior, minimum_score):
        rows = np.zeros((len(starts), mk.RESULT_SIZE))
        rows[:, :3] = predictions
        return rows


class Wall:
    """A reading with a few end points ahead."""

    points = np.array([[2.0, 2.0, 2.0], [-1.0, 0.0, 1.0]])


def moved(particles, deviations):
    """One processed scan; returns how many particles there are."""
    at = particles.poses + STEP
    particles.match(Wall, at, at, None, 0.0, np.asarray(deviations, float))
    particles.resample()
    particles.register(Wall)
    return particles.count


@pytest.mark.parametrize("boxes", [2, 3, 7, 30])
def test_particle_count_equals_the_formula(boxes):
    poses = np.zeros((2 * boxes, 3))
    poses[:, 0] = np.repeat(np.arange(boxes), 2) * tuning.PARTICLES.bin[0]
    normal = statistics.NormalDist().inv_cdf(0.99)
    a, b = 2.0 / (9.0 * (boxes - 1)), (boxes - 1) / (2.0 * tuning.PARTICLES.kld[0])
    assert needed(poses, 0) == math.ceil(b * (1.0 - a + math.sqrt(a) * normal)**3)


def test_bins_are_centred_on_the_best_particle_and_wrap():
    aside = np.array([[0, 0, 0], [1, -1, 1], [-1, 1, -1]])
    poses = np.array([0.949, -3.051, math.pi]) + 0.3 * np.array(tuning.PARTICLES.bin) * aside
    poses[:, 2] = (poses[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    assert needed(poses, 0) == 1


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [1, 3, 10, 11, 60])
def test_resampling_to_another_count_equals_reference(seed, count):
    rng = np.random.default_rng(seed)
    weights = rng.random(10)**4
    weights /= weights.sum()
    start = rng.random()
    plain = [next(i for i in range(10) if weights[:i + 1].sum() > (start + k) / count or i == 9) for k in range(count)]
    ancestors = systematic_resample(weights, start, count)
    assert sorted(ancestors) == sorted(plain)
    assert all(ancestors[i] == i for i in set(plain) if i < count)
    for keep in range(10):
        kept = systematic_resample(weights, start, count, keep)
        assert keep in kept and len(kept) == count
        changed = np.abs(np.bincount(kept, minlength=10) - np.bincount(plain, minlength=10)).sum()
        assert changed == (0 if keep in plain else 2)


def test_particle_count_follows_the_spread():
    config = GmappingConfig.from_mapping(dict(particles=MOST, min_particles=FEWEST))
    particles = ParticleFilter(config, Matches(), np.zeros(3))
    assert particles.count == MOST
    assert moved(particles, [1e-3, 1e-3, 1e-3]) == FEWEST            # all stand in one place
    counts = [moved(particles, [0.2, 0.2, 0.1]) for _ in range(60)]
    assert max(counts) == MOST and all(FEWEST <= count <= MOST for count in counts)
    assert particles.weights.shape == particles.log_weights.shape == particles.weight_sums.shape == (particles.count,)
    assert len(particles.tree.leaves) == particles.maps.table.shape[0] == particles.count
    before = particles.poses[particles.best].copy()
    particles.poses[:] = before
    assert moved(particles, [1e-3, 1e-3, 1e-3]) == FEWEST
    assert np.allclose(particles.poses[particles.best], before + STEP, atol=0.01)
    held = particles.maps.table[particles.maps.table >= 0]
    kept, tiles = particles.maps.compact(), particles.maps.blocks[held]
    assert len(kept["blocks"]) == len(np.unique(held))      # the maps of those that went are free
    assert len(kept["mean"]) == len(np.unique(tiles[tiles >= 0]))


def test_best_particle_survives_a_reduction():
    config = GmappingConfig.from_mapping(dict(particles=MOST, min_particles=1))
    particles = ParticleFilter(config, Matches(), np.zeros(3))
    particles.weight_sums[MOST - 1] = 5.0
    particles.poses[MOST - 1, 1] = 0.01
    assert moved(particles, [1e-3, 1e-3, 1e-3]) == 1
    assert particles.poses[0] == pytest.approx(STEP + [0.0, 0.01, 0.0], abs=1e-9)


def test_particle_count_is_fixed_by_default(ring, laser):
    def counts(**parameters):
        mapper = Mapper(GmappingConfig.from_mapping(dict(
            particles=20, linearUpdate=0.5, angularUpdate=0.3, **parameters)), laser)
        truth = drive(0.5)
        odom, seen = odometry(truth, np.random.default_rng(3)), []
        for k, pose in enumerate(truth):
            if mapper.process(mapper.reading(ring.ranges(pose, laser.angles)), odom[k], 0.1 * k).processed:
                seen.append(mapper.filter.count)
        mapper.close()
        return set(seen)
    assert counts() == counts(min_particles=20) == {20}
    adapting = counts(min_particles=3)
    assert min(adapting) == 3 and max(adapting) <= 20


def test_minimum_above_maximum_is_refused():
    with pytest.raises(ConfigError, match="min_particles 31 and particles 30: expected the first not above"):
        GmappingConfig.from_mapping(dict(min_particles=31))
    assert GmappingConfig.from_mapping(dict(min_particles=12.4))["min_particles"] == 12
