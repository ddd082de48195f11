# SPDX-License-Identifier: BSD-3-Clause
"""The simulator: the order of events in a step, simulated time, adding and deleting models."""
import gc
import weakref
from dataclasses import replace

import pytest

from conftest import at
from m2wr_sim.errors import ModelError, NotFoundError
from m2wr_sim.model.types import PluginSpec
from trace_plugin import MS

REST = (0.0, 0.0, 0.0)


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
        rig.simulator.spawn(build.box("crate", 0.6, 0.1, 0.2, size=(0.3,) * 3, static=False), at(0.6, 0.1, 0.2))
        for linear, angular in ((0.5, 0.1), (-0.3, 0.8), (0.6, 0.0)):
            rig.send(linear, angular).run(0.8, chunk_ns)
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
