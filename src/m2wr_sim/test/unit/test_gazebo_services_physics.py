# SPDX-License-Identifier: BSD-3-Clause
"""The services about the physics, called without a network."""
import math
from dataclasses import replace

import pytest
from geometry_msgs.msg import Vector3

from gazebo_msgs import srv
from gazebo_msgs.msg import ODEPhysics
from m2wr_sim.ros.gazebo_services.physics import PhysicsApi
from m2wr_sim.ros.gazebo_services.table import SERVICES


@pytest.fixture
def api(make_rig):
    """Return the PhysicsApi of a rig, with the rig and the list of real-time factors it asked for."""
    rig, factors = make_rig(), []
    api = PhysicsApi(rig.simulator, factors.append)
    api.rig, api.factors = rig, factors
    return api


def wanted(**fields):
    given = dict(time_step=0.002, max_update_rate=500.0, gravity=Vector3(0.0, 0.0, -1.5),
                 ode_config=ODEPhysics(True, 3, 80, 1.4, 0.25, 0.01, 2000.0, 1e-5, 0.3, 12))
    return srv.SetPhysicsPropertiesRequest(**dict(given, **fields))


def test_every_handler_answers_with_the_type_of_its_service(api):
    for name in ("get_physics_properties", "pause_physics", "unpause_physics"):
        kind = SERVICES[name]
        assert isinstance(getattr(api, name)(kind._request_class()), kind._response_class), name


def test_defaults_are_those_of_a_world_without_physics(api):
    answer = api.get_physics_properties(None)
    assert (answer.success, answer.status_message) == (True, "GetPhysicsProperties: got properties")
    assert answer.time_step == 0.001 and answer.max_update_rate == 1000.0 and answer.pause is False
    assert (answer.gravity.x, answer.gravity.y, answer.gravity.z) == (0.0, 0.0, -9.8)
    assert answer.ode_config == ODEPhysics(False, 0, 50, 1.3, 0.0, 0.001, 100.0, 0.0, 0.2, 20)


def test_values_are_read_back_except_those_gazebo_omits(api):
    answer = api.set_physics_properties(wanted())
    assert (answer.success, answer.status_message) == (True, "physics engine updated")
    back = api.get_physics_properties(None)
    assert back.time_step == 0.002 and back.max_update_rate == 500.0 and back.gravity.z == -1.5
    assert back.ode_config == ODEPhysics(False, 3, 80, 1.4, 0.0, 0.01, 2000.0, 1e-5, 0.3, 12)
    settings = api.rig.engine.settings
    assert settings.step_ns == 2000000 and settings.gravity == (0.0, 0.0, -1.5) and settings.max_contacts == 12


def test_the_pause_is_kept_and_told(api):
    api.pause_physics(None)
    api.set_physics_properties(wanted())
    assert api.rig.simulator.paused and api.get_physics_properties(None).pause is True
    api.unpause_physics(None)
    assert not api.rig.simulator.paused


def test_fields_left_out_become_zero_but_the_step_stays(api):
    assert api.set_physics_properties(srv.SetPhysicsPropertiesRequest()).success
    assert api.rig.engine.settings.gravity == (0.0, 0.0, 0.0) and api.rig.simulator.step_ns == 1000000
    assert api.factors == [0.0]                 # an update rate of zero: as fast as it can
    api.rig.run(0.1)


def test_the_pace_follows_rate_times_step(api):
    api.set_physics_properties(wanted(time_step=0.001, max_update_rate=1000.0))
    assert api.factors == []                    # as before: one
    api.set_physics_properties(wanted(time_step=0.002, max_update_rate=1000.0))
    api.set_physics_properties(wanted(time_step=0.002, max_update_rate=-5.0))
    assert api.factors == [2.0, 0.0]


@pytest.mark.parametrize("fields", [{"time_step": 0.5}, {"time_step": -0.001}, {"time_step": math.nan},
                                    {"max_update_rate": math.inf}, {"gravity": Vector3(math.nan, 0.0, 0.0)}])
def test_numbers_that_cannot_be_are_refused_and_nothing_changes(api, fields):
    before = replace(api.rig.simulator.physics)
    answer = api.set_physics_properties(wanted(**fields))
    assert not answer.success and answer.status_message.startswith("SetPhysicsProperties: ")
    assert "expected" in answer.status_message and api.rig.simulator.physics == before and not api.factors
