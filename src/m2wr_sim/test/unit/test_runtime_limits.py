# SPDX-License-Identifier: BSD-3-Clause
"""Limits of forces and joint parameters: closed forms; no finite request of a service makes the simulation diverge."""
import math

import pytest
import rospy
from geometry_msgs.msg import Point, Vector3, Wrench

from conftest import at
from gazebo_msgs import srv
from gazebo_msgs.msg import ODEJointProperties
from m2wr_sim.errors import ModelError
from m2wr_sim.model.types import Axis, Box, Collision, Inertial, Joint, Link, Model
from m2wr_sim.physics.engine import FARTHEST, FASTEST
from m2wr_sim.ros.gazebo_services.joints import JointApi
from m2wr_sim.ros.gazebo_services.links import LinkApi
from m2wr_sim.ros.gazebo_services.physics import PhysicsApi
from m2wr_sim.runtime.entities import LiveModel
from m2wr_sim.runtime.forces import Forces
from m2wr_sim.runtime.limits import check_pose, check_velocity, solver_stops, strongest, strongest_effort

STEP = 0.001
HUGE = (1e300, -1e300, 1e12, -1e7)


def arm(kind="revolute", parent="base", turn=(0.0, 0.0, 0.0, 1.0), **axis):
    """Return a model of a base and an arm of 2 kg with 0.1, 0.2 and 0.4 kg m^2 on a joint along the arm's z."""
    base = Link("base", inertial=Inertial(5.0, inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 0.5)),
                collisions=(Collision("c", Box((0.4, 0.4, 0.2))),))
    link = Link("arm", ((0.0, 0.0, 0.3), turn), inertial=Inertial(2.0, inertia=(0.1, 0.0, 0.0, 0.2, 0.0, 0.4)))
    return Model("crane", (base, link), (Joint("joint", kind, parent, "arm", axis=Axis(**axis)),), pose=at(z=0.1))


def live(model):
    return LiveModel(model, type("Handle", (), {"name": model.name, "links": {}, "joints": {}})(), model.pose)


@pytest.fixture
def apis(make_rig):
    """Return a rig with a crane on the ground, and the services on links, joints and physics."""
    def make(kind="revolute", as_gazebo=True):
        rig = make_rig(arm(kind))
        forces = Forces(rig.simulator)
        rig.simulator.add_observer(forces, "forces")
        return rig, LinkApi(rig.simulator, forces, as_gazebo), JointApi(rig.simulator, forces), PhysicsApi(
            rig.simulator, lambda factor: None)
    return make


def survives(rig, seconds=0.3):
    """Run, and check that all states are finite and no plugin was switched off."""
    observers = list(rig.simulator.observers)
    rig.run(seconds)
    for model in rig.simulator.models.values():
        for link in model.handle.links.values():
            state = rig.engine.link_state(link)
            assert all(math.isfinite(value) for part in state for value in part)
            assert max(map(abs, state.linear_velocity + state.angular_velocity)) < 1e6
    assert rig.simulator.observers == observers
    return True


@pytest.mark.parametrize("value", [FARTHEST, -FARTHEST, 0.0])
def test_positions_up_to_the_limit_are_accepted(value):
    pose = at(value, 0.0, value)
    assert check_pose("robot", pose) is pose


@pytest.mark.parametrize("value", [1.01 * FARTHEST, -1e300, math.inf, math.nan])
def test_positions_beyond_the_limit_are_refused(value):
    with pytest.raises(ModelError, match="for \"robot\": expected at most 1e\\+06 m from the origin"):
        check_pose("robot", at(0.0, value))


@pytest.mark.parametrize("value", [1.01 * FASTEST, -math.inf, math.nan])
def test_velocities_beyond_the_limit_are_refused(value):
    check_velocity("robot", (FASTEST, 0.0, 0.0), (0.0, 0.0, -FASTEST))
    for linear, angular in (((value, 0.0, 0.0), (0.0,) * 3), ((0.0,) * 3, (0.0, value, 0.0))):
        with pytest.raises(ModelError, match="for \"robot\": expected at most 10000 m/s and rad/s"):
            check_velocity("robot", linear, angular)


def test_force_and_torque_to_the_greatest_speed_in_one_step():
    inertial = Inertial(2.0, inertia=(0.3, 0.1, 0.0, 0.3, 0.0, 0.5))        # least principal moment: 0.2
    assert strongest(inertial, STEP) == pytest.approx((FASTEST * 2.0 / STEP, FASTEST * 0.2 / STEP))


@pytest.mark.parametrize("kind, expected", [("revolute", 0.4), ("prismatic", 2.0)])
def test_an_effort_is_measured_by_the_lighter_side(kind, expected):
    model = live(arm(kind))
    assert strongest_effort(model, model.joint_record("joint"), STEP) == pytest.approx(FASTEST * expected / STEP)


def test_a_nearly_massless_link_between_joints_counts_with_them():
    model = arm()
    dummy = Link("dummy", inertial=Inertial(1e-5, inertia=(1e-9, 0.0, 0.0, 1e-9, 0.0, 1e-9)))
    joints = (Joint("yaw", "revolute", "base", "dummy"), Joint("pitch", "revolute", "dummy", "arm"))
    model = live(Model("crane", model.links + (dummy,), joints))
    for name in ("yaw", "pitch"):
        assert strongest_effort(model, model.joint_record(name), STEP) == pytest.approx(FASTEST * 0.4 / STEP)


@pytest.mark.parametrize("stops, taken", [
    ({"lower": -1e16, "upper": 1e16}, {"lower": -math.inf, "upper": math.inf}), ({"lower": -1.0}, {"lower": -1.0}),
    ({"upper": math.pi}, {"upper": math.inf}), ({}, {})])
def test_a_hinge_has_no_stops_beyond_half_a_turn(stops, taken):
    joint = arm().joints[0]
    assert solver_stops("x", joint, 0.5, STEP, stops) == taken
    assert solver_stops("x", joint, 0.5 + 20.0 * math.pi, STEP, stops) == taken     # angles count whole turns


@pytest.mark.parametrize("kind, stops", [("revolute", {"lower": 5.0}), ("revolute", {"upper": -1e300}),
                                         ("prismatic", {"lower": 10.1}), ("prismatic", {"upper": -1e6})])
def test_a_stop_that_would_throw_the_joint_is_refused(kind, stops):
    with pytest.raises(ModelError, match="expected at most"):
        solver_stops("crane::joint", arm(kind).joints[0], 0.0, STEP, stops)


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize("as_gazebo", [True, False])
def test_no_wrench_lets_the_simulation_diverge(apis, value, as_gazebo):
    rig, links, _, _ = apis(as_gazebo=as_gazebo)
    for force, torque, point in (((value, 0, 0), (0, 0, 0), (0, 0, 0)), ((0, 0, 0), (0, value, 0), (0, 0, 0)),
                                 ((1, 0, 0), (0, 0, 0), (0, value, 0))):
        for frame in ("", "crane::base"):
            wrench = Wrench(Vector3(*force), Vector3(*torque))
            answer = links.apply_body_wrench(srv.ApplyBodyWrenchRequest(
                "crane::arm", frame, Point(*point), wrench, rospy.Time(), rospy.Duration(-1)))
            if abs(value) > 1e8:
                assert not answer.success and "expected at most 2e+07 N and 1e+06 N m" in answer.status_message
    assert survives(rig)


def test_a_wrench_is_bounded_by_the_mass_that_moves(apis):
    rig, links, _, _ = apis()
    assert links.set_link_properties(srv.SetLinkPropertiesRequest(link_name="crane::arm", mass=-1.0)).success
    push = srv.ApplyBodyWrenchRequest("crane::arm", "", Point(), Wrench(Vector3(1e7, 0, 0), Vector3()), rospy.Time(),
                                      rospy.Duration(-1))
    assert links.apply_body_wrench(push).success and survives(rig, 1.0)


def test_a_wrench_ends_when_its_link_has_become_too_fast(apis, caplog):
    rig, links, _, _ = apis()
    push = srv.ApplyBodyWrenchRequest("crane::base", "", Point(), Wrench(Vector3(0, 0, 1e6), Vector3()), rospy.Time(),
                                      rospy.Duration(-1))
    assert links.apply_body_wrench(push).success and survives(rig, 1.0)
    assert caplog.text.count("on crane::base ends: it moves at") == 1


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_no_effort_lets_the_simulation_diverge(apis, value, kind, caplog):
    rig, _, joints, _ = apis(kind)
    answer = joints.apply_joint_effort(srv.ApplyJointEffortRequest("joint", value, rospy.Time(), rospy.Duration(-1)))
    assert answer.success is (abs(value) < 1e8 and kind == "prismatic") and survives(rig)
    assert ("expected at most" in answer.status_message) is not answer.success
    assert ("crane::joint ends" in caplog.text) is answer.success


@pytest.mark.parametrize("value", HUGE + (-1.0, 5e-324))
@pytest.mark.parametrize("kind", ["revolute", "prismatic", "universal"])
def test_no_value_of_a_joint_lets_the_simulation_diverge(apis, value, kind):
    rig, _, joints, _ = apis(kind)
    both = [value, value]
    for fields in [{name: both} for name in ODEJointProperties.__slots__] + [{"fmax": [abs(value)] * 2, "vel": both}]:
        joints.set_joint_properties(srv.SetJointPropertiesRequest("joint", ODEJointProperties(**fields)))
        assert survives(rig, 0.1)


def test_excessive_damping_stops_the_joint_at_once(apis):
    rig, _, joints, _ = apis()
    rig.engine.set_joint_motor(rig.simulator.models["crane"].handle.joints["joint"], 5.0, 1e4)
    rig.run(0.1)
    rig.engine.set_joint_motor(rig.simulator.models["crane"].handle.joints["joint"], 0.0, 0.0)
    answer = joints.set_joint_properties(srv.SetJointPropertiesRequest("joint", ODEJointProperties(damping=[1e9])))
    assert answer.success
    rates = [rig.run(0.001).rate("joint", "crane") for _ in range(30)]
    assert max(map(abs, rates)) < 1e-3


@pytest.mark.parametrize("fields", [dict(mass=1e300), dict(ixx=1e300), dict(ixy=1e300), dict(izz=1e30), dict(mass=0.0),
                                    dict(mass=-1.0), dict(iyy=-1.0)])
def test_masses_that_cannot_be_simulated_are_refused(apis, fields):
    rig, links, _, _ = apis(as_gazebo=False)
    values = dict(dict(mass=2.0, ixx=0.1, iyy=0.2, izz=0.4), **fields)
    answer = links.set_link_properties(srv.SetLinkPropertiesRequest(link_name="crane::arm", **values))
    assert not answer.success and "expected" in answer.status_message and survives(rig)


@pytest.mark.parametrize("value", [1e300, -1e300, 1.1e4])
def test_gravity_beyond_what_the_world_survives_is_refused(apis, value):
    rig, _, _, physics = apis()
    now = physics.get_physics_properties(None)
    request = srv.SetPhysicsPropertiesRequest(now.time_step, now.max_update_rate, Vector3(0, 0, value), now.ode_config)
    answer = physics.set_physics_properties(request)
    assert not answer.success and "expected at most 10000 m/s^2" in answer.status_message and survives(rig)
