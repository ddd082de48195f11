# SPDX-License-Identifier: BSD-3-Clause
"""Reliefs have the height they are given, and a level place for the start."""
import numpy as np
import pytest

from m2wr_campaign.terrain.measures import measures_of
from m2wr_campaign.terrain.relief import RELIEFS, START_RADIUS, Grid, heights_of

GRID = Grid(129, 12.0)


@pytest.mark.parametrize("name", sorted(RELIEFS))
@pytest.mark.parametrize("seed", range(3))
def test_a_relief_grows_and_is_level_at_the_start(name, seed):
    low, high = (heights_of(GRID, {name: height}, seed) for height in (0.05, 0.1))
    x, y = GRID.places
    assert np.all(high[np.hypot(x, y) < START_RADIUS] == 0.0)
    if name != "rubble":            # stones grow in all directions
        assert np.allclose(high, 2.0 * low)
    assert np.all(np.isfinite(high)) and 0.02 < np.ptp(high) < 1.0
    assert np.all(heights_of(GRID, {name: 0.0}, seed) == 0.0)


def test_reliefs_add_up_and_do_not_change_each_other():
    one, two = (heights_of(GRID, {name: 0.1}, 7) for name in ("fractal", "steps"))
    assert np.allclose(heights_of(GRID, {"fractal": 0.1, "steps": 0.1}, 7), one + two)


def test_fractal_ground_has_its_rms_height_and_spectrum():
    grid = Grid(513, 50.0)
    exponents = []
    for seed in range(4):
        ground = RELIEFS["fractal"](np.random.default_rng(seed), grid, 0.2)
        assert ground.std() == pytest.approx(0.2)
        power = np.mean(np.abs(np.fft.rfft(ground * np.hanning(513)[None, :], axis=1)) ** 2, axis=0)
        frequency = np.fft.rfftfreq(513, grid.cell)
        part = (frequency > 0.5) & (frequency < 3.0)
        exponents.append(np.polyfit(np.log(frequency[part]), np.log(power[part]), 1)[0])
    assert np.mean(exponents) == pytest.approx(-2.2, abs=0.15)


def test_measures_of_a_plane_and_of_a_step():
    x, y = GRID.places
    plane = measures_of(0.5 * x, GRID.cell)
    assert plane["rms_height"] < 1e-9 and plane["slope_median"] == pytest.approx(np.degrees(np.arctan(0.5)))
    step = measures_of(np.where(x > 0.0, 0.1, 0.0), GRID.cell)
    assert step["step_max"] == pytest.approx(0.1) and step["slope_median"] == 0.0
    assert step["slope_max"] == pytest.approx(np.degrees(np.arctan(0.1 / GRID.cell)))
