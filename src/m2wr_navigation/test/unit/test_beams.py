# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from m2wr_navigation.localization.beams import Beams, ScanError, ScanGeometry

GEOMETRY = ScanGeometry(-math.pi / 2, math.pi / 2, 0.1, 10.0)
LEVEL = ((0.5, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))


def test_ends_are_in_the_base_frame():
    beams = Beams.from_scan([1.0, 2.0, 3.0], GEOMETRY, LEVEL)
    np.testing.assert_allclose(beams.ends, [[0.5, 2.5, 0.5], [-1.0, 0.0, 3.0]], atol=1e-12)
    assert beams.hit.all()


def test_an_upside_down_laser_sees_left_and_right_exchanged():
    beams = Beams.from_scan([1.0, 2.0, 3.0], GEOMETRY, (LEVEL[0], (1.0, 0.0, 0.0, 0.0)))
    np.testing.assert_allclose(beams.ends, [[0.5, 2.5, 0.5], [1.0, 0.0, -3.0]], atol=1e-12)


def test_short_far_infinite_and_missing_ranges_are_no_hits():
    beams = Beams.from_scan([0.05, math.inf, math.nan, 10.0, 5.0], ScanGeometry(0.0, 0.1, 0.1, 10.0), LEVEL)
    assert beams.hit.tolist() == [False, False, False, True]
    np.testing.assert_allclose(beams.polar[1], [10.0, 10.0, 10.0, 5.0])
    assert np.isfinite(beams.ends).all()


@pytest.mark.parametrize("yaw", [0.0, 0.7, 3.0])
def test_beams_without_return_are_exactly_as_long_as_the_range(yaw):
    mount = (LEVEL[0], (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)))
    beams = Beams.from_scan([math.inf] * 360, ScanGeometry(0.0, 0.01745, 0.1, 3.5), mount)
    assert (beams.polar[1] == 3.5).all()


def test_own_limits_narrow_those_of_the_scan():
    beams = Beams.from_scan([0.4, 2.0, 5.0], GEOMETRY, LEVEL, least=0.5, most=4.0)
    assert beams.hit.tolist() == [False, True, False] and beams.reach == 4.0


@pytest.mark.parametrize("count, most, expected", [(10, 30, 10), (720, 30, 30), (100, 2, 2)])
def test_beams_are_spread_evenly_over_those_that_hit(count, most, expected):
    beams = Beams.from_scan([1.0] * count, ScanGeometry(0.0, 0.005, 0.1, 10.0), LEVEL)
    chosen = beams.spread(most)
    assert len(chosen) == expected and chosen[0] == 0 and chosen[-1] == count - 1
    assert np.ptp(np.diff(chosen)) <= 1


@pytest.mark.parametrize("ranges, geometry, mount, words", [
    ([], GEOMETRY, LEVEL, "no ranges"),
    ([1.0], ScanGeometry(math.nan, 0.1, 0.1, 10.0), LEVEL, "finite"),
    ([1.0], ScanGeometry(0.0, 0.1, 5.0, 1.0), LEVEL, "leave some range"),
    ([1.0], ScanGeometry(0.0, 0.1, 0.1, math.nan), LEVEL, "leave some range"),
    ([1.0], GEOMETRY, (LEVEL[0], (0.0, 0.0, 0.0, 0.0)), "a quaternion")])
def test_unusable_scans_are_refused_with_reason(ranges, geometry, mount, words):
    with pytest.raises(ScanError, match=words):
        Beams.from_scan(ranges, geometry, mount)
