# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles with heights in a costmap: what rays leave, what is forgotten, what is told."""
import math

import numpy as np
import pytest

from layer_scene import MIDDLE, costmap, laser, layer, see
from m2wr_navigation import registry
from m2wr_navigation.costmap.voxel_kernels import UNKNOWN_COLUMN
from m2wr_navigation.parameters import read

TABLE = [[4.05, 3.05, height] for height in (0.5, 0.7, 0.9)]


def voxels(**given):
    made = layer("VoxelLayer", **given)
    made.sources["laser"] = laser()
    return made


def shown(whole, stamp=0.0, pose=MIDDLE):
    whole.update(pose, stamp)
    return whole.snapshot()


@pytest.mark.parametrize("kind, cost", [("VoxelLayer", 254), ("ObstacleLayer", 0)])
def test_only_the_voxel_layer_keeps_a_table_over_a_scan(kind, cost):
    made = layer(kind)
    made.sources.update(laser=laser(), camera=laser(clearing=False))
    whole = costmap(made)
    see(made.sources["camera"], 0.0, [[4.05, 3.05, 0.7]])
    assert shown(whole).cost_at(4.05, 3.05) == 254
    made.sources["camera"].clear()
    see(made.sources["laser"], 1.0, [[5.05, 3.05, 0.3]])
    assert shown(whole, 1.0).cost_at(4.05, 3.05) == cost


@pytest.mark.parametrize("marks, cost", [(1, 0), (2, 0), (3, 254)])
def test_free_space_under_two_marks_is_free_by_the_threshold(marks, cost):
    made = voxels(mark_threshold=2)
    see(made.sources["laser"], 0.0, [[5.05, 3.05, 0.3], *TABLE[:marks]])
    assert shown(costmap(made)).cost_at(4.05, 3.05) == cost


def test_a_column_forgets_its_marks_with_the_footprint():
    made = voxels(mark_threshold=1)
    whole = costmap(made)
    see(made.sources["laser"], 0.0, TABLE[:2])
    assert shown(whole).cost_at(4.05, 3.05) == 254
    made.sources["laser"].clear()
    assert shown(whole, 1.0, np.array([4.0, 3.0, 0.0])).cost_at(4.05, 3.05) == 0
    see(made.sources["laser"], 2.0, TABLE[2:])
    assert shown(whole, 2.0).cost_at(4.05, 3.05) == 0, "marks from before count"
    kept = voxels(mark_threshold=1, footprint_clearing_enabled=False)
    see(kept.sources["laser"], 0.0, TABLE[:2])
    assert shown(costmap(kept), 0.0, np.array([4.0, 3.0, 0.0])).cost_at(4.05, 3.05) == 254


@pytest.mark.parametrize("forget", ["reset", "clear_area"])
def test_a_column_forgets_its_marks_when_cleared(forget):
    made = voxels(mark_threshold=1)
    whole = costmap(made)
    see(made.sources["laser"], 0.0, TABLE[:2])
    whole.update(MIDDLE, 0.0)
    if forget == "reset":
        whole.reset()
    else:
        assert whole.clear_area([made.name], MIDDLE, 4.0, True) == 1
    see(made.sources["laser"], 1.0, TABLE[2:])
    assert shown(whole, 1.0).cost_at(4.05, 3.05) == 0


def test_columns_stay_in_place_in_a_rolling_costmap():
    made = voxels(mark_threshold=1)
    whole = costmap(made, size=(4.0, 4.0), rolling=True)
    see(made.sources["laser"], 0.0, TABLE[:1])
    whole.update(MIDDLE, 0.0)
    see(made.sources["laser"], 1.0, TABLE[1:2])
    assert shown(whole, 1.0, MIDDLE + [-0.4, 0.3, 0.0]).cost_at(4.05, 3.05) == 254
    row, column = whole.master.cell(4.05, 3.05)
    assert made.columns[row, column] >> 16 == 0b1100 and (made.columns >> 16 > 0).sum() == 1
    whole.update(MIDDLE + [50.0, 0.0, 0.0], 2.0)
    made.sources["laser"].clear()
    whole.update(MIDDLE, 3.0)
    assert (made.columns >> 16 > 0).sum() == 0


def test_unknown_cells_stay_unknown_below_the_threshold():
    made = voxels(track_unknown_space=True, unknown_threshold=8)
    whole = costmap(made, track_unknown=True)
    for height, cost in ((0.3, 255), (0.5, 0)):
        see(made.sources["laser"], height, [], (3.0, 3.0, height), [[5.05, 3.05, height]])
        assert shown(whole, height).cost_at(4.05, 3.05) == cost


@pytest.mark.parametrize("method, over_free, over_map", [(0, 0, 0), (1, 0, 254), (99, 0, 254)])
def test_columns_are_combined_with_the_map_by_the_method(method, over_free, over_map):
    static, made = layer("StaticLayer"), voxels(combination_method=method)
    whole = costmap(static, made)
    occupancy = np.zeros((60, 60), np.int8)
    occupancy[30, 42] = 100
    static.set_map(occupancy, 0.1, np.zeros(3), "odom")
    whole.update(MIDDLE, 0.0)
    see(made.sources["laser"], 1.0, [[4.55, 3.05, 0.3]])
    seen = shown(whole, 1.0)
    assert (seen.cost_at(4.05, 3.05), seen.cost_at(4.25, 3.05)) == (over_free, over_map)
    assert seen.cost_at(4.55, 3.05) == (0 if method == 99 else 254)


def test_an_observation_counts_for_its_persistence():
    made = voxels()
    made.sources["laser"] = laser(observation_persistence=1.0)
    whole = costmap(made)
    see(made.sources["laser"], 0.0, [[4.05, 3.05, 0.3]])
    see(made.sources["laser"], 0.5, [[5.05, 3.05, 0.3]])
    assert shown(whole, 0.9).cost_at(4.05, 3.05) == 254, "marks follow all rays"
    see(made.sources["laser"], 1.4, [[5.05, 3.05, 0.3]])
    assert shown(whole, 1.4).cost_at(4.05, 3.05) == 0


def test_a_sensor_above_the_grid_clears_and_is_told_once():
    made = voxels()
    whole = costmap(made)
    see(made.sources["laser"], 0.0, TABLE)
    assert shown(whole).cost_at(4.05, 3.05) == 254 and whole.take_remarks() == []
    for stamp in (1.0, 2.0):
        see(made.sources["laser"], stamp, [[4.05, 3.05, -0.1]], (4.05, 3.05, 2.5))
        assert shown(whole, stamp).cost_at(4.05, 3.05) == 0
    told, = whole.take_remarks()
    assert told.startswith("VoxelLayer: the sensor of source laser is at (4.05, 3.05, 2.50) m, outside of the voxels "
                           "from (0.00, 0.00, 0.00) to (6.00, 6.00, 2.00) m")
    see(made.sources["laser"], 3.0, [[4.35, 3.05, 0.3]], (-2.0, 3.05, 0.5))
    made.sources["right"] = laser("right")
    see(made.sources["right"], 3.0, [[4.35, 3.05, 0.3]], (8.0, 3.05, 0.5))
    whole.update(MIDDLE, 3.0)
    assert len(whole.take_remarks()) == 1, "the source right only"


def test_the_ends_of_rays_are_kept_for_one_update():
    made = voxels()
    whole = costmap(made)
    see(made.sources["laser"], 7.0, [[4.05, 3.0, 0.3], [math.nan] * 3], free=[[3.0, 3.0, 9.0]])
    whole.update(MIDDLE, 7.5)
    (stamp, ends), = made.ray_ends
    assert stamp == 7.0 and ends == pytest.approx(np.array([[3.85, 3.0, 0.3], [3.0, 3.0, 2.0]]), abs=1e-6)
    made.sources["laser"].clear()
    whole.update(MIDDLE, 8.0)
    assert made.ray_ends == []


def test_points_that_are_not_finite_change_nothing():
    made = voxels()
    whole = costmap(made)
    bad = [[value if place == axis else 0.5 for place in range(3)]
           for value in (math.nan, math.inf, -math.inf) for axis in range(3)]
    see(made.sources["laser"], 0.0, bad, free=bad)
    assert not shown(whole).costs.any()
    assert (made.columns != UNKNOWN_COLUMN).sum() == 16, "more than what the footprint covers"


def test_other_thresholds_count_at_once_other_heights_forget():
    made = voxels()
    whole = costmap(made)
    see(made.sources["laser"], 0.0, [[4.55, 3.05, 0.3], *TABLE[:2]])
    whole.update(MIDDLE, 0.0)
    made.sources["laser"].clear()
    for threshold, cost in ((2, 0), (1, 254)):
        made.configure(dict(made.values, mark_threshold=threshold))
        whole.refresh()
        assert shown(whole, 1.0).cost_at(4.05, 3.05) == cost
    for name, value in (("origin_z", 0.1), ("z_resolution", 0.1), ("z_voxels", 9)):
        see(made.sources["laser"], 2.0, TABLE[:2])
        whole.update(MIDDLE, 2.0)
        made.sources["laser"].clear()
        assert (made.columns >> 16 > 0).any()
        made.configure(dict(made.values, **{name: value}))
        whole.refresh()
        assert shown(whole, 3.0).cost_at(4.05, 3.05) == 0 and (made.columns == UNKNOWN_COLUMN).sum() == 3600 - 16


def test_points_that_no_voxel_can_hold_are_told():
    assert voxels().remarks == [] and voxels(max_obstacle_height=0.4, z_voxels=2).remarks == []
    made = voxels(max_obstacle_height=0.6, z_voxels=2)
    assert made.remarks == ["max_obstacle_height is 0.6 m, and 2 voxels of 0.2 m from 0 m reach 0.4 m; expected at "
                            "least as much; higher points mark nothing"]
    made.configure(dict(made.values, mark_threshold=1))
    assert len(made.remarks) == 1
    made.configure(dict(made.values, z_resolution=0.25))
    assert "reach 0.5 m" in made.remarks[1]


@pytest.mark.parametrize("name, given, used, expected", [
    ("z_voxels", 17, 16, "a whole number from 1 to 16"), ("z_voxels", 0, 10, "a whole number from 1 to 16"),
    ("z_voxels", "ten", 10, "a whole number from 1 to 16"), ("z_resolution", 0.0, 0.2, "a number from 0.01 to 50 m"),
    ("z_resolution", -0.1, 0.2, "a number from 0.01 to 50 m"), ("z_resolution", math.nan, 0.2, "a number from"),
    ("mark_threshold", -1, 0, "a whole number from 0 to 16"), ("origin_z", "low", 0.0, "a number from -50 to 50 m")])
def test_a_value_that_makes_no_grid_is_told_and_replaced(name, given, used, expected):
    table = registry.find(registry.LAYERS, "costmap_2d::VoxelLayer").PARAMETERS
    values, (told,) = read(table, {name: given}, "~map/voxels")
    assert values[name] == used
    assert told.startswith("parameter ~map/voxels/{} is {!r}; expected {}".format(name, given, expected))
    assert told.endswith("; {!r} is used".format(used))
