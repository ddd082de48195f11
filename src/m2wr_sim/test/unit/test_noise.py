# SPDX-License-Identifier: BSD-3-Clause
"""Noise: statistics, bias, repeatability."""
import logging
import math

import numpy as np
import pytest

from m2wr_sim.model.types import Noise
from m2wr_sim.sensors.noise import TABLE_SIZE, NoiseModel


def make(seed=1, block=720, **numbers):
    return NoiseModel(Noise(**dict(dict(kind="gaussian", stddev=0.02), **numbers)), np.random.default_rng(seed), block)


def draws(model, calls, count=720):
    starts = [model.advance(count) for _ in range(calls)]
    return np.concatenate([model.normals[start:start + count] for start in starts])


def test_draws_are_standard_normal_and_differ_between_calls():
    values = draws(make(), 150)
    assert abs(values.mean()) < 0.02 and abs(values.std() - 1.0) < 0.02
    assert len(np.unique(values)) == values.size


def test_same_seed_same_noise_other_seed_other_noise():
    first = draws(make(4), 3)
    np.testing.assert_array_equal(draws(make(4), 3), first)
    assert (draws(make(5), 3) != first).all()


def test_reset_with_the_same_seed_keeps_the_bias():
    model = make(4, bias_mean=0.3, bias_stddev=0.1)
    first, bias = draws(model, 300), model.bias
    model.reset(np.random.default_rng(4))
    np.testing.assert_array_equal(draws(model, 300), first)
    model.reset(np.random.default_rng(9))
    assert model.bias == bias and (draws(model, 300) != first).any()


def test_reading_never_leaves_the_table_and_does_not_soon_repeat():
    model, block = make(block=1000), 1000
    starts = [model.advance(block) for _ in range(3000)]
    assert min(starts) >= 0 and max(starts) + block <= model.normals.size == TABLE_SIZE
    assert len(set(starts)) == len(starts)


def test_table_is_larger_than_any_block():
    model = make(block=TABLE_SIZE + 1)
    assert model.advance(TABLE_SIZE + 1) + TABLE_SIZE + 1 <= model.normals.size
    with pytest.raises(ValueError, match="at most"):
        model.advance(TABLE_SIZE + 2)


def test_bias_has_the_wanted_size_and_either_sign():
    biases = np.array([make(seed, stddev=0.0, bias_mean=0.5, bias_stddev=0.1).bias for seed in range(400)])
    assert abs(np.abs(biases).mean() - 0.5) < 0.03 and abs(np.abs(biases).std() - 0.1) < 0.02
    assert 0.4 < (biases > 0).mean() < 0.6


def test_mean_is_added_and_without_bias_nothing_is_drawn():
    rng = np.random.default_rng(0)
    model = NoiseModel(Noise(kind="gaussian", mean=0.25), rng, 10)
    assert (model.shift, model.bias, model.stddev) == (0.25, 0.0, 0.0)
    assert rng.random() == np.random.default_rng(0).random()


@pytest.mark.parametrize("kind", ["none", "custom"])
def test_silent_kinds_have_no_noise_and_are_no_error(kind, caplog):
    model = make(kind=kind, mean=1.0, bias_mean=1.0, precision=0.5)
    assert (model.shift, model.stddev, model.precision) == (0.0, 0.0, 0.0) and not caplog.records


def test_unknown_kind_is_reported_and_has_no_noise(caplog):
    with caplog.at_level(logging.ERROR):
        model = make(kind="salt", mean=1.0)
    assert (model.shift, model.stddev) == (0.0, 0.0)
    assert "Unrecognized noise type [salt]" in caplog.text


@pytest.mark.parametrize("name, value", [("stddev", -0.1), ("stddev", math.nan), ("mean", math.inf),
                                         ("precision", -1.0), ("bias_stddev", -1.0), ("bias_mean", math.nan)])
def test_bad_numbers_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        make(**{name: value})
