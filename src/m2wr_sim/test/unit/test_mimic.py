# SPDX-License-Identifier: BSD-3-Clause
"""Joints that follow another one, by <mimic> of URDF or by the plugins of grippers."""
import pytest

from m2wr_sim.model.urdf.loader import load_urdf

LINK = """<link name="{}"><inertial><mass value="{}"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0"
iyz="0"/></inertial>{}</link>"""
PAD = '<collision><origin xyz="0 {} 0"/><geometry><box size="0.04 0.01 0.04"/></geometry></collision>'
FINGER = """<joint name="{0}" type="prismatic"><parent link="hand"/><child link="{0}_link"/><origin xyz="0 0 0.5"/>
<axis xyz="0 1 0"/><limit lower="-0.08" upper="0.08" effort="20" velocity="0.5"/>{1}</joint>"""
PLUGIN = """<gazebo><plugin name="follow" filename="{}"><joint>left</joint><mimicJoint>right</mimicJoint>
<multiplier>-1.0</multiplier>{}</plugin></gazebo>"""
LIBRARIES = ["libroboticsgroup_gazebo_mimic_joint_plugin.so", "libroboticsgroup_upatras_gazebo_mimic_joint_plugin.so",
             "libmimic_joint_plugin.so", "libgazebo_mimic_joint_plugin.so"]


def gripper(mimic="", more=""):
    """Two fingers that slide along y, on a hand that is fixed in the world; at 0 their pads are 10 cm apart."""
    return ("<robot name='gripper'><link name='world'/><joint name='fix' type='fixed'><parent link='world'/>"
            "<child link='hand'/></joint>" + LINK.format("hand", 5, "")
            + LINK.format("left_link", 0.2, PAD.format(0.055))
            + LINK.format("right_link", 0.2, PAD.format(-0.055)) + FINGER.format("left", "")
            + FINGER.format("right", mimic) + more + "</robot>")


@pytest.fixture
def close(make_rig):
    """Return a function that moves the left finger by a motor; it returns the rig and both positions."""
    def run(text, speed=-0.05, force=10.0, seconds=1.0, *models):
        rig = make_rig(*models)
        rig.simulator.spawn(load_urdf(text, "test"), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
        joints = rig.simulator.models["gripper"].handle.joints
        rig.engine.set_joint_motor(joints["left"], speed, force)
        rig.run(seconds)
        return rig, rig.engine.joint_angle(joints["left"]), rig.engine.joint_angle(joints["right"])
    return run


@pytest.mark.parametrize("multiplier, offset", [(-1.0, 0.0), (1.0, 0.0), (-0.5, 0.02)])
def test_mimic_of_a_urdf_follows(close, multiplier, offset):
    _, left, right = close(gripper('<mimic joint="left" multiplier="%r" offset="%r"/>' % (multiplier, offset)))
    assert left == pytest.approx(-0.05, abs=0.001)
    assert right == pytest.approx(multiplier * left + offset, abs=1e-5)


def test_multiplier_and_offset_have_defaults(close):
    _, left, right = close(gripper('<mimic joint="left"/>'))
    assert right == pytest.approx(left, abs=1e-5)


@pytest.mark.parametrize("library", LIBRARIES)
def test_plugins_of_grippers_follow(close, library):
    _, left, right = close(gripper(more=PLUGIN.format(library, "")))
    assert left == pytest.approx(-0.05, abs=0.001) and right == pytest.approx(-left, abs=1e-5)


def test_a_plugin_takes_precedence_over_mimic():
    model = load_urdf(gripper('<mimic joint="left" multiplier="3"/>', PLUGIN.format(LIBRARIES[0], "")), "test")
    assert [plugin.filename for plugin in model.plugins] == LIBRARIES[:1]


def test_a_transmission_takes_precedence_over_mimic():
    control = ('<transmission name="t"><joint name="right"/></transmission>'
               '<gazebo><plugin name="c" filename="libgazebo_ros_control.so"/></gazebo>')
    model = load_urdf(gripper('<mimic joint="left"/>', control), "test")
    assert [plugin.filename for plugin in model.plugins] == ["libgazebo_ros_control.so"]
    assert len(load_urdf(gripper('<mimic joint="left"/>', control.split("<gazebo>")[0]), "test").plugins) == 1


def test_the_follower_keeps_its_limits(close):
    _, _, right = close(gripper('<mimic joint="left" multiplier="-5"/>'))
    assert right == pytest.approx(0.08, abs=1e-4)


def test_grasp_has_the_greatest_force_of_the_follower(close, build):
    wall = build.box("wall", 0.0, -0.02, 0.5, (0.1, 0.02, 0.1))         # its near face is 2 cm from the right pad
    rig, _, right = close(gripper(more=PLUGIN.format(LIBRARIES[0], "<maxEffort>3</maxEffort>")), -0.05, 10.0, 2.0, wall)
    assert right == pytest.approx(0.02, abs=0.002)          # it does not pass through
    joint = rig.simulator.models["gripper"].handle.joints["right"]
    rig.engine.feel_joint(joint)
    rig.run(0.1)
    assert rig.engine.joint_wrench(joint)[0][1] == pytest.approx(3.0, rel=0.02)


def test_sensitiveness_leaves_small_errors(close):
    _, left, right = close(gripper(more=PLUGIN.format(LIBRARIES[0], "<sensitiveness>0.2</sensitiveness>")))
    assert abs(right) < 1e-3 < abs(left)


def test_pid_gains_of_a_parameter_are_used(make_rig):
    rig = make_rig()
    rig.ports.parameters["/gazebo_ros_control/pid_gains/right"] = {"p": 20.0, "d": 4.0}
    rig.simulator.spawn(load_urdf(gripper(more=PLUGIN.format(LIBRARIES[0], "<hasPID/>")), "test"),
                        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    joints = rig.simulator.models["gripper"].handle.joints
    rig.engine.set_joint_motor(joints["left"], -0.05, 10.0)
    rig.run(0.1)
    assert rig.engine.joint_angle(joints["right"]) < 0.004              # it lags, as it has no motor
    rig.engine.set_joint_motor(joints["left"], 0.0, 10.0)
    rig.run(2.0)
    assert rig.engine.joint_angle(joints["right"]) == pytest.approx(0.005, abs=5e-4)


def test_hasPID_without_gains_is_reported(close, caplog):
    _, left, right = close(gripper(more=PLUGIN.format(LIBRARIES[0], "<hasPID/>")))
    assert right == pytest.approx(-left, abs=1e-5) and "/gazebo_ros_control/pid_gains/right/p" in caplog.text


@pytest.mark.parametrize("leader", ["right", "fix", "nothing"])
def test_mimic_of_no_other_moving_joint_is_reported(leader):
    model = load_urdf(gripper('<mimic joint="%s"/>' % leader), "test")
    assert not model.plugins and any('mimics "%s"' % leader in note for note in model.notes)


@pytest.mark.parametrize("tag, text", [("joint", "nothing"), ("multiplier", "nan"), ("sensitiveness", "-1"),
                                       ("maxEffort", "-2"), ("offset", "much")])
def test_bad_tags_are_named(close, caplog, tag, text):
    plugin = PLUGIN.format(LIBRARIES[0], "")
    plugin = plugin.replace("<joint>left<", "<joint>%s<" % text) if tag == "joint" else plugin.replace(
        "<multiplier>-1.0</multiplier>", "<%s>%s</%s>" % (tag, text, tag))
    _, left, right = close(gripper(more=plugin))
    assert text in caplog.text and left == pytest.approx(-0.05, abs=0.001) and abs(right) < 1e-3


def test_a_strong_light_joint_waits_at_its_stop(make_rig):
    # a gripper whose <mimic> leads one joint out of its limits: 1000 N m on 1e-4 kg m^2 threw the model about
    text = "<robot name='gripper'><link name='world'/><joint name='fix' type='fixed'><parent link='world'/>" \
        "<child link='hand'/></joint>" + LINK.format("hand", 5, "")
    for name, parent, more in (("left", "hand", ""), ("tip", "left_link", '<mimic joint="left" multiplier="-1"/>'),
                               ("right", "hand", '<mimic joint="left"/>')):
        text += LINK.format(name + "_link", 0.1, "").replace("0.01", "1e-4")
        text += '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{0}_link"/>' \
            '<origin xyz="0 0.03 0.1"/><axis xyz="1 0 0"/>' \
            '<limit lower="0" upper="0.88" effort="1000" velocity="2"/>{2}</joint>'.format(name, parent, more)
    rig = make_rig()
    rig.simulator.spawn(load_urdf(text + "</robot>", "test"), ((0.0, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0)))
    joints = rig.simulator.models["gripper"].handle.joints
    rig.engine.set_joint_motor(joints["left"], 0.5, 20.0)
    rig.run(1.0)
    assert [rig.engine.joint_angle(joints[name]) for name in ("left", "right", "tip")] == pytest.approx(
        [0.5, 0.5, 0.0], abs=0.02)
