# SPDX-License-Identifier: BSD-3-Clause
"""Layers are combined by the rules of costmap_2d; maps are translated and resampled."""
import math

import numpy as np
import pytest

from m2wr_navigation.costmap.grid_kernels import cost_of_occupancy, forget, overwrite, raise_to, resample, translate


@pytest.mark.parametrize("old, layer, new", [
    (0, 254, 254), (254, 0, 254), (255, 0, 0), (255, 254, 254), (100, 255, 100), (255, 255, 255), (5, 5, 5)])
def test_raising_takes_the_greater_known_cost(old, layer, new):
    costs = np.full((2, 40), old, np.uint8)
    raise_to(costs, np.full((2, 40), layer, np.uint8), 0, 2, 1, 40)
    assert (costs[:, 1:] == new).all() and (costs[:, 0] == old).all()


@pytest.mark.parametrize("old, layer, new", [(254, 0, 0), (254, 255, 254), (255, 255, 255), (0, 254, 254)])
def test_overwriting_takes_every_known_cost(old, layer, new):
    costs = np.full((3, 3), old, np.uint8)
    overwrite(costs, np.full((3, 3), layer, np.uint8), 0, 3, 0, 3)
    assert (costs == new).all()


@pytest.mark.parametrize("track, trinary, costs", [
    (True, True, [255, 0, 0, 254]), (False, True, [0, 0, 0, 254]), (True, False, [255, 0, 127, 254])])
def test_occupancy_becomes_costs(track, trinary, costs):
    written = np.empty((1, 4), np.uint8)
    translate(np.array([[-1, 0, 50, 100]], np.int8), cost_of_occupancy(100, -1, track, trinary), written)
    assert written[0].tolist() == costs


def test_a_lower_threshold_makes_more_cells_lethal():
    written = np.empty((1, 3), np.uint8)
    translate(np.array([[64, 65, 100]], np.int8), cost_of_occupancy(65, -1, True, True), written)
    assert written[0].tolist() == [0, 254, 254]


def test_resampling_at_the_same_place_changes_nothing():
    source = np.random.default_rng(1).integers(0, 255, (7, 9)).astype(np.uint8)
    target = np.zeros_like(source)
    resample(source, 0.1, np.zeros(3), target, 0.1, np.zeros(2), 0, 7, 0, 9)
    assert (target == source).all()


def test_resampling_follows_a_quarter_turn():
    source = np.array([[1, 2, 3], [4, 5, 6]], np.uint8)
    target = np.zeros((3, 2), np.uint8)         # x of the target is -y of the source, y of the target its x
    resample(source, 1.0, np.array([0.0, 2.0, -0.5 * math.pi]), target, 1.0, np.zeros(2), 0, 3, 0, 2)
    assert target.tolist() == [[4, 1], [5, 2], [6, 3]]


def test_cells_outside_of_the_source_become_unknown():
    target = np.zeros((1, 4), np.uint8)
    resample(np.full((1, 2), 9, np.uint8), 1.0, np.array([-1.0, 0.0, 0.0]), target, 1.0, np.zeros(2), 0, 1, 0, 4)
    assert target.tolist() == [[255, 9, 9, 255]]


def test_forgetting_counts_the_lethal_cells_inside_or_outside():
    costs = np.full((4, 4), 254, np.uint8)
    assert forget(costs, 0, 1, 3, 1, 3, True) == 4 and costs.sum() == 12 * 254
    assert forget(costs, 0, 1, 3, 1, 3, False) == 12 and not costs.any()
