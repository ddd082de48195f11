# SPDX-License-Identifier: BSD-3-Clause
"""States of models in the simulator: setting them, reference frames, the stored state of a world, resets."""
import math
from dataclasses import replace

import pytest

from conftest import at
from m2wr_sim.errors import ModelError, NotFoundError
from m2wr_sim.geometry import quaternion_from_rpy, rotate, rpy_from_quaternion, yaw_of
from m2wr_sim.model.types import Box, ModelStateEntry, World, WorldState

MS = 1000000
REST = (0.0, 0.0, 0.0)


def test_setting_a_state_in_the_world(m2wr_rig):
    rig = m2wr_rig(wheel_convention="kinetic").send(0.5, 0.0).run(1.0)
    angle = rig.engine.joint_angle(rig.simulator.models["m2wr"].handle.joints["joint_left_wheel"])
    pose = ((3.0, -2.0, 0.1), quaternion_from_rpy(0.0, 0.0, 1.2))
    rig.simulator.set_model_state("m2wr", pose, (0.1, 0.2, 0.0), (0.0, 0.0, 0.3))
    position, orientation = rig.pose()
    assert position == pytest.approx(pose[0]) and orientation == pytest.approx(pose[1])
    model = rig.simulator.models["m2wr"]
    assert rig.engine.joint_angle(model.handle.joints["joint_left_wheel"]) == pytest.approx(angle)
    for link in model.handle.links.values():
        assert rig.engine.link_state(link).angular_velocity == pytest.approx((0.0, 0.0, 0.3))
    wheel = rig.engine.link_state(model.handle.links["link_left_wheel"])
    assert wheel.linear_velocity == pytest.approx((0.1, 0.2, 0.0))
    wheel_offset = rotate(pose[1], (-0.05, -0.2, 0.0))
    assert wheel.position == pytest.approx(tuple(a + b for a, b in zip(pose[0], wheel_offset)), abs=1e-5)
    rig.simulator.set_model_state("m2wr", pose, REST, REST)
    assert rig.rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("frame", ["base", "base::link", "link"])
def test_states_in_another_frame(make_rig, build, frame):
    rig = make_rig(world=World(models=(
        build.one_link("base", Box((0.1,) * 3), ((1.0, 2.0, 3.0), quaternion_from_rpy(0.0, 0.0, math.pi / 2)),
                       static=False, gravity=False),
        build.box("body", 0, 0, 9, size=(0.1,) * 3, static=False, gravity=False))))
    rig.simulator.set_model_state("base", rig.pose("base"), (0.5, 0.0, 0.0), (0.0, 0.0, 0.1))
    rig.simulator.set_model_state("body", ((2.0, 0.0, 1.0), quaternion_from_rpy(0, 0, 0.3)), (1.0, 0.0, 0.0),
                                  (0.2, 0, 0), frame)
    world = rig.simulator.model_state("body")
    assert world.position == pytest.approx((1.0, 4.0, 4.0))
    assert yaw_of(world.orientation) == pytest.approx(math.pi / 2 + 0.3)
    # turned into the world, the frame's own not added
    assert world.linear == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert world.angular == pytest.approx((0.0, 0.2, 0.0), abs=1e-12)
    seen = rig.simulator.model_state("body", frame)
    assert seen.position == pytest.approx((2.0, 0.0, 1.0)) and yaw_of(seen.orientation) == pytest.approx(0.3)
    # the difference, without the turning's share
    assert seen.linear == pytest.approx((1.0, 0.5, 0.0), abs=1e-12)
    assert seen.angular == pytest.approx((0.2, 0.0, -0.1), abs=1e-12)


@pytest.mark.parametrize("frame", ["", "world", "map", "/map"])
def test_names_of_the_world_itself(m2wr_rig, frame):
    simulator = m2wr_rig(pose=at(1.0, 2.0, 0.1)).simulator
    assert simulator.frame_state(frame) is None
    assert simulator.model_state("m2wr", frame).position == pytest.approx((1.0, 2.0, 0.1))


@pytest.mark.parametrize("frame", ["odom", "default", "m2wr::sensor_laser"])
def test_unknown_frames_are_refused(m2wr_rig, frame):
    simulator = m2wr_rig().simulator
    for call in (lambda: simulator.model_state("m2wr", frame), lambda: simulator.pose_in_world(at(), frame),
                 lambda: simulator.set_model_state("m2wr", at(5.0), REST, REST, frame)):
        with pytest.raises(NotFoundError) as caught:
            call()
        assert "\"%s\"" % frame in str(caught.value) and "ground_plane, m2wr" in str(caught.value)
    assert simulator.model_state("m2wr").position == pytest.approx((0.0, 0.0, 0.1))


def test_quaternions_are_normalised_and_zero_means_upright(m2wr_rig, m2wr):
    rig = m2wr_rig(pose=((1.0, 0.0, 0.1), (0.0, 0.0, 0.0, 0.0)))
    assert rig.pose()[1] == pytest.approx((0, 0, 0, 1))
    rig.simulator.set_model_state("m2wr", ((0, 0, 0.1), (0.0, 0.0, 3.0, 3.0)), REST, REST)
    assert rig.pose()[1] == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))
    assert rig.run(0.5).pose()[0][2] == pytest.approx(0.0999, abs=1e-3)


def test_joints_can_be_set(m2wr_rig):
    rig = m2wr_rig()
    joint = rig.simulator.models["m2wr"].handle.joints["joint_left_wheel"]
    rig.simulator.set_joint_positions("m2wr", {"joint_left_wheel": 7.5, "elbow": 1.0})
    assert rig.engine.joint_angle(joint) == 7.5
    assert rig.run(0.2).engine.joint_angle(joint) == pytest.approx(7.5, abs=1e-3)


# -- stored state of a world --------------------------------------------------------------------------------------

def test_the_stored_state_of_a_world_is_applied_until_reset(make_rig, build, caplog):
    crate, ball = build.box("crate", 0, 0, 0.25, static=False), build.sphere("ball", 5, 0, 0.25, static=False)
    state = WorldState(1183639000000, (
        ModelStateEntry("crate", at(2.0, 1.0, 0.25, 0.5)), ModelStateEntry("ghost", at()),
        ModelStateEntry("ball", None, (("link", at(6.0, 0.0, 3.0), ((0.5, 0.0, 0.0), (0, 0, 1.0))),
                                       ("lid", at(), None)))))
    rig = make_rig(world=World(models=(build.ground(), crate, ball), state=state))
    assert rig.simulator.now_ns == 1183639000000
    assert rig.pose("crate")[0] == (2.0, 1.0, 0.25) and yaw_of(rig.pose("crate")[1]) == pytest.approx(0.5)
    assert rig.simulator.model_state("ball").linear == pytest.approx((0.5, 0.0, 0.0))
    assert "\"ghost\"" in caplog.text and "\"ball::lid\"" in caplog.text
    rig.run(0.1)
    assert rig.ports.clock_ns[0] == 1183640000000 and rig.pose("ball")[0][0] == pytest.approx(6.05)
    rig.simulator.reset_world()
    assert rig.simulator.now_ns == 1183739000000
    assert rig.pose("crate")[0] == pytest.approx((0.0, 0.0, 0.25))
    assert rig.pose("ball")[0] == pytest.approx((5.0, 0.0, 0.25))
    rig.simulator.reset_simulation()
    assert rig.simulator.now_ns == 0 and rig.run(0.01).ports.clock_ns[-1] == MS


def test_unsupported_parts_of_a_world_are_reported(make_rig, build, caplog):
    feather = build.one_link("feather", Box((0.1,) * 3), at(), static=False, mass=1e-30)
    state = WorldState(0, (ModelStateEntry("crate", at(1e300)), ModelStateEntry("ball", None, (
        ("link", None, ((1e300, 0.0, 0.0), (0.0, 0.0, 0.0))),))))
    far = build.one_link("far", Box((0.1,) * 3), at())
    far = replace(far, links=(replace(far.links[0], pose=at(1e300)),))
    rig = make_rig(world=World(models=(feather, far, build.box("crate", 0, 0, 0.25, static=False),
                                       build.sphere("ball", 5, 0, 0.25, static=False)), state=state,
                               remarks=("a.world: quiet",)))
    assert list(rig.simulator.models) == ["crate", "ball"]
    errors = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert ['"feather" is left out' in errors[0], "far::link" in errors[1] and '"far" is left out' in errors[1],
            '"crate"' in errors[2], "velocity" in errors[3]] == [True] * 4
    rig.run(0.01)
    assert rig.pose("crate")[0][:2] == pytest.approx((0.0, 0.0))


# -- resets -------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("rewound", [False, True])
def test_resets(m2wr_rig, build, rewound):
    start = at(1.0, 2.0, 0.1, 0.7)
    rig = m2wr_rig(build.box("crate", 3, 0, 0.25, static=False), build.box("post", 5, 0, 0.25), pose=start)
    rig.send(0.5, 0.4).run(3.0)
    for name in ("crate", "post"):
        rig.simulator.set_model_state(name, at(8.0, 8.0, 0.25, 1.0), (0.1, 0, 0), REST)
    joints = rig.simulator.models["m2wr"].handle.joints.values()
    angles = [rig.engine.joint_angle(joint) for joint in joints]
    assert min(angles) > 5.0
    rig.simulator.reset_simulation() if rewound else rig.simulator.reset_world()
    assert (rig.simulator.now_ns, rig.simulator.steps) == ((0, 0) if rewound else (3000 * MS, 3000))
    for name, pose in (("m2wr", start), ("crate", at(3, 0, 0.25)), ("post", at(5, 0, 0.25))):
        position, orientation = rig.pose(name)
        assert position == pytest.approx(pose[0]) and rpy_from_quaternion(orientation) == pytest.approx(
            rpy_from_quaternion(pose[1]), abs=1e-9)
        state = rig.simulator.model_state(name)
        assert state.linear == pytest.approx(REST, abs=1e-12) and state.angular == REST
    assert [rig.engine.joint_angle(joint) for joint in joints] == pytest.approx([0.0, 0.0] if rewound else angles)
    assert [rig.engine.joint_rate(joint) for joint in joints] == pytest.approx([0.0, 0.0])
    rig.run(0.5)
    expected = [0.0, 0.0] if rewound else angles
    assert [rig.engine.joint_angle(joint) for joint in joints] == pytest.approx(expected, abs=0.5)
    assert rig.ports.clock_ns[-1] == (491 if rewound else 3491) * MS


def test_a_reset_run_is_the_first_run_again(m2wr_rig, build):
    rig, runs = m2wr_rig(build.box("crate", 1.0, 0.0, 0.15, size=(0.3,) * 3, static=False), seed=4), []
    for _ in range(3):
        counts = {topic: len(port.messages) for topic, port in rig.ports.topics.items()}
        rig.send(0.5, 0.2).run(3.0).send(0.0, 0.0).run(0.3)     # stopped: motors keep their target over a reset
        runs.append((rig.pose(), rig.pose("crate"), {
            topic: [str(message) for message in port.messages[counts[topic]:]]
            for topic, port in rig.ports.topics.items()}))
        rig.simulator.reset_simulation()
    assert runs[0] == runs[1] == runs[2]


@pytest.mark.parametrize("paused", [False, True])
def test_resets_keep_the_pause_and_the_models(m2wr_rig, build, paused):
    rig = m2wr_rig()
    rig.simulator.spawn(build.box("late", 2, 0, 0.5), at(2, 0, 0.5))
    rig.simulator.paused = paused
    for reset in (rig.simulator.reset_world, rig.simulator.reset_simulation):
        reset()
        assert rig.simulator.paused is paused and list(rig.simulator.models) == ["ground_plane", "m2wr", "late"]


def test_positions_and_velocities_out_of_bounds_are_refused(make_rig, build):
    simulator, thing = make_rig().simulator, build.sphere("thing", 0.0, 0.0, 1.0, static=False)
    with pytest.raises(ModelError, match="from the origin"):
        simulator.spawn(thing, at(1e7), "far")
    simulator.spawn(thing, at(), "near")
    with pytest.raises(ModelError, match="expected at most"):
        simulator.set_model_state("near", at(), REST, (0.0, 0.0, 1e12))
    with pytest.raises(ModelError, match="from the origin"):
        simulator.set_model_state("near", at(0.0, -1e9), REST, REST)
