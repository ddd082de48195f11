# SPDX-License-Identifier: BSD-3-Clause
"""Points of scans and clouds; what is malformed is refused with the reason."""
import math
import struct

import numpy as np
import pytest

from m2wr_navigation.costmap.observation import (
    MOST_POINTS,
    SOURCE_PARAMETERS,
    Observation,
    ObservationError,
    Source,
    cloud_points,
    listed_points,
    scan_points,
    transformed,
)
from m2wr_navigation.parameters import read


def values(**given):
    return read(SOURCE_PARAMETERS, dict({"clearing": True}, **given), "~source")[0]


def points_of(ranges, **given):
    return scan_points(ranges, 0.0, 0.5 * math.pi, (0.1, 5.0), values(**given))


def test_beams_within_the_limits_become_points():
    points, free = points_of([1.0, 2.0, 0.05, 4.9])
    assert points == pytest.approx(np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, -4.9, 0.0]]), abs=1e-9)
    assert len(free) == 0


@pytest.mark.parametrize("distance", [math.inf, 5.0, 6.0])
def test_a_beam_without_return_ends_at_the_raytrace_range(distance):
    points, free = points_of([distance], raytrace_range=3.0)
    assert len(points) == 0 and free == pytest.approx(np.array([[3.0, 0.0, 0.0]]))
    assert len(points_of([distance], clear_no_return=False)[1]) == 0


def test_with_inf_is_valid_an_infinite_beam_is_a_point():
    points, free = points_of([math.inf], inf_is_valid=True)
    assert points == pytest.approx(np.array([[4.9999, 0.0, 0.0]])) and len(free) == 0


@pytest.mark.parametrize("distance", [math.nan, -math.inf, 0.0, -1.0])
def test_other_beams_are_neither(distance):
    points, free = points_of([distance])
    assert len(points) == 0 and len(free) == 0


def test_an_empty_scan_has_no_points():
    assert [len(part) for part in points_of([])] == [0, 0]


@pytest.mark.parametrize("change", [
    dict(ranges=[1.0] * 1000001), dict(angle_min=math.nan), dict(increment=math.inf), dict(limits=(0.1, math.nan)),
    dict(limits=(0.1, -1.0))])
def test_a_scan_without_usable_geometry_is_refused(change):
    arguments = dict(ranges=[1.0], angle_min=0.0, increment=0.1, limits=(0.1, 5.0), values=values())
    arguments.update(change)
    with pytest.raises(ObservationError, match="expected"):
        scan_points(**arguments)


@pytest.mark.parametrize("big_endian", [False, True])
def test_points_of_a_cloud_are_read_and_those_not_finite_dropped(big_endian):
    form = (">" if big_endian else "<") + "ffff"
    data = struct.pack(form, 9, 1, 2, 3) + struct.pack(form, 9, math.nan, 0, 0) + struct.pack(form, 9, 4, 5, 6)
    assert cloud_points(data, (1, 3), (48, 16), (4, 8, 12), big_endian).tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("shape, steps, offsets, size", [
    ((1, 3), (48, 16), (0, 4, 8), 47), ((1, 3), (48, 8), (0, 4, 8), 48), ((2, 3), (10, 16), (0, 4, 8), 96),
    ((1, 3), (48, 16), (0, 4, -4), 48), ((60000, 60000), (960000, 16), (0, 4, 8), 48)])
def test_a_cloud_whose_sizes_do_not_fit_is_refused(shape, steps, offsets, size):
    with pytest.raises(ObservationError):
        cloud_points(bytes(size), shape, steps, offsets, False)


def test_points_are_rotated_and_moved():
    half = math.sqrt(0.5)
    moved = transformed(np.array([[1.0, 0.0, 0.0]]), (1.0, 2.0, 3.0), (0.0, 0.0, half, half))
    assert moved[0] == pytest.approx([1.0, 3.0, 3.0])


def observation(stamp):
    return Observation(stamp, np.zeros(3), np.zeros((0, 3)), np.zeros((0, 3)))


def test_without_persistence_only_the_newest_counts():
    source = Source("laser", values())
    source.add(observation(1.0), 1.0)
    source.add(observation(2.0), 2.0)
    assert [seen.stamp for seen in source.current(100.0)] == [2.0]


def test_with_persistence_observations_count_for_that_time():
    source = Source("laser", values(observation_persistence=1.5))
    for stamp in (1.0, 2.0, 3.0):
        source.add(observation(stamp), stamp)
    assert [seen.stamp for seen in source.current(3.0)] == [2.0, 3.0]
    assert source.current(9.0) == []


def test_a_source_is_late_after_its_expected_period():
    source = Source("laser", values(expected_update_rate=0.5))
    assert source.silence(1.0) == math.inf
    source.add(observation(1.0), 1.0)
    assert source.silence(1.4) == 0.0 and source.silence(1.6) == pytest.approx(0.6)
    assert Source("laser", values()).silence(1e9) == 0.0


def test_messages_that_cannot_be_used_are_a_fault():
    source = Source("laser", values())
    source.add(observation(-0.05), -0.05)
    for k in range(20):
        source.refuse(0.05 * k, "there is no transform")
        assert bool(source.fault(0.05 * k)) == (0.05 * k > 0.5)
    assert source.fault(1.0) == ("no message on topic laser of source laser could be used for 1.0 s: "
                                 "there is no transform")
    source.add(observation(1.0), 1.0)
    assert source.fault(1.1) == ""


def test_a_sensor_that_never_sent_is_a_fault():
    source = Source("laser", values(topic="scan"))
    assert "topic scan of source laser has sent nothing yet" in source.fault(0.0)
    source.refuse(1.0, "there is no transform")
    assert "nothing that could be used" in source.fault(1.1) and "there is no transform" in source.fault(2.0)
    source.add(observation(2.0), 2.0)
    assert source.fault(2.1) == ""


def test_a_source_that_only_marks_tells_events_and_may_be_silent():
    bumper = Source("bump", values(clearing=False, topic="bumper_pointcloud"))
    assert bumper.fault(1.0) == ""
    for k in range(20):
        bumper.add(observation(0.02 * k), 0.02 * k)
    assert bumper.fault(60.0) == "" and bumper.silence(60.0) == 0.0
    bumper.refuse(61.0, "there is no transform")
    assert "there is no transform" in bumper.fault(62.0)
    timed = Source("bump", values(clearing=False, expected_update_rate=0.5))
    assert "has sent nothing yet" in timed.fault(1.0)
    assert "has sent nothing yet" in Source("laser", values(clearing=False, data_type="LaserScan")).fault(1.0)


@pytest.mark.parametrize("kind, count, limit", [
    ("LaserScan", 1, 3.0), ("LaserScan", 2, 3.0), ("PointCloud2", 1, math.inf), ("PointCloud2", 3, 3.0)])
def test_a_source_with_few_messages_is_late_after_three_seconds(kind, count, limit):
    source = Source("laser", values(data_type=kind))
    for k in range(count):
        source.add(observation(0.1 * k), 0.1 * k)
    last = 0.1 * (count - 1)
    assert source.fault(last + 2.9) == ""
    assert bool(source.fault(last + 3.1)) == math.isfinite(limit)


@pytest.mark.parametrize("count", [4, 20])
@pytest.mark.parametrize("period, limit", [(0.05, 0.4), (0.4, 0.8)])
def test_a_regular_source_that_stops_is_late_after_a_few_periods(period, limit, count):
    source = Source("laser", values())
    for k in range(count):
        source.add(observation(k * period), k * period)
    last = (count - 1) * period
    assert source.silence(last + 0.99 * limit) == 0.0
    assert source.silence(last + 1.01 * limit) == pytest.approx(1.01 * limit)


def test_listed_points_are_kept_if_they_are_finite():
    assert listed_points([]).shape == (0, 3)
    assert listed_points([(1.0, 2.0, 0.5), (math.nan, 0.0, 0.0), (0.0, math.inf, 0.0)]).tolist() == [[1.0, 2.0, 0.5]]
    with pytest.raises(ObservationError, match="expected at most"):
        listed_points(range(MOST_POINTS + 1))
