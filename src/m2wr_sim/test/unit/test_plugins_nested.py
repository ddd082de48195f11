# SPDX-License-Identifier: BSD-3-Clause
"""Plugins of nested models find links and joints by local names, also with the model's name in front."""
import pytest
from geometry_msgs.msg import Twist

from conftest import at
from m2wr_sim.model.sdf.loader import load_sdf_models

WHEEL = ('<link name="{0}"><pose>0 {1} 0.1 0 0 0</pose><inertial><mass>1</mass><inertia><ixx>.004</ixx><iyy>.004</iyy>'
         '<izz>.004</izz></inertia></inertial><collision name="c"><geometry><sphere><radius>0.1</radius></sphere>'
         '</geometry></collision></link><joint name="{0}_joint" type="revolute"><parent>base</parent>'
         '<child>{0}</child><axis><xyz>0 1 0</xyz></axis></joint>')
CASTER = '<pose>{} 0 -0.15 0 0 0</pose><geometry><sphere><radius>0.05</radius></sphere></geometry>'
SLIDES = '<surface><friction><ode><mu>0</mu><mu2>0</mu2></ode></friction></surface>'
BASE = ('<link name="base"><pose>0 0 0.2 0 0 0</pose><inertial><mass>5</mass><inertia><ixx>.1</ixx><iyy>.1</iyy>'
        '<izz>.1</izz></inertia></inertial>' + "".join('<collision name="c{0}">{1}{2}</collision>'.format(
            index, CASTER.format(x), SLIDES) for index, x in enumerate((0.15, -0.15))) + '</link>')
PLUGINS = ('<plugin name="drive" filename="libgazebo_ros_diff_drive.so"><leftJoint>{0}left_joint</leftJoint>'
           '<rightJoint>{0}right_joint</rightJoint><wheelSeparation>0.4</wheelSeparation>'
           '<wheelDiameter>0.2</wheelDiameter></plugin>'
           '<plugin name="truth" filename="libgazebo_ros_p3d.so"><bodyName>{0}base</bodyName><topicName>/{1}/truth'
           '</topicName></plugin>')


def cart(name, prefix="", pose="0 0 0 0 0 0"):
    """Return the text of a cart with two wheels whose plugins name its parts with a prefix."""
    return '<model name="{0}"><pose>{1}</pose>{2}</model>'.format(
        name, pose, BASE + WHEEL.format("left", 0.2) + WHEEL.format("right", -0.2) + PLUGINS.format(prefix, name))


@pytest.fixture
def spawned(make_rig):
    def spawn(text):
        rig = make_rig(joint_states=False)
        record, = load_sdf_models('<sdf version="1.6">%s</sdf>' % text)
        rig.simulator.spawn(record, at(), record.name)
        return rig
    return spawn


def forward(speed):
    message = Twist()
    message.linear.x = speed
    return message


@pytest.mark.parametrize("prefix", ["", "cart::"])
def test_links_are_found_with_and_without_model_name(spawned, prefix):
    rig = spawned(cart("cart", prefix))
    rig.ports.send("/cart/cmd_vel", forward(0.5))
    assert rig.run(2.0).messages("/cart/odom")[-1].pose.pose.position.x == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("prefix", ["", "{}::"])
def test_two_carts_have_separate_topics_and_odometry(spawned, prefix):
    rig = spawned('<model name="pair">%s%s</model>' % (
        cart("one", prefix.format("one")), cart("two", prefix.format("two"), "0 2 0 0 0 0")))
    rig.ports.send("/two/cmd_vel", forward(0.5))
    rig.run(2.0)
    for name, x, y in (("one", 0.0, 0.0), ("two", 1.0, 2.0)):
        place = rig.messages("/%s/odom" % name)[-1].pose.pose.position
        assert (place.x, place.y, place.z) == pytest.approx((x, y, 0.0), abs=0.05)


def test_outer_plugin_uses_scoped_names_of_inner_parts(spawned):
    rig = spawned('<model name="outer">%s<plugin name="p" filename="libgazebo_ros_p3d.so"><bodyName>inner::base'
                  '</bodyName><topicName>/seen</topicName></plugin></model>' % cart("inner", pose="3 0 0 0 0 0"))
    assert rig.run(0.1).messages("/seen")[-1].pose.pose.position.x == pytest.approx(3.0, abs=0.01)


def test_unknown_name_is_logged_with_the_known_ones(spawned, caplog):
    spawned('<model name="outer">%s</model>' % cart("inner", "other::"))
    assert '"other::left_joint" is no joint of inner (it has inner::left_joint, inner::right_joint)' in caplog.text
