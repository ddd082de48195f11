# SPDX-License-Identifier: BSD-3-Clause
"""Where the points of bumpers and cliff sensors are."""
import math

import numpy as np
import pytest

from bumper_cloud.cloud import CENTRE, FAR, LEFT, RIGHT, ConfigurationError, Settings, points, read_settings


@pytest.mark.parametrize("bit, place, angle", [(LEFT, 0, math.radians(70)), (CENTRE, 1, 0.0),
                                               (RIGHT, 2, -math.radians(70))])
def test_an_active_sensor_has_a_point_at_the_radius(bit, place, angle):
    found = points(bit, Settings())
    assert found[place] == pytest.approx((0.25 * math.cos(angle), 0.25 * math.sin(angle), 0.04), abs=1e-6)
    others = np.delete(found, place, axis=0)
    assert np.hypot(others[:, 0], others[:, 1]) == pytest.approx([FAR, FAR], rel=1e-6)


def test_no_active_sensor_has_only_far_points():
    assert np.hypot(*points(0, Settings())[:, :2].T) == pytest.approx([FAR] * 3, rel=1e-6)


def test_parameters_are_read_with_defaults():
    assert read_settings({}) == Settings()
    assert read_settings({"pointcloud_radius": 1, "base_link_frame": "base"}) == Settings(1.0, base_link_frame="base")


@pytest.mark.parametrize("given", [{"pointcloud_radius": -1}, {"pointcloud_height": math.nan},
                                   {"side_point_angle": "a"}, {"base_link_frame": ""}, {"base_link_frame": 3}])
def test_other_parameters_are_refused(given):
    with pytest.raises(ConfigurationError, match=next(iter(given))):
        read_settings(given)
