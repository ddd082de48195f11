# SPDX-License-Identifier: BSD-3-Clause
import pytest

from localization_room import settings
from m2wr_navigation.localization.amcl_parameters import PARAMETERS, checked
from m2wr_navigation.parameters import read


def test_defaults_are_those_of_the_original():
    expected = dict(laser_max_beams=30, min_particles=100, max_particles=5000, kld_err=0.01, kld_z=0.99,
                    odom_alpha5=0.2, laser_z_hit=0.95, laser_sigma_hit=0.2, update_min_d=0.2, resample_interval=2,
                    transform_tolerance=0.1, recovery_alpha_slow=0.001, recovery_alpha_fast=0.1, save_pose_rate=0.5,
                    odom_model_type="diff", laser_model_type="likelihood_field", initial_cov_xx=0.25)
    assert {name: PARAMETERS[name].default for name in expected} == expected


def test_the_defaults_go_together():
    assert checked(settings()) == []


@pytest.mark.parametrize("others, word, value", [
    ({"odom_model_type": "tank"}, "odom_model_type", "diff"),
    ({"laser_model_type": ""}, "laser_model_type", "likelihood_field"),
    ({"min_particles": 200, "max_particles": 100}, "max_particles", 200),
    ({"odom_frame_id": "/"}, "odom_frame_id", "odom")])
def test_values_that_do_not_go_together_are_repaired_and_told(others, word, value):
    values = settings(**others)
    warnings = checked(values)
    assert len(warnings) == 1 and word in warnings[0] and values[word] == value


def test_slashes_before_frames_are_dropped():
    values = settings(base_frame_id="/base_footprint")
    assert checked(values) == [] and values["base_frame_id"] == "base_footprint"


def test_whole_numbers_as_jackal_writes_them_hold():
    values, warnings = read(PARAMETERS, {"laser_max_beams": 720, "transform_tolerance": 1}, "/amcl")
    assert (values["laser_max_beams"], values["transform_tolerance"], warnings) == (720, 1.0, [])
