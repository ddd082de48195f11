# SPDX-License-Identifier: BSD-3-Clause
"""A wrong mount in the model is told once, with the correction."""
import math

import pytest

from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.ros.mount_check import MountCheck


def calibration(yaw=0.0, x=0.0, y=0.0, yaw_deviation=0.05, deviation=0.004):
    """As of ``Mapper.calibration``, with the yaw in degrees."""
    found = {name + ending: 0.0 for name in tr.NAMES for ending in ("", "_deviation")}
    found.update(laser_yaw=math.radians(yaw), laser_yaw_deviation=math.radians(yaw_deviation), laser_x=x, laser_y=y,
                 laser_x_deviation=deviation, laser_y_deviation=deviation)
    return found


def test_wrong_yaw_is_told_once():
    check = MountCheck("base_link", "laser")
    told, = check.messages(calibration(yaw=-1.04, yaw_deviation=0.2))
    assert told == ("laser yaw is estimated 1.0 degree off the mount in the model: correct the transform "
                    "base_link -> laser by -1.0 degree (standard deviation 0.2)")
    assert not check.messages(calibration(yaw=-1.04)) and not check.messages(calibration(yaw=2.0))


@pytest.mark.parametrize("x, y, words", [(0.05, -0.01, "x +5.0 cm, y -1.0 cm"), (0.0, -0.03, "x +0.0 cm, y -3.0 cm")])
def test_wrong_position_is_told_once(x, y, words):
    check = MountCheck("base_link", "laser")
    told, = check.messages(calibration(x=x, y=y))
    assert "base_link -> laser" in told and words in told and "laser position" in told
    assert not check.messages(calibration(x=x, y=y))


def test_yaw_and_position_are_told_apart():
    check = MountCheck("base_link", "laser")
    assert len(check.messages(calibration(x=0.05))) == 1
    assert "yaw" in check.messages(calibration(yaw=1.0, x=0.05))[0]


@pytest.mark.parametrize("values", [
    dict(yaw=0.22), dict(yaw=0.8, yaw_deviation=0.27), dict(x=0.009, y=-0.009, deviation=0.001),
    dict(x=0.05, deviation=0.017), dict()])
def test_small_or_uncertain_differences_are_not_told(values):
    assert not MountCheck("base_link", "laser").messages(calibration(**values))


def test_mapper_without_calibration_tells_nothing():
    assert not MountCheck("base_link", "laser").messages({})
