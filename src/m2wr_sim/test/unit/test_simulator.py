# SPDX-License-Identifier: BSD-3-Clause
"""The order of events in a step, models coming and going, states and frames, resets, and plugins that fail."""
import gc
import logging
import math
import weakref
from dataclasses import replace

import pytest

from conftest import at
from m2wr_sim.errors import ModelError, NotFoundError
from m2wr_sim.geometry import quaternion_from_rpy, rotate, rpy_from_quaternion, yaw_of
from m2wr_sim.model.types import Box, ModelStateEntry, PluginSpec, World, WorldState
from m2wr_sim.plugins.base import Plugin

MS = 1000000
REST = (0.0, 0.0, 0.0)


class Trace(Plugin):
    """Writes down when it is called; acts before every step and after every third."""

    calls, fails_in = [], ()

    def _note(self, name, now_ns):
        self.calls.append((name, now_ns // MS))
        if name in self.fails_in:
            raise RuntimeError("broken in %s" % name)

    def configure(self, spec, ctx):
        self._ctx = ctx
        self._port = ctx.advertise("/trace", str)
        ctx.subscribe("/orders", str, self._order)
        self._note("configure", ctx.now_ns)

    def _order(self, message):
        self.calls.append(("order", message))
        if "order" in self.fails_in:
            raise RuntimeError("broken in order")

    def next_before(self, now_ns):
        if "next_before" in self.fails_in:
            self._note("next_before", now_ns)
        return now_ns + self._ctx.step_ns

    def before_step(self, now_ns):
        self._note("before", now_ns)

    def next_after(self, now_ns):
        if "next_after" in self.fails_in:
            self._note("next_after", now_ns)
        return (now_ns // (3 * MS) + 1) * 3 * MS

    def after_step(self, now_ns):
        self._note("after", now_ns)

    def reset(self, now_ns, rewound):
        self._note("rewound" if rewound else "reset", now_ns)

    def close(self):
        self._note("close", 0)


@pytest.fixture
def traced(make_rig, build, monkeypatch):
    """Return a function that makes a rig with a box whose plugin traces its calls, and the list of them."""
    def make(fails_in=(), **options):
        calls = []
        plugin = type("Trace", (Trace,), {"calls": calls, "fails_in": tuple(fails_in)})
        monkeypatch.setattr("m2wr_sim.runtime.simulator.find_plugin", {"trace.so": plugin}.get)
        rig = make_rig(**options)
        crate = build.box("crate", 0.0, 0.0, 0.25, static=False)
        rig.simulator.spawn(replace(crate, plugins=(PluginSpec("t", "trace.so", where="here"),)), crate.pose)
        return rig, calls
    return make


def errors(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]


# -- order and time -----------------------------------------------------------------------------------------------

def test_a_step_goes_deliver_clock_before_bodies_after(traced, monkeypatch):
    rig, calls = traced(clock_rate=0.0)
    step = rig.engine.step
    monkeypatch.setattr(rig.engine, "step", lambda count: calls.append(("bodies", count)) or step(count))
    monkeypatch.setattr(rig.ports, "clock", lambda now_ns: calls.append(("clock", now_ns // MS)))
    rig.ports.send("/orders", "go")
    rig.run(0.003)
    assert [call for call in calls if call[0] not in ("configure", "after")] == [
        ("order", "go"), ("clock", 1), ("before", 1), ("bodies", 1), ("clock", 2), ("before", 2), ("bodies", 1),
        ("clock", 3), ("before", 3), ("bodies", 1)]
    assert calls[-1] == ("after", 3)


def test_only_the_newest_message_is_delivered(traced):
    rig, calls = traced()
    rig.ports.send("/orders", "old")
    rig.ports.send("/orders", "new")
    rig.run(0.002)
    assert [call for call in calls if call[0] == "order"] == [("order", "new")]


def test_the_engine_runs_on_between_events(make_rig, monkeypatch):
    rig, counts = make_rig(), []
    step = rig.engine.step
    monkeypatch.setattr(rig.engine, "step", lambda count: counts.append(count) or step(count))
    rig.run(0.1)
    assert counts == [10] * 10 and rig.ports.clock_ns == [MS * (1 + 10 * k) for k in range(10)]


@pytest.mark.parametrize("rate, times", [(100.0, [1, 11, 21, 31]), (0.0, list(range(1, 35))),
                                         (1000.0, list(range(1, 35))), (30.0, [1, 35])])
def test_the_clock_keeps_its_rate(make_rig, rate, times):
    assert [now_ns // MS for now_ns in make_rig(clock_rate=rate).run(0.035).ports.clock_ns][:len(times)] == times


def test_time_never_passes_what_was_asked_for(make_rig):
    simulator = make_rig(step_ms=2).simulator
    assert simulator.advance(MS) == 0
    assert simulator.advance(3 * MS) == 2 * MS
    assert simulator.advance(2 * MS) == 2 * MS
    while simulator.now_ns < 8 * MS:
        simulator.advance(9 * MS)
    assert simulator.advance(9 * MS) == 8 * MS and simulator.steps == 4


def test_a_paused_world_does_not_move(m2wr_rig):
    rig = m2wr_rig().send(0.5, 0.0).run(0.5)
    before, count = rig.pose(), len(rig.messages("/odom"))
    rig.simulator.paused = True
    assert rig.simulator.advance(10 ** 10) == 500 * MS
    assert rig.pose() == before and len(rig.messages("/odom")) == count
    rig.simulator.paused = False
    assert rig.run(0.5).pose()[0][0] > before[0][0] + 0.1


@pytest.mark.parametrize("step_ms", [1, 5])
def test_the_length_of_batches_changes_nothing(m2wr_rig, build, step_ms):
    results = []
    for chunk_ns in (step_ms * MS, 10 * MS, 10 ** 15):
        rig = m2wr_rig(build.box("wall", 2.0, 0.0, 0.5, size=(0.2, 4.0, 1.0)), step_ms=step_ms,
                       wheel_convention="kinetic")
        rig.simulator.spawn(build.box("crate", 1.0, 0.1, 0.2, size=(0.3,) * 3, static=False), at(1.0, 0.1, 0.2))
        for linear, angular in ((0.5, 0.1), (-0.3, 0.8), (0.6, 0.0)):
            rig.send(linear, angular).run(1.5, chunk_ns)
        published = {topic: [str(message) for message in port.messages] for topic, port in rig.ports.topics.items()}
        results.append((rig.pose(), rig.pose("crate"), published, rig.ports.transforms, rig.ports.clock_ns,
                        rig.simulator.contacts, rig.simulator.contact_counts))
    assert results[0] == results[1] == results[2]
    assert results[0][5] and all(results[0][2].values())


# -- models -------------------------------------------------------------------------------------------------------

def test_models_keep_load_order_and_a_respawned_one_is_last(make_rig, build):
    rig = make_rig(build.box("a", 1, 0, 1), build.box("b", 2, 0, 1))
    rig.simulator.spawn(build.box("x", 3, 0, 1), at(3, 0, 1), "c")
    assert list(rig.simulator.models) == ["ground_plane", "a", "b", "c"]
    rig.simulator.delete("a")
    rig.simulator.spawn(build.box("a", 1, 0, 1), at(1, 0, 1))
    assert list(rig.simulator.models) == ["ground_plane", "b", "c", "a"]


def test_a_name_that_is_taken_is_refused(m2wr_rig, m2wr):
    rig = m2wr_rig()
    with pytest.raises(ModelError) as caught:
        rig.simulator.spawn(m2wr, at(5.0))
    assert "\"m2wr\" is already in the world" in str(caught.value)
    assert rig.run(0.06).pose()[0][0] == pytest.approx(0.0, abs=1e-3) and len(rig.messages("/odom")) == 1


def test_a_model_that_cannot_be_built_leaves_no_trace(make_rig, build):
    rig, bad = make_rig(), build.box("bad", 0, 0, 1, static=False)
    bad = replace(bad, links=bad.links + (replace(bad.links[0], name="l2",
                                                  inertial=replace(bad.links[0].inertial, mass=-1)),))
    rows = len(rig.simulator.scene)
    with pytest.raises(ModelError) as caught:
        rig.simulator.spawn(bad, bad.pose)
    assert "bad::l2" in str(caught.value)
    assert list(rig.simulator.models) == ["ground_plane"] and len(rig.simulator.scene) == rows
    rig.simulator.spawn(build.box("bad", 0, 0, 1, static=False), at(z=1.0))
    assert rig.run(1.0).pose("bad")[0][2] == pytest.approx(0.25, abs=1e-2)


def test_a_model_without_links_is_refused(make_rig, build):
    with pytest.raises(ModelError) as caught:
        make_rig().simulator.spawn(replace(build.box("empty", 0, 0, 0), links=()), at())
    assert "\"empty\" has no links" in str(caught.value)


def test_what_is_deleted_is_gone_and_can_come_back(m2wr_rig, m2wr):
    rig = m2wr_rig(wheel_convention="kinetic").send(0.5, 0.0).run(1.0)
    rows = len(rig.simulator.scene)
    for turn in range(3):
        rig.simulator.delete("m2wr")
        assert list(rig.simulator.models) == ["ground_plane"] and len(rig.simulator.scene) == 1
        assert not any(port.listening for port in rig.ports.topics.values())
        rig.run(0.2)
        rig.simulator.spawn(m2wr, at(0.0, turn, 0.1), namespace="/")
        assert len(rig.simulator.scene) == rows and rig.messages("/odom") == []
        rig.run(0.3)
        assert rig.pose()[0][:2] == pytest.approx((0.0, turn), abs=1e-3)        # at rest: no old command
        rig.send(0.0, 0.5).run(1.0)
        assert rig.messages("/odom")[-1].twist.twist.angular.z == pytest.approx(0.5, rel=1e-2)


def test_what_is_deleted_needs_no_garbage_collector(m2wr_rig):
    """After a long text was spawned all objects are put aside from collections; a circle of them would stay."""
    rig = m2wr_rig().run(0.1)
    model = rig.simulator.models["m2wr"]
    parts = [weakref.ref(part) for part in [model] + [plugin for plugin, _, _ in model.plugins]]
    del model
    gc.collect()
    gc.disable()
    try:
        rig.simulator.delete("m2wr")
        rig.run(0.1)
        rig.ports.topics.clear()
        assert len(parts) == 4 and not any(part() for part in parts)
    finally:
        gc.enable()


def test_unknown_models_are_named_with_those_there_are(m2wr_rig):
    simulator = m2wr_rig().simulator
    for call in (simulator.delete, simulator.model_state,
                 lambda name: simulator.set_model_state(name, at(), REST, REST),
                 lambda name: simulator.set_joint_positions(name, {})):
        with pytest.raises(NotFoundError) as caught:
            call("ghost")
        assert "\"ghost\" does not exist" in str(caught.value) and "ground_plane, m2wr" in str(caught.value)


def test_contacts_of_moving_models_are_stored_and_counted(m2wr_rig, build):
    rig = m2wr_rig(build.box("wall", -1.0, 0.0, 0.5, size=(0.2, 4.0, 1.0)))
    rig.simulator.spawn(build.box("crate", 1.0, 0.0, 0.2, size=(0.3,) * 3, static=False), at(1.0, 0.0, 0.15))
    assert rig.run(1.0).simulator.contacts == []             # standing on the ground is none
    rig.send(0.3, 0.0).run(4.0).send(-0.5, 0.0).run(6.0)
    assert set(rig.simulator.contact_counts) == {"m2wr", "crate"}
    sides = [{contact.first.split("::")[0], contact.second.split("::")[0]} for contact in rig.simulator.contacts]
    assert {"m2wr", "crate"} in sides and {"m2wr", "wall"} in sides
    assert rig.simulator.contact_counts["m2wr"] == sum("m2wr" in side for side in sides)
    rig.simulator.reset_simulation()
    assert rig.simulator.contacts == [] and rig.simulator.contact_counts == {}


def test_unknown_plugins_and_notes_are_named(make_rig, build, caplog):
    record = replace(build.box("b", 0, 0, 1), notes=("line 3: <x> is not read.",),
                     plugins=(PluginSpec("p", "libmystery.so", where="b.sdf:7: plugin \"p\""),))
    world_plugin = PluginSpec("w", "libworld.so", where="a.world:2")
    make_rig(world=World(models=(record,), plugins=(world_plugin,), notes=("a.world:9: <y> is not read.",)))
    text = caplog.text
    for words in ("b: line 3: <x> is not read.", "libmystery.so", "b.sdf:7", "libworld.so",
                  "a.world:9: <y> is not read."):
        assert words in text


# -- states and frames --------------------------------------------------------------------------------------------

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


# -- a world's stored state ---------------------------------------------------------------------------------------

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


def test_plugins_hear_which_reset_it_was(traced):
    rig, calls = traced()
    rig.run(0.005)
    rig.simulator.reset_world()
    rig.simulator.reset_simulation()
    assert calls[-2:] == [("reset", 5), ("rewound", 0)]


# -- plugins that fail --------------------------------------------------------------------------------------------

@pytest.mark.parametrize("place", ["before", "after", "next_before", "next_after", "reset"])
def test_a_plugin_that_raises_is_named_and_switched_off(traced, m2wr, caplog, place):
    rig, calls = traced(fails_in=[place])
    rig.run(0.01)
    if place == "reset":
        rig.simulator.reset_world()
    rig.run(0.01)
    message, = errors(caplog)
    assert "crate: plugin t (trace.so) failed and is switched off" in message and "broken in %s" % place in caplog.text
    assert [name for name, _ in calls].count(place) == 1 and [name for name, _ in calls].count("close") == 1
    assert calls[-1][0] == "close" and not rig.ports.topics["/trace"].listening
    assert not rig.ports.subscriptions["/orders"].open
    assert rig.simulator.now_ns == 20 * MS
    rig.simulator.delete("crate")
    assert [name for name, _ in calls].count("close") == 1      # closed once, not again


def test_a_plugin_that_raises_is_reported_and_disabled(traced, caplog):
    rig, calls = traced(fails_in=["order"])
    rig.run(0.01)
    rig.ports.send("/orders", "fire")
    rig.run(0.01)
    message, = errors(caplog)
    assert "crate: plugin t (trace.so) failed and is switched off" in message and "broken in order" in caplog.text
    assert rig.simulator.now_ns == 20 * MS and not rig.ports.subscriptions["/orders"].open
    assert calls[-2:] == [("order", "fire"), ("close", 0)]


def test_a_plugin_that_cannot_start_is_named_and_the_model_stays(traced, caplog):
    rig, calls = traced(fails_in=["configure"])
    assert "crate: plugin t (trace.so) failed to start" in errors(caplog)[0]
    rig.run(0.05)
    assert calls == [("configure", 0)] and "crate" in rig.simulator.models
    assert not rig.ports.topics["/trace"].listening


def test_a_plugin_that_cannot_close_does_not_keep_its_model(traced, caplog):
    rig, _ = traced(fails_in=["close"])
    rig.run(0.01)
    rig.simulator.delete("crate")
    assert "failed while closing" in errors(caplog)[0]
    assert "crate" not in rig.simulator.models and not rig.ports.topics["/trace"].listening


def test_an_observer_that_raises_is_named_and_dropped(make_rig, caplog):
    rig = make_rig()
    observer = type("Observer", (Trace,), {"calls": [], "fails_in": ("before",), "_ctx": rig.simulator})()
    rig.simulator.add_observer(observer, "state topics")
    rig.run(0.01)
    assert "state topics failed and is switched off" in errors(caplog)[0] and rig.simulator.observers == []
    assert [name for name, _ in observer.calls].count("before") == 1


def test_closing_closes_every_plugin(traced):
    rig, calls = traced()
    rig.simulator.close()
    assert calls[-1][0] == "close" and not rig.ports.topics["/trace"].listening


@pytest.mark.parametrize("name", ["ns::ball", "::"])
def test_a_name_that_would_be_taken_for_a_link_is_refused(make_rig, build, name):
    simulator = make_rig().simulator
    with pytest.raises(ModelError, match="cannot be the name of a model"):
        simulator.spawn(build.sphere("thing", 0.0, 0.0, 1.0, static=False), at(), name)
    assert name not in simulator.models


def test_a_spawn_that_fails_half_way_leaves_nothing_behind(make_rig, build, monkeypatch):
    simulator = make_rig().simulator
    before, thing = len(simulator.scene), build.sphere("thing", 0.0, 0.0, 1.0, static=False)
    with monkeypatch.context() as patch:
        patch.setattr(simulator, "plugin_class", lambda filename: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            simulator.spawn(replace(thing, plugins=(PluginSpec("p", "libany.so"),)), at())
    assert "thing" not in simulator.models and len(simulator.scene) == before
    simulator.spawn(thing, at())


def test_positions_and_velocities_out_of_bounds_are_refused(make_rig, build):
    simulator, thing = make_rig().simulator, build.sphere("thing", 0.0, 0.0, 1.0, static=False)
    with pytest.raises(ModelError, match="from the origin"):
        simulator.spawn(thing, at(1e7), "far")
    simulator.spawn(thing, at(), "near")
    with pytest.raises(ModelError, match="expected at most"):
        simulator.set_model_state("near", at(), REST, (0.0, 0.0, 1e12))
    with pytest.raises(ModelError, match="from the origin"):
        simulator.set_model_state("near", at(0.0, -1e9), REST, REST)
