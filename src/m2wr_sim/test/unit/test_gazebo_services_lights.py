# SPDX-License-Identifier: BSD-3-Clause
"""The services about lights, called without a network."""
import math

import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA

from gazebo_msgs import srv
from m2wr_sim.model.types import Light, World
from m2wr_sim.ros.gazebo_services.lights import LightApi
from m2wr_sim.ros.gazebo_services.table import SERVICES


@pytest.fixture
def lamp(make_rig, build):
    """Return the simulator of a world with a lamp in it, and its LightApi."""
    light = Light("lamp", diffuse=(0.25, 0.5, 0.75, 1.0), attenuation=(0.5, 0.25, 0.125))
    simulator = make_rig(world=World(models=(build.ground(),), lights=(light,))).simulator
    return simulator, LightApi(simulator)


def test_every_handler_answers_with_the_type_of_its_service(lamp):
    for name in ("get_light_properties", "set_light_properties", "delete_light"):
        kind = SERVICES[name]
        assert isinstance(getattr(lamp[1], name)(kind._request_class()), kind._response_class), name


def test_properties_are_told_with_an_empty_text(lamp):
    answer = lamp[1].get_light_properties(srv.GetLightPropertiesRequest("lamp"))
    assert (answer.success, answer.status_message) == (True, "")
    assert (answer.diffuse.r, answer.diffuse.g, answer.diffuse.b, answer.diffuse.a) == (0.25, 0.5, 0.75, 1.0)
    assert (answer.attenuation_constant, answer.attenuation_linear, answer.attenuation_quadratic) == (0.5, 0.25, 0.125)


def wanted(name, x=1.0):
    return srv.SetLightPropertiesRequest(name, True, ColorRGBA(1, 0, 0, 1), ColorRGBA(0, 1, 0, 1), 1.0, 0.5, 0.25,
                                         Vector3(0, 0, -1), Pose(Point(x, 2.0, 3.0), Quaternion()))


def test_properties_are_set(lamp):
    simulator, api = lamp
    answer = api.set_light_properties(wanted("lamp"))
    assert (answer.success, answer.status_message) == (True, "")
    assert simulator.lights["lamp"] == Light("lamp", "point", ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)), (1, 0, 0, 1),
                                             (0, 1, 0, 1), (1.0, 0.5, 0.25), (0, 0, -1), True)


def test_texts_where_there_is_no_light(lamp):
    api = lamp[1]
    assert api.get_light_properties(srv.GetLightPropertiesRequest("x")).status_message == \
        "getLightProperties: Requested light x not found!"
    assert api.set_light_properties(wanted("x")).status_message == "setLightProperties: Requested light x not found!"
    answer = api.delete_light(srv.DeleteLightRequest("x"))
    assert (answer.success, answer.status_message) == (
        False, "DeleteLight: Timeout reached while removing light \"x\"")
    assert not api.set_light_properties(wanted("lamp", math.nan)).success


def test_a_deleted_light_is_gone(lamp):
    simulator, api = lamp
    answer = api.delete_light(srv.DeleteLightRequest("lamp"))
    assert (answer.success, answer.status_message) == (True, "DeleteLight: lamp successfully deleted")
    assert not simulator.lights and not api.delete_light(srv.DeleteLightRequest("lamp")).success
