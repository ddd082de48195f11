# SPDX-License-Identifier: BSD-3-Clause
"""The services about links, called without a network: texts, frames, Gazebo's faults and correct physics."""
import math

import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench

from conftest import at
from gazebo_msgs import srv
from gazebo_msgs.msg import LinkState
from m2wr_sim.ros.gazebo_services.links import LinkApi
from m2wr_sim.ros.gazebo_services.table import SERVICES
from m2wr_sim.runtime.forces import Forces

SCOPE = "did you forget to scope the link by model name?"
HALF = math.sqrt(0.5)


@pytest.fixture
def make_api(make_rig, build):
    """Return a function that makes a rig with two movable boxes, ``b`` turned a quarter, and its LinkApi."""
    def make(as_gazebo=True):
        boxes = [build.box(name, x, 0.0, 50.0, static=False, mass=2.0, gravity=False)
                 for name, x in (("a", 0.0), ("b", 3.0))]
        rig = make_rig(*boxes)
        rig.simulator.set_model_state("b", at(3.0, 0.0, 50.0, math.pi / 2), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0))
        forces = Forces(rig.simulator)
        rig.simulator.add_observer(forces, "forces")
        return rig, LinkApi(rig.simulator, forces, as_gazebo)
    return make


def link_state(name, x=0.0, y=0.0, z=0.0, linear=(0.0, 0.0, 0.0), frame="", turn=(0.0, 0.0, 0.0, 0.0)):
    return srv.SetLinkStateRequest(LinkState(name, Pose(Point(x, y, z), Quaternion(*turn)),
                                             Twist(Vector3(*linear), Vector3()), frame))


def wrench(name, force=(2.0, 0.0, 0.0), frame="", duration=0.1, point=(0.0, 0.0, 0.0)):
    return srv.ApplyBodyWrenchRequest(name, frame, Point(*point), Wrench(Vector3(*force), Vector3()), rospy.Time(),
                                      rospy.Duration.from_sec(duration))


def xyz(vector):
    return (vector.x, vector.y, vector.z)


def test_every_handler_answers_with_the_type_of_its_service(make_api):
    _, api = make_api()
    for name in ("get_link_state", "set_link_state", "get_link_properties", "set_link_properties",
                 "apply_body_wrench", "clear_body_wrenches"):
        kind = SERVICES[name]
        assert isinstance(getattr(api, name)(kind._request_class()), kind._response_class), name


@pytest.mark.parametrize("name, frame, text", [
    ("a::link", "", "GetLinkState: got state"), ("link", "world", "GetLinkState: got state"),
    ("a::link", "b::link", "GetLinkState: got state"), ("a::link", "b", "GetLinkState: got state"),
    ("a::arm", "", "GetLinkState: link not found, " + SCOPE), ("c::link", "", "GetLinkState: link not found, " + SCOPE),
    ("a", "", "GetLinkState: link not found, " + SCOPE),
    ("a::link", "odom", "GetLinkState: reference reference_frame not found, " + SCOPE),
    ("a::link", "default", "GetLinkState: reference reference_frame not found, " + SCOPE)])
def test_texts_of_get_link_state(make_api, name, frame, text):
    answer = make_api()[1].get_link_state(srv.GetLinkStateRequest(name, frame))
    assert answer.status_message == text and answer.success is text.endswith("got state")
    if answer.success:
        assert (answer.link_state.link_name, answer.link_state.reference_frame) == (name, frame)


def test_the_state_of_a_link_in_a_frame(make_api):
    state = make_api()[1].get_link_state(srv.GetLinkStateRequest("a::link", "b::link")).link_state
    assert xyz(state.pose.position) == pytest.approx((0.0, 3.0, 0.0))
    assert (state.pose.orientation.z, state.pose.orientation.w) == pytest.approx((-HALF, HALF))
    assert xyz(state.twist.linear) == pytest.approx((-2.0, 0.0, 0.0))     # 0 - (0, 2, 0), turned into the frame


@pytest.mark.parametrize("request_, text", [
    (link_state("a::link", 1.0), "SetLinkState: success"), (link_state("a::link", 1.0, frame="b::link"),
                                                            "SetLinkState: success"),
    (link_state("c::link"), "SetLinkState: link does not exist"), (link_state("a::link", frame="b"),
                                                                   "SetLinkState: failed"),
    (link_state("a::link", frame="odom"), "SetLinkState: failed"),
    (link_state("a::link", math.nan), "SetLinkState: pose or twist is not finite")])
def test_texts_of_set_link_state(make_api, request_, text):
    answer = make_api()[1].set_link_state(request_)
    assert (answer.success, answer.status_message) == (text.endswith("success"), text)


@pytest.mark.parametrize("as_gazebo, expected", [(True, (1.0, -2.0, 0.0)), (False, (0.0, 3.0, 0.0))])
def test_velocity_in_a_frame_as_in_gazebo_and_correct(make_api, as_gazebo, expected):
    rig, api = make_api(as_gazebo)
    assert api.set_link_state(link_state("a::link", 1.0, linear=(1.0, 0.0, 0.0), frame="b::link")).success
    state = rig.simulator.models["a"].state(rig.engine)
    assert state.position == pytest.approx((3.0, 1.0, 50.0))
    assert state.linear_velocity == pytest.approx(expected)
    back = api.get_link_state(srv.GetLinkStateRequest("a::link", "b::link")).link_state.twist.linear
    assert (xyz(back) == pytest.approx((1.0, 0.0, 0.0))) is not as_gazebo


def test_properties_of_a_link(make_api):
    rig, api = make_api()
    answer = api.get_link_properties(srv.GetLinkPropertiesRequest("a::link"))
    assert (answer.success, answer.status_message) == (True, "GetLinkProperties: got properties")
    assert answer.mass == 2.0 and answer.gravity_mode is False and xyz(answer.com.position) == (0.0, 0.0, 0.0)
    assert answer.com.orientation.w == 1.0 and answer.ixx == answer.izz == pytest.approx(2.0 * 0.5 / 12)
    wrong = api.get_link_properties(srv.GetLinkPropertiesRequest("a::arm"))
    assert (wrong.success, wrong.status_message) == (False, "GetLinkProperties: link not found, " + SCOPE)


@pytest.mark.parametrize("as_gazebo, expected", [(True, 0.1), (False, 0.05)])
def test_a_mass_is_read_back_and_acts_only_without_the_fault(make_api, as_gazebo, expected):
    rig, api = make_api(as_gazebo)
    wanted = srv.SetLinkPropertiesRequest("a::link", Pose(), False, 4.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    answer = api.set_link_properties(wanted)
    assert (answer.success, answer.status_message) == (True, "SetLinkProperties: properties set")
    assert api.get_link_properties(srv.GetLinkPropertiesRequest("a::link")).mass == 4.0
    api.apply_body_wrench(wrench("a::link"))
    rig.run(0.2)
    assert rig.simulator.models["a"].state(rig.engine).linear_velocity[0] == pytest.approx(expected)
    wanted.link_name = "unknown"
    assert api.set_link_properties(wanted).status_message == "SetLinkProperties: link not found, " + SCOPE


@pytest.mark.parametrize("request_, text", [
    (wrench("a::link"), ""), (wrench("a::link", frame="b"), ""),
    (wrench("c::link"), "ApplyBodyWrench: body does not exist"),
    (wrench("a::link", frame="odom"), "ApplyBodyWrench: reference_frame not found"),
    (wrench("a::link", (math.inf, 0.0, 0.0)), "ApplyBodyWrench: a number is not finite")])
def test_texts_of_apply_body_wrench(make_api, request_, text):
    answer = make_api()[1].apply_body_wrench(request_)
    assert (answer.success, answer.status_message) == (not text, text)


@pytest.mark.parametrize("as_gazebo, expected", [(True, (0.0, 0.1, 0.0)), (False, (0.0, 0.1, 0.0))])
def test_a_wrench_in_the_frame_of_another_link(make_api, as_gazebo, expected):
    rig, api = make_api(as_gazebo)      # a stands upright, so its axes are the world's and the fault does not show
    api.apply_body_wrench(wrench("a::link", frame="b::link"))
    rig.run(0.2)
    assert rig.simulator.models["a"].state(rig.engine).linear_velocity == pytest.approx(expected)


@pytest.mark.parametrize("as_gazebo, expected", [(True, (0.1, 2.0, 0.0)), (False, (0.0, 2.1, 0.0))])
def test_a_wrench_in_the_frame_of_its_own_link(make_api, as_gazebo, expected):
    rig, api = make_api(as_gazebo)
    api.apply_body_wrench(wrench("b::link", frame="b::link"))
    rig.run(0.2)
    assert rig.simulator.models["b"].state(rig.engine).linear_velocity == pytest.approx(expected)


def test_a_wrench_is_cleared_by_the_scoped_name(make_api):
    rig, api = make_api()
    api.apply_body_wrench(wrench("a::link", duration=-1.0))
    rig.run(0.1)
    api.clear_body_wrenches(srv.BodyRequestRequest("a::link"))
    rig.run(0.5)
    assert rig.simulator.models["a"].state(rig.engine).linear_velocity[0] == pytest.approx(0.1)
