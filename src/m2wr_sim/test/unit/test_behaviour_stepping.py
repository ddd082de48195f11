# SPDX-License-Identifier: BSD-3-Clause
"""The same requests at the same simulated times give the same messages, however simulated time is advanced.

Random sequences of requests are carried out step by step, in several steps at a time, with lazy stepping, in a random
mixture of these, and through the node's loop.
"""
import io
import random
import zlib
from dataclasses import replace
from types import SimpleNamespace

import pytest
from genpy import Time

from conftest import at
from m2wr_sim.errors import ModelError
from m2wr_sim.plugins.base import Plugin
from m2wr_sim.ros import loop as loop_module
from m2wr_sim.ros.loop import Loop, ShuttingDown, _Request
from m2wr_sim.runtime.changes import set_physics
from m2wr_sim.runtime.entities import find_joint
from m2wr_sim.runtime.forces import Forces

MS = 1000000
TOPICS = ("/odom", "/m2wr/laser/scan", "/joint_states")
WAYS = ("stretches", "lazily", "mixed", "loop")


class Fragile(Plugin):
    """Tells where the can is every 20 ms, and fails at the fifth time."""

    def __init__(self, rig, said):
        self.rig, self.said, self.due_ns, self.left = rig, said, 20 * MS, 5

    def configure(self, spec, ctx):
        """Nothing to configure."""

    def next_before(self, now_ns):
        return self.due_ns

    def before_step(self, now_ns):
        if now_ns < self.due_ns:
            return
        self.due_ns, self.left = now_ns + 20 * MS, self.left - 1
        if not self.left:
            raise RuntimeError("fragile")
        self.said.append(("fragile", now_ns, self.rig.pose("can")))

    def reset(self, now_ns, rewound):
        self.due_ns = now_ns + 20 * MS


# ---- requests: each draws its numbers from ``chance`` ----------------------------------------------------------------

def command(rig, chance):
    rig.send(chance.choice([0.4, -0.3, 30.0, float("nan")]), chance.uniform(-2.0, 2.0))


def push(rig, chance):
    force = [chance.uniform(-5.0, 5.0) for _ in range(6)]
    start_ns = rig.simulator.now_ns + chance.choice([0, 7 * MS, 33333333])
    rig.forces.push_link(rig.simulator.models["can"], "link", force[:3], force[3:], start_ns,
                         chance.choice([-1, 0, 10 * MS, 70 * MS]))


def strain(rig, chance):
    found = find_joint(rig.simulator.models.values(), "joint_left_wheel")
    if found is not None:
        rig.forces.push_joint(*found, effort=chance.uniform(-1.0, 1.0), start_ns=0,
                              duration_ns=chance.randrange(90 * MS))


def put(rig, chance):
    rig.simulator.set_model_state("can", at(chance.uniform(-1.0, 1.0), 0.5, 0.4), (0.3, 0.0, 0.0), (0.0, 0.0, 1.0))


def reset_world(rig, chance):
    rig.simulator.reset_world()


def reset_simulation(rig, chance):
    rig.simulator.reset_simulation()


def other_step(rig, chance):
    step = chance.choice([0.001, 0.005, 0.0003, 0.007])
    set_physics(rig.simulator, replace(rig.simulator.physics, max_step_size=step))


def other_ears(rig, chance):
    for topic in TOPICS:
        if topic in rig.ports.topics:
            rig.ports.topics[topic].listening = chance.random() < 0.6


def delete(rig, chance):
    if "m2wr" in rig.simulator.models:
        rig.simulator.delete("m2wr")


def bring_back(rig, chance):
    try:
        rig.simulator.spawn(rig.robot, at(chance.uniform(-0.3, 0.3), 0.0, 0.1), namespace="/")
    except ModelError:
        return                          # it is there
    listen(rig)


REQUESTS = (command, command, command, push, push, strain, put, reset_world, reset_simulation, other_step, other_step,
            other_ears, delete, bring_back)


def listen(rig):
    """Write down what is published, in its order: the checksum of the bytes that would go out."""
    def note(topic, message):
        data = io.BytesIO()
        message.serialize(data)
        rig.said.append((topic, message.header.stamp, zlib.crc32(data.getvalue())))

    for topic, port in rig.ports.topics.items():
        port.publish = lambda message, topic=topic: note(topic, message)


def script(seed, count=25):
    """Return ``[(time, request, seed of its numbers)]``; time restarts after a reset."""
    chance, time_ns, entries = random.Random(seed), 0, []
    for number in range(count):
        time_ns += chance.choice([0, MS, chance.randrange(30 * MS), chance.randrange(60 * MS)])
        entries.append((time_ns, chance.choice(REQUESTS), 1000 * seed + number))
        time_ns = 0 if entries[-1][1] is reset_simulation else time_ns
    return entries + [(time_ns + 60 * MS, other_ears, seed)]


def carry_out(rig, entry):
    rig.said.append((entry[1].__name__, rig.simulator.now_ns))
    entry[1](rig, random.Random(entry[2]))


def by_hand(rig, entries, way, chance):
    """Advance as far as each request allows, and settle before it wherever the engine may be behind."""
    simulator, lazily = rig.simulator, way == "lazily"
    for entry in entries:
        while simulator.now_ns + simulator.step_ns <= entry[0]:
            steps = {"step by step": 1, "mixed": chance.randrange(1, 80)}.get(way, 10 ** 6)
            if way == "mixed" and chance.random() < 0.2:
                lazily = not lazily
            simulator.advance(min(entry[0], simulator.now_ns + steps * simulator.step_ns), lazily)
        if lazily and entry[1] is not command:
            simulator.settle()
        carry_out(rig, entry)


def through_loop(rig, entries, chance, monkeypatch):
    """Let the node's loop run; requests come when the next step would lead past their times."""
    simulator, waiting = rig.simulator, list(entries)
    loop = Loop(simulator, 0.0, lambda: False, lambda: None)
    advance = simulator.advance

    def advance_to_request(until_ns, lazily=False):
        if not waiting:
            raise ShuttingDown()
        if waiting[0][0] < simulator.now_ns + simulator.step_ns:
            entry = waiting.pop(0)
            loop._put(_Request(lambda: carry_out(rig, entry)))
            return simulator.now_ns
        return advance(min(until_ns, waiting[0][0]), lazily)

    monkeypatch.setattr(simulator, "advance", advance_to_request)
    monkeypatch.setattr(loop_module, "_SAMPLE", 2)
    # on a machine that is never behind: where it is, requests have to wait
    monkeypatch.setattr(loop_module, "time", SimpleNamespace(monotonic=lambda: 0.0, thread_time=lambda: 0.0))
    monkeypatch.setattr(loop, "_choose", lambda: setattr(loop, "_lazily", chance.random() < 0.6))
    loop.run()


def outcome(rig):
    """Return what can be seen of a world at the end."""
    rig.simulator.settle()
    states = [(model.name, link, rig.engine.link_state(number)) for model in rig.simulator.models.values()
              for link, number in model.handle.links.items()]
    angles = [rig.engine.joint_angle(number) for model in rig.simulator.models.values()
              for number in model.handle.joints.values()]
    return (states, angles, rig.simulator.now_ns, rig.simulator.steps, rig.simulator.contacts,
            rig.simulator.contact_counts, rig.ports.transforms)


@pytest.fixture
def live(m2wr_rig, m2wr, build, monkeypatch):
    def live_through(seed, way):
        can = build.cylinder("can", 0.7, 0.1, 0.25, radius=0.1, length=0.5, static=False, mass=0.5)
        rig = m2wr_rig(can, clock_rate=(100.0, 30.0, 1000.0)[seed % 3])
        rig.robot, rig.said, rig.forces = m2wr, [], Forces(rig.simulator)
        rig.ports.moment = lambda now_ns: Time(*divmod(now_ns, 10 ** 9))
        clock = rig.ports.clock
        rig.ports.clock = lambda now_ns: rig.said.append(("clock", now_ns)) or clock(now_ns)
        rig.simulator.add_observer(rig.forces, "forces")
        rig.simulator.add_observer(Fragile(rig, rig.said), "the fragile one")
        listen(rig)
        chance = random.Random(seed)
        with monkeypatch.context() as patch:
            if way == "loop":
                through_loop(rig, script(seed), chance, patch)
            else:
                by_hand(rig, script(seed), way, chance)
        return rig.said, outcome(rig)
    return live_through


@pytest.mark.parametrize("seed", range(8))
def test_what_is_said_and_done_is_the_same(live, seed):
    said, end = live(seed, "step by step")
    assert len(said) > 30 and len({line[0] for line in said}) > 6
    for way in WAYS:
        others, other_end = live(seed, way)
        for number, (one, other) in enumerate(zip(said, others)):
            assert one == other, "%s: differs in line %d" % (way, number)
        assert len(said) == len(others) and end == other_end, way


def test_a_rate_is_kept_when_the_step_changes(m2wr_rig):
    rig = m2wr_rig(clock_rate=100.0)
    rig.run(0.007)
    set_physics(rig.simulator, replace(rig.simulator.physics, max_step_size=0.005))
    rig.run(1.0)
    times = rig.ports.clock_ns[2:]
    assert {after - before for before, after in zip(times, times[1:])} == {10 * MS}
    for topic in TOPICS:
        stamps = rig.stamps_ms(topic)
        assert abs(len(stamps) - (50 if topic == "/joint_states" else 20)) <= 1, topic
