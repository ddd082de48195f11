# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour on which programs for Gazebo depend; most of it is tested with its module."""
from pathlib import Path

import pytest
from geometry_msgs.msg import Point, Pose, Quaternion

from conftest import at, package_folder
from gazebo_msgs.msg import LinkStates, ModelStates
from gazebo_msgs.srv import SpawnModelRequest
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.urdf.xacro_text import expand_xacro
from m2wr_sim.ros.gazebo_services.spawning import Spawner


def changed(old, new):
    """Return the report's robot with a text of its expanded description replaced."""
    path = Path(package_folder("m2wr_description")) / "urdf" / "m2wr.xacro"
    text = expand_xacro(path.read_text(encoding="utf-8"), str(path), package_folder)
    assert old in text, "the report's robot has no %s" % old
    return load_urdf(text.replace(old, new), "m2wr.urdf")


@pytest.mark.parametrize("old, new, reaches", [
    ('effort="10000"', 'effort="0.001"', True), ('velocity="1000"', 'velocity="0.01"', True),
    ("<torque>0.1</torque>", "<torque>0.0001</torque>", True),
    ("<torque>0.1</torque>", "<wheelTorque>0.0001</wheelTorque>", False)])
def test_only_wheel_torque_limits_the_wheels(m2wr_rig, old, new, reaches):
    rig = m2wr_rig(robot=changed(old, new), wheel_convention="kinetic")
    rig.send(0.5, 0.0).run(2.0)
    assert (rig.rate("joint_left_wheel") > 4.9) == reaches
    assert reaches or abs(rig.rate("joint_left_wheel")) < 0.5


def test_a_state_gives_its_twist_to_every_link(m2wr_rig):
    rig = m2wr_rig()
    rig.simulator.set_model_state("m2wr", at(0.0, 0.0, 5.0), (0.3, -0.2, 0.1), (0.4, 0.5, 0.6))
    model = rig.simulator.models["m2wr"]
    assert list(model.handle.links) == ["link_chassis", "link_left_wheel", "link_right_wheel"]
    for number in model.handle.links.values():
        assert rig.engine.link_state(number).angular_velocity == pytest.approx((0.4, 0.5, 0.6))
    for number in list(model.handle.links.values())[1:]:        # their centre of mass is their frame's origin
        assert rig.engine.link_state(number).linear_velocity == pytest.approx((0.3, -0.2, 0.1))
    assert rig.rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-9)


def test_states_of_links_and_models_are_different_types():
    assert LinkStates._md5sum == ModelStates._md5sum
    assert (LinkStates._type, ModelStates._type) == ("gazebo_msgs/LinkStates", "gazebo_msgs/ModelStates")
    assert LinkStates.__slots__ == ModelStates.__slots__ == ["name", "pose", "twist"]


def test_a_spawned_pose_keeps_the_digits_that_gazebo_rounds_away(make_rig):
    rig = make_rig()
    text = ('<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
            'iyz="0" izz="1"/></inertial></link></robot>')
    wanted = (1234.56789, -0.123456789, 3.00000001)
    request = SpawnModelRequest("thing", text, "", Pose(Point(*wanted), Quaternion(0.0, 0.0, 0.0, 1.0)), "")
    assert Spawner(rig.simulator).spawn_urdf_model(request).success
    assert rig.pose("thing")[0] == wanted
    for here, there in zip(wanted, ("%.6g" % value for value in wanted)):
        assert here == pytest.approx(float(there), rel=5e-6)
