# SPDX-License-Identifier: BSD-3-Clause
"""Depth images -> ranges: a wall in closed form, what is too near or far, rows, encodings, bad values."""
import math

import numpy as np
import pytest

from depth_scan.conversion import ConfigurationError, Projection, Settings, depths_of, read_settings

WIDTH, HEIGHT, FOCUS = 321, 241, 300.0
CAMERA = Projection(WIDTH, FOCUS, 160.0, 120.0)


def flat(depth=2.0):
    return np.full((HEIGHT, WIDTH), depth)


def test_a_wall_ahead_has_the_ranges_of_its_plane():
    ranges = CAMERA.ranges(flat(), Settings(scan_height=10))
    angles = CAMERA.angle_min + np.arange(WIDTH) * CAMERA.increment
    seen = np.isfinite(ranges)
    assert seen.mean() > 0.85           # columns are denser than beams at the edge, and sparser in the middle
    # the angle of a beam is that of a column up to one increment
    assert np.abs(ranges[seen] - 2.0 / np.cos(angles[seen])).max() < 2.0 * CAMERA.increment
    assert CAMERA.angle_max == pytest.approx(math.atan(160.0 / FOCUS)) and CAMERA.angle_min == -CAMERA.angle_max


def test_the_right_of_the_image_comes_first():
    depths = flat(4.0)
    depths[:, 300] = 1.0
    ranges = CAMERA.ranges(depths, Settings())
    place = int(np.nanargmin(ranges))
    assert CAMERA.angle_min + place * CAMERA.increment == pytest.approx(-math.atan(140.0 / FOCUS), abs=CAMERA.increment)


def test_the_nearest_of_the_rows_counts():
    depths = flat(4.0)
    depths[118, 160], depths[110, 160] = 1.5, 1.0
    middle = WIDTH // 2
    assert CAMERA.ranges(depths, Settings(scan_height=1))[middle] == pytest.approx(4.0)
    assert CAMERA.ranges(depths, Settings(scan_height=5))[middle] == pytest.approx(1.5)
    assert CAMERA.ranges(depths, Settings(scan_height=21))[middle] == pytest.approx(1.0)


@pytest.mark.parametrize("depth, range_", [(0.4, math.nan), (11.0, math.nan), (math.nan, math.nan),
                                           (math.inf, math.inf)])
def test_what_is_out_of_range_is_no_obstacle(depth, range_):
    found = CAMERA.ranges(flat(depth), Settings())[WIDTH // 2]
    assert math.isnan(found) if math.isnan(range_) else found == range_


@pytest.mark.parametrize("encoding, kind, unit", [("16UC1", "u2", 1000.0), ("32FC1", "f4", 1.0)])
@pytest.mark.parametrize("order", "<>")
def test_both_encodings_are_read(encoding, kind, unit, order):
    data = np.zeros((3, 5), order + kind)
    data[:, :4] = 2.5 * unit
    depths = depths_of(data.tobytes(), 4, 3, 5 * int(kind[1]), encoding, order == ">")
    assert depths.shape == (3, 4) and np.allclose(depths, 2.5)


def test_a_pixel_of_no_depth_is_nan():
    assert np.isnan(depths_of(bytes(16), 4, 2, 8, "16UC1", False)).all()


@pytest.mark.parametrize("arguments, part", [
    ((bytes(16), 4, 2, 8, "rgb8", False), "encoding is rgb8"), ((bytes(15), 4, 2, 8, "16UC1", False), "15 bytes"),
    ((bytes(16), 4, 2, 4, "16UC1", False), "4 bytes a row"), ((b"", 0, 0, 0, "16UC1", False), "0 x 0")])
def test_an_image_that_does_not_fit_is_refused(arguments, part):
    with pytest.raises(ConfigurationError, match=part):
        depths_of(*arguments)


@pytest.mark.parametrize("given, part", [
    ({"scan_height": 0}, "scan_height is 0"), ({"scan_height": 2.5}, "scan_height"), ({"range_min": "x"}, "range_min"),
    ({"range_max": math.nan}, "range_max"), ({"range_min": 3.0, "range_max": 2.0}, "smaller one first"),
    ({"output_frame_id": ""}, "output_frame_id"), ({"scan_time": -1.0}, "scan_time")])
def test_bad_parameters_are_named(given, part):
    with pytest.raises(ConfigurationError, match=part):
        read_settings(given)


def test_the_defaults_are_those_of_the_package():
    assert read_settings({}) == Settings(1, 0.033, 0.45, 10.0, "camera_depth_frame")


@pytest.mark.parametrize("depths, settings, part", [
    (flat()[:, :-1], Settings(), "320 columns"), (flat(), Settings(scan_height=300), "does not have"),
    (flat()[:50], Settings(), "does not have")])
def test_images_of_another_size_are_refused(depths, settings, part):
    with pytest.raises(ConfigurationError, match=part):
        CAMERA.ranges(depths, settings)


@pytest.mark.parametrize("values", [(0.0, 1.0, 1.0), (math.nan, 1.0, 1.0), (1.0, math.inf, 1.0)])
def test_a_camera_without_a_focal_length_is_refused(values):
    with pytest.raises(ConfigurationError, match="focal length"):
        Projection(10, *values)
