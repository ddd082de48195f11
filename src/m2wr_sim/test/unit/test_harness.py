# SPDX-License-Identifier: BSD-3-Clause
"""The harness plugin: a box of 4 kg that hangs, is raised by a winch, and falls when it is detached."""
import math

import pytest
from std_msgs.msg import Bool, Float32

from m2wr_sim.plugins.harness import WinchPid
from sdf_documents import model

AT = ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
MASS, WEIGHT = 4.0, 4.0 * 9.8       # kg, N
BOX = """<link name="box"><inertial><mass>4</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz><ixy>0</ixy>
<ixz>0</ixz><iyz>0</iyz></inertia></inertial>
<collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry>
</collision></link>"""
PLUGIN = """<plugin name="harness" filename="{library}"><joint name="rope" type="{kind}"><parent>world</parent>
<child>{child}</child><pose>0 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz><limit><lower>-10</lower><upper>{upper}</upper>
</limit><dynamics><damping>{damping}</damping></dynamics></axis></joint>
<winch><joint>{winch}</joint><pos_pid><p>{p}</p><i>0</i><d>{d}</d><cmd_max>10000</cmd_max><cmd_min>-10000</cmd_min>
</pos_pid><vel_pid><p>{vp}</p><i>{vi}</i><i_max>10000</i_max><i_min>-10000</i_min><cmd_max>10000</cmd_max>
<cmd_min>0</cmd_min></vel_pid></winch><detach>{detach}</detach></plugin>"""
VALUES = {"library": "libgazebo_ros_harness.so", "kind": "prismatic", "child": "box", "upper": "10", "damping": "0",
          "winch": "rope", "p": "2000", "d": "300", "vp": "0", "vi": "0", "detach": "rope"}


@pytest.fixture
def hang(make_rig):
    """Return a function that spawns the box at a height of 1 m, in a harness."""
    def make(body=BOX, **values):
        rig = make_rig(joint_states=False)
        rig.simulator.spawn(model(body + PLUGIN.format(**dict(VALUES, **values))), AT, name="m", namespace="/")
        return rig
    return make


def height(rig):
    return rig.pose("m")[0][2]


def test_a_model_hangs_where_force_and_weight_agree(hang):
    rig = hang().run(4.0)
    assert height(rig) == pytest.approx(1.0 - WEIGHT / 2000.0, abs=1e-4)
    assert abs(rig.rate("rope", "m")) < 1e-4


@pytest.mark.parametrize("library", ["libgazebo_ros_harness.so", "libHarnessPlugin.so"])
def test_the_winch_raises_at_the_speed_of_its_topic(hang, library):
    rig = hang(library=library, vp="400", vi="2000").run(2.0)
    rig.ports.send("/m/harness/velocity", Float32(0.25))
    rig.run(3.0)            # the integral carries the weight
    assert rig.rate("rope", "m") == pytest.approx(0.25, abs=1e-3)
    before = height(rig)
    assert height(rig.run(1.0)) - before == pytest.approx(0.25, abs=2e-3)


def test_without_an_integral_the_weight_slows_the_winch(hang):
    rig = hang(vp="400").run(1.0)
    rig.ports.send("/m/harness/velocity", Float32(0.5))
    assert rig.run(2.0).rate("rope", "m") == pytest.approx(0.5 - WEIGHT / 400.0, abs=1e-3)


def test_at_speed_0_the_winch_holds_where_it_is(hang):
    rig = hang(vp="400", vi="2000").run(1.0)
    rig.ports.send("/m/harness/velocity", Float32(0.25))
    rig.run(2.0)
    rig.ports.send("/m/harness/velocity", Float32(0.0))
    before = height(rig.run(0.001))
    rig.run(5.0)
    assert height(rig) == pytest.approx(before, abs=WEIGHT / 2000.0 + 0.01)
    assert abs(rig.rate("rope", "m")) < 1e-3


def test_a_detached_model_falls(hang, caplog):
    rig = hang().run(3.0)
    rig.ports.send("/m/harness/detach", Bool(False))
    start = height(rig.run(0.1))
    rig.ports.send("/m/harness/detach", Bool(True))
    rig.run(0.3)
    assert start - height(rig) == pytest.approx(0.5 * 9.8 * 0.3 ** 2, rel=0.02)
    rig.ports.send("/m/harness/velocity", Float32(1.0))
    rig.ports.send("/m/harness/detach", Bool(True))
    assert height(rig.run(2.0)) == pytest.approx(0.1, abs=2e-3)           # on the ground
    assert "the model is detached" in caplog.text


def test_the_joint_stops_at_its_limit(hang):
    rig = hang(upper="0.3", vp="400", vi="2000").run(0.5)
    rig.ports.send("/m/harness/velocity", Float32(0.5))
    assert height(rig.run(4.0)) == pytest.approx(1.3, abs=0.01)


def test_damping_of_the_joint_slows_the_fall(hang):
    rig = hang(p="0", d="0", damping="40").run(0.8)
    assert rig.rate("rope", "m") == pytest.approx(-WEIGHT / 40.0, rel=0.02)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e9])
def test_a_bad_speed_is_refused(hang, caplog, value):
    rig = hang(vp="400", vi="2000").run(2.0)
    rig.ports.send("/m/harness/velocity", Float32(value))
    before = height(rig)
    assert height(rig.run(1.0)) == pytest.approx(before, abs=1e-3)
    assert "refused a speed" in caplog.text


@pytest.mark.parametrize("values, part", [
    ({"child": "ghost"}, '"ghost" is no link'), ({"kind": "screw"}, 'joint type "screw"'),
    ({"kind": "ball"}, "the winch \"rope\" is of type ball"), ({"upper": "-20"}, "lower limit -10 is above"),
    ({"p": "much"}, 'holds "much"'), ({"upper": "nan"}, 'holds "nan"')])
def test_a_harness_that_cannot_be_made_is_told(hang, caplog, values, part):
    rig = hang(**values).run(0.3)
    assert part in caplog.text and "will not run" in caplog.text
    assert height(rig) == pytest.approx(1.0 - 0.5 * 9.8 * 0.3 ** 2, rel=0.02)


@pytest.mark.parametrize("tag", ["winch", "detach"])
def test_the_first_joint_stands_for_an_unknown_one(hang, caplog, tag):
    rig = hang(**{tag: "ghost"}).run(3.0)
    assert 'names "ghost"' in caplog.text
    assert height(rig) == pytest.approx(1.0 - WEIGHT / 2000.0, abs=1e-3)


def test_a_name_that_is_taken_is_refused(hang, caplog):
    arm = BOX.replace('"box"', '"arm"')
    arm += '<joint name="rope" type="fixed"><parent>box</parent><child>arm</child></joint>'
    hang(BOX + arm).run(0.1)
    assert "has one of this name" in caplog.text


def test_a_reset_and_a_deletion_work(hang):
    rig = hang(vp="400", vi="2000").run(0.5)
    rig.ports.send("/m/harness/velocity", Float32(0.5))
    rig.run(1.0)
    rig.simulator.reset_world()
    assert height(rig) == pytest.approx(1.0, abs=1e-6)
    # the integral of the speed is a spring, too
    assert height(rig.run(3.0)) == pytest.approx(1.0 - WEIGHT / (2000.0 + 2000.0), abs=1e-3)
    rig.simulator.delete("m")
    rig.run(0.1)


def test_the_pid_is_that_of_gazebo():
    pid = WinchPid(2.0, 10.0, 0.5, 0.3, -0.3, 100.0, -100.0)
    assert pid.update(1.0, 0.1) == pytest.approx(-2.0 - 0.3 - 5.0)      # the integral is limited
    assert pid.update(0.5, 0.1) == pytest.approx(-1.0 - 0.3 + 2.5)
    assert WinchPid(2.0).update(1.0, 0.1) == 0.0                        # both limits of the output are 0
    assert WinchPid(2.0, cmd_min=1.0).update(1.0, 0.1) == -2.0          # no limit
