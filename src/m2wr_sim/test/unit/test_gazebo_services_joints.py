# SPDX-License-Identifier: BSD-3-Clause
"""The services about joints, called without a network."""
import math

import pytest
import rospy

from gazebo_msgs import srv
from gazebo_msgs.msg import ODEJointProperties
from m2wr_sim.model.types import Axis, Inertial, Joint, Link, Model
from m2wr_sim.ros.gazebo_services.joints import JointApi
from m2wr_sim.ros.gazebo_services.table import SERVICES
from m2wr_sim.runtime.forces import Forces


@pytest.fixture
def rotor(make_rig):
    """Return a rig with a rotor of 0.5 kg m^2 on a hinge along z, and its JointApi."""
    link = Link("link", inertial=Inertial(1.0, inertia=(0.5, 0.0, 0.0, 0.5, 0.0, 0.5)), gravity=False)
    rig = make_rig(Model("rotor", (link,), (Joint("turn", "revolute", "world", "link", axis=Axis(effort=2.0)),)))
    forces = Forces(rig.simulator)
    rig.simulator.add_observer(forces, "forces")
    return rig, JointApi(rig.simulator, forces)


def effort(name, value, duration=0.5):
    return srv.ApplyJointEffortRequest(name, value, rospy.Time(), rospy.Duration.from_sec(duration))


def properties(name, **fields):
    return srv.SetJointPropertiesRequest(name, ODEJointProperties(**{key: [value] for key, value in fields.items()}))


def test_every_handler_answers_with_the_type_of_its_service(rotor):
    for name in ("get_joint_properties", "set_joint_properties", "apply_joint_effort", "clear_joint_forces"):
        kind = SERVICES[name]
        assert isinstance(getattr(rotor[1], name)(kind._request_class()), kind._response_class), name


@pytest.mark.parametrize("name", ["turn", "rotor::turn"])
def test_properties_of_a_joint(rotor, name):
    rig, api = rotor
    rig.engine.set_joint_motor(rig.simulator.models["rotor"].handle.joints["turn"], 1.5, 1e4)
    rig.run(1.0)
    answer = api.get_joint_properties(srv.GetJointPropertiesRequest(name))
    assert (answer.success, answer.status_message) == (True, "GetJointProperties: got properties")
    assert answer.type == 0 and list(answer.damping) == []
    assert list(answer.position) == pytest.approx([1.5], rel=1e-3) and list(answer.rate) == pytest.approx([1.5])


@pytest.mark.parametrize("name", ["", "link", "rotor", "other::turn"])
def test_texts_where_there_is_no_joint(rotor, name):
    api = rotor[1]
    assert api.get_joint_properties(
        srv.GetJointPropertiesRequest(name)).status_message == "GetJointProperties: joint not found"
    assert api.set_joint_properties(properties(name)).status_message == "SetJointProperties: joint not found"
    assert api.apply_joint_effort(effort(name, 1.0)).status_message == "ApplyJointEffort: joint not found"


def test_an_effort_is_cut_to_the_limit_and_cleared(rotor):
    rig, api = rotor
    answer = api.apply_joint_effort(effort("turn", 50.0, -1.0))
    assert (answer.success, answer.status_message) == (True, "ApplyJointEffort: effort set")
    rig.run(0.5)
    assert rig.rate("turn", "rotor") == pytest.approx(2.0, rel=1e-3)
    api.clear_joint_forces(srv.JointRequestRequest("turn"))
    rig.run(0.5)
    assert rig.rate("turn", "rotor") == pytest.approx(2.0, rel=1e-3)


def test_fields_that_are_empty_leave_what_is_there(rotor):
    rig, api = rotor
    before = rig.simulator.models["rotor"].joint_record("turn")
    answer = api.set_joint_properties(properties("turn"))
    assert (answer.success, answer.status_message) == (True, "SetJointProperties: properties set")
    assert rig.simulator.models["rotor"].joint_record("turn") == before


def test_damping_stops_and_motor_are_taken(rotor):
    rig, api = rotor
    assert api.set_joint_properties(properties("turn", damping=0.1, hiStop=1.0, loStop=-1.0, fmax=100.0, vel=3.0,
                                               erp=0.3, cfm=1e-6, stop_erp=0.4, stop_cfm=1e-5,
                                               fudge_factor=0.5)).success
    axis = rig.simulator.models["rotor"].joint_record("turn").axis
    assert (axis.damping, axis.lower, axis.upper, axis.stop_erp, axis.stop_cfm) == (0.1, -1.0, 1.0, 0.4, 1e-5)
    rig.run(0.2)
    assert rig.rate("turn", "rotor") == pytest.approx(3.0, rel=1e-2)
    rig.run(1.0)
    assert rig.engine.joint_angle(rig.simulator.models["rotor"].handle.joints["turn"]) == pytest.approx(1.0, abs=0.05)


def test_numbers_that_are_not_finite_are_refused(rotor):
    api = rotor[1]
    assert "vel" not in api.set_joint_properties(properties("turn", fmax=1.0)).status_message
    answer = api.set_joint_properties(properties("turn", vel=math.nan))
    assert not answer.success and "expected a finite number" in answer.status_message
    assert api.apply_joint_effort(effort("turn", math.inf)).status_message == "ApplyJointEffort: effort is not finite"


@pytest.mark.parametrize("first, second", [(3.0, 0.0), (0.0, -2.0), (1.0, 2.0)])
def test_a_joint_with_two_axes_takes_a_value_for_each(make_rig, first, second):
    link = Link("link", inertial=Inertial(1.0, inertia=(0.5, 0.0, 0.0, 0.5, 0.0, 0.5)), gravity=False)
    joint = Joint("knuckle", "universal", "world", "link", axis=Axis(xyz=(1.0, 0.0, 0.0)),
                  axis2=Axis(xyz=(0.0, 1.0, 0.0)))
    rig = make_rig(Model("rotor", (link,), (joint,)))
    api = JointApi(rig.simulator, Forces(rig.simulator))
    values = ODEJointProperties(fmax=[100.0, 100.0], vel=[first, second], damping=[0.1, 0.2], hiStop=[1.5])
    assert api.set_joint_properties(srv.SetJointPropertiesRequest("knuckle", values)).success
    record = rig.simulator.models["rotor"].joint_record("knuckle")
    assert [axis.damping for axis in record.axes()] == [0.1, 0.2]
    assert (record.axis.upper, record.axis2.upper) == (1.5, 1e16)
    rig.run(0.05)
    spin = rig.engine.link_state(rig.simulator.models["rotor"].handle.links["link"]).angular_velocity
    assert sum(value * value for value in spin) == pytest.approx(first * first + second * second, rel=0.05)


def test_the_second_axis_is_named_pushed_and_read(make_rig):
    link = Link("link", inertial=Inertial(1.0, inertia=(0.5, 0.0, 0.0, 0.5, 0.0, 0.5)), gravity=False)
    joint = Joint("knuckle", "universal", "world", "link", axis=Axis(xyz=(1.0, 0.0, 0.0)),
                  axis2=Axis(xyz=(0.0, 1.0, 0.0), effort=2.0))
    rig = make_rig(Model("rotor", (link,), (joint,)))
    forces = Forces(rig.simulator)
    rig.simulator.add_observer(forces, "forces")
    api = JointApi(rig.simulator, forces)
    assert api.apply_joint_effort(effort("rotor::knuckle::axis2", 50.0, 0.5)).success       # its limit is 2 N m
    rig.run(0.5)
    answer = api.get_joint_properties(srv.GetJointPropertiesRequest("knuckle"))
    assert list(answer.rate) == pytest.approx([0.0, 2.0], abs=0.01)
    assert list(answer.position) == pytest.approx([0.0, 0.5], abs=0.01)
    assert api.set_joint_properties(properties("knuckle::axis2", damping=0.3)).success
    assert rig.simulator.models["rotor"].joint_record("knuckle").axis2.damping == 0.3
    rig.simulator.set_joint_positions("rotor", {"knuckle::axis2": 0.2})
    assert api.get_joint_properties(srv.GetJointPropertiesRequest("knuckle::axis2")).position[0] == pytest.approx(0.2)
    rig.run(0.01)
    answer = api.get_joint_properties(srv.GetJointPropertiesRequest("knuckle"))
    assert answer.position[1] == pytest.approx(0.2, abs=0.03)
