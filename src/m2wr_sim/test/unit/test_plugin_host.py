# SPDX-License-Identifier: BSD-3-Clause
"""Plugins in a simulation: starting, messages, resets, and what happens to one that raises an exception."""
import logging
from dataclasses import replace

import pytest

from m2wr_sim.model.types import PluginSpec, World
from trace_plugin import MS, Trace


def errors(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]


def test_only_the_newest_message_is_delivered(traced):
    rig, calls = traced()
    rig.ports.send("/orders", "old")
    rig.ports.send("/orders", "new")
    rig.run(0.002)
    assert [call for call in calls if call[0] == "order"] == [("order", "new")]


def test_unknown_plugins_and_notes_are_named(make_rig, build, caplog):
    record = replace(build.box("b", 0, 0, 1), notes=("line 3: <x> is not read.",),
                     plugins=(PluginSpec("p", "libmystery.so", where="b.sdf:7: plugin \"p\""),))
    world_plugin = PluginSpec("w", "libworld.so", where="a.world:2")
    make_rig(world=World(models=(record,), plugins=(world_plugin,), notes=("a.world:9: <y> is not read.",)))
    text = caplog.text
    for words in ("b: line 3: <x> is not read.", "libmystery.so", "b.sdf:7", "libworld.so",
                  "a.world:9: <y> is not read."):
        assert words in text


def test_plugins_hear_which_reset_it_was(traced):
    rig, calls = traced()
    rig.run(0.005)
    rig.simulator.reset_world()
    rig.simulator.reset_simulation()
    assert calls[-2:] == [("reset", 5), ("rewound", 0)]


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
