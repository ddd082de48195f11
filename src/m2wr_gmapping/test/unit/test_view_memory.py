# SPDX-License-Identifier: BSD-3-Clause
"""Motion that the wheels do not tell of is seen in the scan."""
import math

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.frontend.scan_kernels import changed_sectors, profile
from m2wr_gmapping.frontend.view_memory import SECTORS, ViewMemory

LASER = LaserModel.from_message(-math.pi, math.pi, math.pi / 180, 361, 0.05, 20.0, max_urange=10.0)


def room(pose, noise=0.0, seed=1):
    """Reading in a room of 8 m by 7 m."""
    c, s = np.cos(pose[2] + LASER.angles), np.sin(pose[2] + LASER.angles)
    with np.errstate(divide="ignore"):
        ranges = np.minimum.reduce([np.where(part * (end - at) > 0.0, (end - at) / part, np.inf) for part, at, ends in (
            (c, pose[0], (-3.0, 5.0)), (s, pose[1], (-3.0, 4.0))) for end in ends])
    return LASER.reading(ranges + np.random.default_rng(seed).normal(0.0, noise, len(ranges)))


def changed(now, before=(0.0, 0.0, 0.0)):
    memory = ViewMemory()
    memory.remember(room(before, 0.02))
    return memory.has_changed(now)


def test_noise_is_no_motion():
    assert not any(changed(room((0.0, 0.0, 0.0), 0.05, seed)) for seed in range(2, 20))


@pytest.mark.parametrize("degrees", [20, 45, 90, 135, 180, -100])
def test_rotation_is_noticed(degrees):
    assert changed(room((0.0, 0.0, math.radians(degrees)), 0.02, 2))


def test_carried_robot_is_noticed():
    assert changed(room((1.0, 0.5, 0.0), 0.02, 2))


@pytest.mark.parametrize("share, noticed", [(0.5, False), (1.5, True)])
def test_people_nearby_are_no_motion(share, noticed):
    reading = room((0.0, 0.0, 0.0))
    near = np.arange(reading.rays.shape[1]) < share * tuning.TRACKING.affected_share * reading.rays.shape[1]
    reading.rays[:, near] *= 0.5
    assert changed(reading) == noticed


def test_scan_without_beams_is_no_motion():
    memory = ViewMemory()
    empty = LASER.reading(np.full(len(LASER.angles), np.nan))
    memory.remember(empty)
    assert not memory.has_changed(empty)


def test_profile_is_the_mean_range_of_each_sector():
    rng, out = np.random.default_rng(5), np.empty(SECTORS)
    rays = rng.normal(size=(2, 50)).astype(np.float32)
    profile(rays, out)
    sectors = ((np.arctan2(rays[1], rays[0]) + math.pi) / (2.0 * math.pi) * SECTORS).astype(int) % SECTORS
    wanted = [np.hypot(*rays[:, sectors == k]).mean() if (sectors == k).any() else 0.0 for k in range(SECTORS)]
    assert out == pytest.approx(np.array(wanted), rel=1e-5)


def test_changed_sectors_are_counted():
    before, now = np.array([0.0, 0.0, 2.0, 2.0, 2.0]), np.array([0.0, 0.1, 2.2, 2.4, 0.0])
    assert changed_sectors(before, now, 0.3) == (2, 4)
    assert changed_sectors(before, before, 0.3) == (0, 3)
