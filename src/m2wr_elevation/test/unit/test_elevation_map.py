# SPDX-License-Identifier: BSD-3-Clause
"""Heights, their variance, and traversability, against ground with a closed form."""
import math

import numpy as np
import pytest

from m2wr_elevation.elevation_map import ElevationMap, MapSettings

SETTINGS = MapSettings(size=4.0, cell=0.1)
ABOVE = np.array((0.0, 0.0, 2.0))


def look(ground, elevation, noise=0.0, seed=0, limit=1.9):
    """Add a dense cloud of ground z(x, y), measured from above; return its points."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-limit, limit, (2, 20000))
    points = np.column_stack((x, y, ground(x, y) + noise * random.standard_normal(len(x)))) - ABOVE
    elevation.add(points, np.eye(3), ABOVE, ABOVE)
    return points


def made(ground):
    elevation = ElevationMap(SETTINGS)
    elevation.move(0.0, 0.0)
    look(ground, elevation)
    return elevation


@pytest.mark.parametrize("degrees", [0.0, 10.0, 20.0])
def test_a_ramp_has_its_slope(degrees):
    rise = math.tan(math.radians(degrees))
    layers = made(lambda x, y: rise * x + 0.0 * y).layers()
    middle = (slice(10, 30), slice(10, 30))
    assert np.median(np.degrees(layers["slope"][middle])) == pytest.approx(degrees, abs=0.7)
    assert np.nanmax(layers["roughness"][middle]) < 0.02
    wanted = 1.0 - max(math.radians(degrees) / SETTINGS.most_slope, 0.1 * rise / SETTINGS.most_step)
    assert np.median(layers["traversability"][middle]) == pytest.approx(wanted, abs=0.25)


def test_a_kerb_cannot_be_driven_over_but_its_sides_can():
    layers = made(lambda x, y: np.where(x > 0.0, 0.15, 0.0)).layers()
    good = layers["traversability"]
    assert np.all(good[15:25, 19:21] == 0.0)
    assert np.all(good[15:25, 5:15] > 0.9) and np.all(good[15:25, 25:35] > 0.9)
    assert np.nanmax(layers["step"][15:25, 18:22]) == pytest.approx(0.15, abs=0.01)


def test_noise_averages_out_and_the_variance_says_so():
    elevation = ElevationMap(SETTINGS)
    elevation.move(0.0, 0.0)
    for number in range(10):
        look(lambda x, y: 0.0 * x, elevation, 0.01, number)
    inside = (slice(3, 37), slice(3, 37))
    assert np.sqrt(np.mean(elevation.height[inside] ** 2)) < 0.003
    assert np.quantile(elevation.variance[inside], 0.99) < 1e-5


def test_what_leaves_the_map_is_forgotten_and_the_rest_stays():
    elevation = made(lambda x, y: 0.1 * x + 0.2 * y)
    before = elevation.height.copy()
    elevation.move(0.5, -0.3)
    assert elevation.corner == pytest.approx((-1.5, -2.3))
    np.testing.assert_array_equal(elevation.height[3:, :-5], before[:-3, 5:])
    assert np.all(np.isnan(elevation.height[:3])) and np.all(np.isnan(elevation.height[:, -5:]))
    elevation.move(100.0, 0.0)
    assert np.all(np.isnan(elevation.height))


def test_driving_makes_heights_less_certain():
    elevation = made(lambda x, y: 0.0 * x)
    before = np.nanmean(elevation.variance)
    elevation.move(0.04, 0.0)
    assert np.nanmean(elevation.variance) == pytest.approx(before + 0.04 * SETTINGS.drift)


def test_ground_that_is_lower_now_is_taken_after_some_clouds():
    elevation = made(lambda x, y: 0.3 + 0.0 * x)
    for number in range(3):
        look(lambda x, y: 0.0 * x, elevation, seed=number)
    assert np.nanmedian(elevation.height) == pytest.approx(0.3, abs=0.01)
    for number in range(4):
        look(lambda x, y: 0.0 * x, elevation, seed=number)
    assert np.nanmedian(elevation.height) == pytest.approx(0.0, abs=0.01)


def test_a_cloud_from_a_wrong_place_is_moved_onto_the_map():
    def ground(x, y):
        return 0.1 * np.sin(3.0 * x) + 0.1 * np.cos(2.5 * y)
    elevation = made(ground)
    points = look(ground, ElevationMap(SETTINGS), seed=5, limit=1.5)
    moved = elevation.offset(points, np.eye(3), ABOVE + (0.015, -0.01, 0.03))
    assert moved == pytest.approx((-0.015, 0.01, -0.03), abs=0.005)


def test_a_hole_stays_unknown_and_its_edge_can_be_told():
    elevation = ElevationMap(SETTINGS)
    elevation.move(0.0, 0.0)
    x, y = np.random.default_rng(0).uniform(-1.9, 1.9, (2, 20000))
    solid = np.hypot(x, y) > 0.6            # nothing comes back from a hole without a floor
    points = np.column_stack((x, y, np.zeros(len(x))))[solid] - ABOVE
    elevation.add(points, np.eye(3), ABOVE, ABOVE)
    layers = elevation.layers()
    for name in ("elevation", "traversability"):
        assert np.all(np.isnan(layers[name][17:23, 17:23]))
    assert np.all(layers["traversability"][3:8, 3:37] > 0.9)


def test_below_an_overhang_the_upper_side_counts():
    """One height a cell: a roof of 1 m above the ground blocks the way, though a robot would fit below it."""
    elevation = made(lambda x, y: 0.0 * x)
    look(lambda x, y: 1.0 + 0.0 * x, elevation, seed=1, limit=0.5)
    layers = elevation.layers()
    assert layers["elevation"][20, 20] == pytest.approx(1.0) and np.nanmin(layers["traversability"][20, 12:17]) == 0.0


@pytest.mark.parametrize("words, told", [
    ({"cell": 0.0}, "cell is 0.0"), ({"size": math.nan}, "size is nan"), ({"size": 1000.0}, "10 to 1000 cells"),
    ({"most_slope": -1.0}, "most_slope is -1")])
def test_settings_out_of_range_are_refused(words, told):
    with pytest.raises(ValueError, match=told):
        MapSettings(**words)


def test_numbers_that_are_not_finite_change_nothing():
    elevation = made(lambda x, y: 0.0 * x)
    before = elevation.height.copy()
    assert elevation.add(np.full((10, 3), math.nan), np.eye(3), ABOVE, ABOVE) == 0
    assert elevation.add(np.full((10, 3), math.inf), np.eye(3), ABOVE, ABOVE) == 0
    assert elevation.add(np.zeros((0, 3)), np.eye(3), ABOVE, ABOVE) == 0
    np.testing.assert_array_equal(elevation.height, before)
    for call in (lambda: elevation.move(math.nan, 0.0),
                 lambda: elevation.add(np.zeros((1, 3)), np.eye(3), np.full(3, math.inf), ABOVE)):
        with pytest.raises(ValueError, match="finite"):
            call()
