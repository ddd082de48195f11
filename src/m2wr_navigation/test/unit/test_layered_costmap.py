# SPDX-License-Identifier: BSD-3-Clause
"""Layers together: static map, obstacles, inflation; fixed and rolling; changes and snapshots."""
import math

import numpy as np
import pytest

from layer_scene import CORNERS, MIDDLE, RESOLUTION, costmap, laser, layer, see
from m2wr_navigation.costmap.footprint import circle
from m2wr_navigation.costmap.layer import Window
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.static_layer import MapError


@pytest.fixture(params=["ObstacleLayer", "VoxelLayer"])
def obstacles(request):
    made = layer(request.param)
    made.sources["laser"] = laser()
    return made


def test_a_mark_is_inflated_and_stays_until_a_ray_clears_it(obstacles):
    whole = costmap(obstacles, layer("InflationLayer"))
    see(obstacles.sources["laser"], 0.0, [[5.0, 3.05, 0.3]])
    whole.update(MIDDLE, 0.0)
    seen = whole.snapshot()
    assert seen.cost_at(5.05, 3.05) == 254 and seen.cost_at(4.85, 3.05) == 253 and seen.cost_at(4.65, 3.05) == 34
    see(obstacles.sources["laser"], 1.0, [])
    whole.update(MIDDLE, 1.0)
    assert whole.snapshot().cost_at(5.05, 3.05) == 254
    see(obstacles.sources["laser"], 2.0, [], free=[[5.9, 3.05, 0.3]])
    whole.update(MIDDLE, 2.0)
    assert not whole.snapshot().costs.any()


def test_rays_of_one_update_do_not_clear_its_marks(obstacles):
    whole = costmap(obstacles)
    see(obstacles.sources["laser"], 0.0, [[4.05, 3.05, 0.3], [5.05, 3.05, 0.3]])
    whole.update(MIDDLE, 0.0)
    assert whole.snapshot().cost_at(4.05, 3.05) == 254 and whole.snapshot().cost_at(5.05, 3.05) == 254


def test_the_cells_below_the_robot_are_free_of_marks(obstacles):
    whole = costmap(obstacles)
    see(obstacles.sources["laser"], 0.0, [[3.1, 3.1, 0.3]], sensor=(2.0, 3.0, 0.3))
    whole.update(MIDDLE, 0.0)
    assert not whole.snapshot().costs.any()


def test_changed_windows_give_what_a_whole_update_gives(obstacles):
    rng = np.random.default_rng(5)
    parts = costmap(obstacles, layer("InflationLayer", inflation_radius=0.7))
    for stamp in range(25):
        angles, reach = rng.uniform(0, 2 * math.pi, 6), rng.uniform(0.5, 2.5, 6)
        points = np.stack([3.0 + reach * np.cos(angles), 3.0 + reach * np.sin(angles), np.full(6, 0.3)], -1)
        see(obstacles.sources["laser"], float(stamp), points)
        window = parts.update(MIDDLE, float(stamp))
        part = parts.snapshot().costs
        assert window != Window.whole(parts.master) or stamp == 0 or window.bottom - window.top > 40
        parts.refresh()
        parts.update(MIDDLE, float(stamp))
        assert (part == parts.snapshot().costs).all(), stamp


def test_a_static_map_sets_size_resolution_and_origin():
    static = layer("StaticLayer")
    whole = costmap(static)
    occupancy = np.zeros((30, 20), np.int8)
    occupancy[3, 4], occupancy[5, 6] = 100, -1
    static.set_map(occupancy, 0.2, np.array([-1.0, -2.0, 0.0]), "odom")
    whole.update(MIDDLE, 0.0)
    seen = whole.snapshot()
    assert seen.costs.shape == (30, 20) and seen.resolution == 0.2 and seen.origin.tolist() == [-1.0, -2.0]
    assert seen.costs[3, 4] == 254 and seen.costs[5, 6] == 255 and (seen.costs > 0).sum() == 2


def test_a_change_of_the_map_is_a_small_window(obstacles):
    static = layer("StaticLayer")
    whole = costmap(static)
    static.set_map(np.zeros((60, 60), np.int8), RESOLUTION, np.zeros(3), "odom")
    whole.update(MIDDLE, 0.0)
    static.update_map(np.full((2, 3), 100, np.int8), 10, 20)
    assert whole.update(MIDDLE, 1.0) == Window(10, 12, 20, 23)
    assert (whole.snapshot().costs == 254).sum() == 6


@pytest.mark.parametrize("row, column", [(-1, 0), (59, 0), (0, 58)])
def test_a_change_that_is_not_within_the_map_is_refused(row, column):
    static = layer("StaticLayer")
    with pytest.raises(MapError, match="before the map"):
        static.update_map(np.zeros((2, 3), np.int8), row, column)
    static.set_map(np.zeros((60, 60), np.int8), RESOLUTION, np.zeros(3), "odom")
    with pytest.raises(MapError, match="not within"):
        static.update_map(np.zeros((2, 3), np.int8), row, column)


@pytest.mark.parametrize("resolution, origin", [(0.0, (0, 0, 0)), (math.nan, (0, 0, 0)), (0.1, (math.inf, 0, 0))])
def test_a_map_without_place_or_resolution_is_refused(resolution, origin):
    with pytest.raises(MapError, match="expected finite"):
        layer("StaticLayer").set_map(np.zeros((2, 2), np.int8), resolution, np.array(origin, float), "map")


def test_a_map_with_a_yaw_is_placed_as_its_origin_says():
    static = layer("StaticLayer")
    occupancy = np.zeros((40, 60), np.int8)
    occupancy[20, 30] = 100
    origin = np.array([1.0, 2.0, math.pi / 6])
    static.set_map(occupancy, 0.1, origin, "odom")
    whole = costmap(static, size=(1.0, 1.0))
    whole.update(MIDDLE, 0.0)
    cosine, sine = math.cos(origin[2]), math.sin(origin[2])
    x, y = 1.0 + cosine * 3.05 - sine * 2.05, 2.0 + sine * 3.05 + cosine * 2.05
    seen = whole.snapshot()
    assert seen.cost_at(x, y) == 254 and (seen.costs == 254).sum() <= 4
    assert seen.costs[0, 0] == 255, "a corner that the map does not cover is known"


def test_a_rolling_costmap_shows_the_map_through_the_transform():
    static = layer("StaticLayer")
    whole = costmap(static, size=(2.0, 2.0), rolling=True)
    occupancy = np.zeros((100, 100), np.int8)
    occupancy[50, 60] = 100                     # at (6.05, 5.05) of the map
    static.set_map(occupancy, 0.1, np.zeros(3), "map")
    static.map_from_costmap = np.array([5.0, 5.0, 0.0])
    whole.update(np.array([1.0, 0.0, 0.0]), 0.0)
    assert whole.snapshot().cost_at(1.05, 0.05) == 254 and (whole.snapshot().costs == 254).sum() == 1
    static.map_from_costmap = np.array([5.3, 5.0, 0.0])
    whole.update(np.array([1.0, 0.0, 0.0]), 1.0)
    assert whole.snapshot().cost_at(0.75, 0.05) == 254


def test_a_rolling_costmap_keeps_its_content_in_place(obstacles):
    whole = costmap(obstacles, size=(4.0, 4.0), rolling=True)
    see(obstacles.sources["laser"], 0.0, [[3.95, 3.05, 0.3]])
    whole.update(MIDDLE, 0.0)
    obstacles.sources["laser"].clear()
    for step in range(1, 30):
        whole.update(np.array([3.0 + 0.033 * step, 3.0, 0.0]), float(step))
    seen = whole.snapshot()
    assert seen.cost_at(3.95, 3.05) == 254 or seen.cost_at(3.95, 3.05) == 0     # the robot has driven over it
    assert np.abs(seen.origin + 2.0 - np.array([3.957, 3.0])).max() <= 0.1
    whole.update(np.array([30.0, 3.0, 0.0]), 99.0)
    assert not whole.snapshot().costs.any()


def test_new_cells_of_a_rolling_costmap_are_unknown_if_tracked():
    made = layer("ObstacleLayer", track_unknown_space=True)
    made.sources["laser"] = laser()
    whole = costmap(made, size=(4.0, 4.0), rolling=True, track_unknown=True)
    see(made.sources["laser"], 0.0, [], free=[[4.5, 3.05, 0.3]])
    whole.update(MIDDLE, 0.0)
    assert whole.snapshot().cost_at(4.05, 3.05) == 0 and whole.snapshot().cost_at(2.05, 4.55) == 255


def test_a_snapshot_does_not_change_afterwards(obstacles):
    whole = costmap(obstacles)
    whole.update(MIDDLE, 0.0)
    before = whole.snapshot()
    see(obstacles.sources["laser"], 1.0, [[5.0, 3.0, 0.3]])
    whole.update(MIDDLE, 1.0)
    assert not before.costs.any() and whole.snapshot().costs.any()


@pytest.mark.parametrize("inside, left", [(True, (4.55, 3.05)), (False, (3.55, 3.05))])
def test_obstacles_are_cleared_inside_or_outside_of_a_square(obstacles, inside, left):
    whole = costmap(obstacles)
    see(obstacles.sources["laser"], 0.0, [[3.55, 3.05, 0.3], [4.55, 3.05, 0.3]])
    whole.update(MIDDLE, 0.0)
    assert whole.clear_area([obstacles.name], MIDDLE, 2.0, inside) == 1
    whole.update(MIDDLE, 1.0)
    seen = whole.snapshot()
    assert seen.cost_at(*left) == 254 and (seen.costs == 254).sum() == 1
    assert whole.clear_area(["other"], MIDDLE, 9.0, True) == 0


def test_a_reset_forgets_obstacles_and_keeps_the_map(obstacles):
    static = layer("StaticLayer")
    whole = costmap(static, obstacles)
    occupancy = np.zeros((60, 60), np.int8)
    occupancy[3, 4] = 100
    static.set_map(occupancy, RESOLUTION, np.zeros(3), "odom")
    whole.update(MIDDLE, 0.0)
    see(obstacles.sources["laser"], 0.0, [[4.55, 3.05, 0.3]])
    whole.update(MIDDLE, 0.5)
    assert (whole.snapshot().costs == 254).sum() == 2
    whole.reset()
    whole.update(MIDDLE, 1.0)
    assert (whole.snapshot().costs == 254).sum() == 1


def test_a_disabled_layer_writes_nothing(obstacles):
    whole = costmap(obstacles)
    obstacles.configure(dict(obstacles.values, enabled=False))
    see(obstacles.sources["laser"], 0.0, [[4.55, 3.05, 0.3]])
    whole.update(MIDDLE, 0.0)
    assert not whole.snapshot().costs.any()


def test_layers_are_measured_by_the_clock_that_is_given():
    ticks = iter(range(100))
    made = LayeredCostmap("odom", (6.0, 6.0), RESOLUTION, (0.0, 0.0), False, False, lambda: float(next(ticks)))
    made.set_footprint(CORNERS)
    made.add(layer("costmap_2d::ObstacleLayer"))
    made.add(layer("costmap_2d::InflationLayer"))
    made.update(np.zeros(3), 1.0)
    assert set(made.spent) == {each.name for each in made.layers} and set(made.spent.values()) == {2.0}


#: A footprint, and half its width where plans have to keep it free [m].
@pytest.mark.parametrize("corners, half", [
    ([[-0.3, -0.2], [0.05, -0.2], [0.05, 0.2], [-0.3, 0.2]], 0.2), ([[-0.3, -0.2], [0.3, -0.2], [0.0, 0.25]], 0.25),
    ([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]], 0.0), (circle(0.3), 0.0)])
def test_plans_need_half_the_width_of_a_footprint_off_centre(corners, half):
    whole = costmap(layer("InflationLayer"))
    whole.set_footprint(np.array(corners))
    whole.update(MIDDLE, 0.0)
    assert whole.snapshot().beside == 0.0       # of a robot that drives sideways
    whole.drives_sideways = False
    assert whole.snapshot().beside == whole.snapshot().copy().beside == half


def test_the_least_clearance_is_in_snapshots():
    whole = costmap(layer("InflationLayer"))
    whole.least_clearance = 0.25
    assert whole.snapshot().least_clearance == whole.snapshot().copy().least_clearance == 0.25
