# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from motion_plan.regions import BUG2_BOUNDS, READING_LASER_BOUNDS, SECTOR_NAMES, RegionReader, ScanError

MIN, MAX = -1.570796, 1.570796


def layout(count, low=MIN, high=MAX):
    return low, high, (high - low) / (count - 1)


def read(ranges, bounds=BUG2_BOUNDS, low=MIN, high=MAX):
    return RegionReader(bounds).read(ranges, *layout(len(ranges), low, high))


@pytest.mark.parametrize('left_end, bounds', [(713, READING_LASER_BOUNDS), (719, BUG2_BOUNDS)])
def test_720_beams_give_the_printed_slices(left_end, bounds):
    rng = np.random.default_rng(1)
    for _ in range(50):
        ranges = list(rng.uniform(0.2, 14.0, 720))
        printed = [min(min(ranges[0:143]), 10), min(min(ranges[144:287]), 10), min(min(ranges[288:431]), 10),
                   min(min(ranges[432:575]), 10), min(min(ranges[576:left_end]), 10)]
        assert [read(ranges, bounds)[name] for name in SECTOR_NAMES] == printed


@pytest.mark.parametrize('beam', [143, 287, 431, 575, 719])
def test_beams_between_the_slices_are_ignored(beam):
    ranges = [5.0] * 720
    ranges[beam] = 1.0
    assert set(read(ranges).values()) == {5.0}


def test_messages_32_bit_angles_still_give_the_printed_slices():
    ranges = np.full(720, 5.0)
    ranges[[143, 287, 431, 575, 719]] = 1.0
    low, high, step = (float(np.float32(value)) for value in layout(720))
    assert set(RegionReader().read(ranges, low, high, step).values()) == {5.0}


@pytest.mark.parametrize('count', [5, 37, 181, 360, 1440])
def test_other_beam_counts_use_the_same_angles(count):
    low, high, step = layout(count)
    edge = math.degrees(1e-3)    # the tolerance for 32-bit angles
    sectors = {name: (-90 + first * 180 / 719, -90 + (end - 1) * 180 / 719)
               for name, (first, end) in zip(SECTOR_NAMES, BUG2_BOUNDS)}
    assert sectors['front'] == pytest.approx((-17.90, 17.65), abs=0.01)
    for beam in range(count):
        ranges = [8.0] * count
        ranges[beam] = 2.0
        angle = math.degrees(low + beam * step)
        inside = [name for name, (first, last) in sectors.items() if first - edge < angle < last + edge]
        assert [name for name, value in read(ranges).items() if value == 2.0] == inside


def test_full_circle_scan_from_zero_is_cut_to_the_front():
    ranges = [9.0] * 360
    ranges[270], ranges[90], ranges[0], ranges[180] = 1.0, 2.0, 3.0, 0.5    # right, left, ahead, behind
    ranges[89] = 2.5
    regions = RegionReader().read(ranges, 0.0, math.radians(359), math.radians(1))
    assert (regions['right'], regions['left'], regions['front']) == (1.0, 2.5, 3.0)
    assert 0.5 not in regions.values()


def test_infinite_readings():
    ranges = [math.inf] * 720
    ranges[10] = -math.inf
    ranges[700] = -0.5
    regions = read(ranges)
    assert regions['right'] == 0.0 and regions['left'] == 0.0
    assert regions['front'] == 10.0


def test_nan_readings_are_left_out():
    ranges = [math.nan, 3.0] * 360
    assert set(read(ranges).values()) == {3.0}


@pytest.mark.parametrize('ranges, text', [
    ([], '0 readings'), ([1.0], '1 reading'), ([math.nan] * 720, 'NaN')])
def test_useless_scans_are_named(ranges, text):
    with pytest.raises(ScanError, match=text):
        RegionReader().read(ranges, MIN, MAX, (MAX - MIN) / 719)


def test_wrong_number_of_readings_is_named_with_the_expected_one():
    with pytest.raises(ScanError, match='600 readings, expected 720'):
        RegionReader().read([1.0] * 600, MIN, MAX, (MAX - MIN) / 719)


def test_zero_increment_is_refused():
    with pytest.raises(ScanError, match='increment'):
        RegionReader().read([1.0] * 720, 0.0, 0.0, 0.0)


def test_nan_only_sector_is_refused():
    ranges = [1.0] * 720
    ranges[288:431] = [math.nan] * 143
    with pytest.raises(ScanError, match='front'):
        read(ranges)


def test_a_sector_outside_the_scan_is_reported_once_and_free():
    reader = RegionReader()
    args = layout(180, -0.6, 0.6)
    regions = reader.read([1.0] * 180, *args)
    assert regions['right'] == regions['left'] == 10.0 and regions['front'] == 1.0
    notices = reader.take_notices()
    assert len(notices) == 1 and 'right, left' in notices[0] and '-34.4 to 34.4' in notices[0]
    reader.read([1.0] * 180, *args)
    assert reader.take_notices() == []
