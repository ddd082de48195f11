# SPDX-License-Identifier: BSD-3-Clause
"""Lazy stepping: the same is published, and whatever reads the state finds it up to date."""
import pytest

from conftest import at
from m2wr_sim.plugins.base import Plugin
from m2wr_sim.runtime.forces import Forces
from m2wr_sim.runtime.ports import Ports

MS = 1000000


def run(rig, seconds, lazily, turn_ns=10 * MS):
    """Advance in turns, as the node does."""
    simulator = rig.simulator
    end_ns = simulator.now_ns + int(round(seconds * 1e9))
    while simulator.now_ns < end_ns:
        turn_end_ns = (simulator.now_ns // turn_ns + 1) * turn_ns
        while simulator.now_ns + simulator.step_ns <= turn_end_ns:
            simulator.advance(turn_end_ns, lazily)


def listen(rig, said):
    """Write down everything that is published, in its order."""
    clock = rig.ports.clock
    rig.ports.clock = lambda now_ns: said.append(("clock", now_ns)) or clock(now_ns)
    for topic, port in rig.ports.topics.items():
        port.publish = lambda message, topic=topic: said.append((topic, repr(message)))


@pytest.mark.parametrize("clock_rate", [100.0, 30.0, 1000.0, 0.0])
def test_the_same_is_published_in_the_same_order(m2wr_rig, build, clock_rate):
    runs = []
    for lazily in (False, True):
        can = build.cylinder("can", 0.75, 0.1, 0.25, radius=0.1, length=0.5, static=False, mass=0.2)
        rig, said = m2wr_rig(can, clock_rate=clock_rate), []
        listen(rig, said)
        for linear, angular, seconds in ((0.5, 0.0, 0.43), (0.5, 0.4, 0.5), (0.0, 0.0, 0.1), (-0.3, 0.2, 0.17)):
            rig.send(linear, angular)
            run(rig, seconds, lazily)
        rig.simulator.settle()
        runs.append((said, rig.ports.transforms, rig.pose(), rig.pose("can"), rig.simulator.contact_counts,
                     rig.simulator.steps))
    assert {"clock", "/odom", "/m2wr/laser/scan", "/joint_states"} <= {topic for topic, _ in runs[0][0]}
    assert runs[0][4], "no contact"
    for eager, lazy in zip(*runs):
        assert eager == lazy


def test_bodies_move_only_when_they_are_read(m2wr_rig, monkeypatch):
    rig, counts = m2wr_rig(), []
    for topic, port in rig.ports.topics.items():
        port.listening = topic == "/odom"
    step = rig.engine.step
    monkeypatch.setattr(rig.engine, "step", lambda count: counts.append(count) or step(count))
    run(rig, 1.0, True)
    assert len(rig.ports.clock_ns) == 100 and sum(counts) < 1000 == rig.simulator.steps
    assert max(counts) <= 51 and len(counts) <= 41          # 20 ticks of the drive, and 50 ms at the most
    rig.simulator.settle()
    assert sum(counts) == 1000


def test_after_settling_the_bodies_are_where_they_would_be(m2wr_rig):
    poses = []
    for lazily in (False, True):
        rig = m2wr_rig().send(0.4, 0.3)
        run(rig, 0.3, lazily)
        rig.simulator.advance(337 * MS, lazily)
        rig.simulator.settle()
        poses.append((rig.simulator.now_ns, rig.pose(), rig.rate("joint_left_wheel")))
    assert poses[0] == poses[1]


class Pusher(Plugin):
    """Looks at its model, and puts it somewhere else, when a message comes."""

    def __init__(self, rig):
        self.rig, self.seen = rig, []
        rig.ports.subscribe("/push", str, self.push, "")

    def configure(self, spec, ctx):
        """Nothing to configure."""

    def push(self, message):
        self.seen.append(self.rig.pose("crate"))
        self.rig.simulator.set_model_state("crate", at(z=5.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0))


def test_a_message_that_comes_finds_the_bodies_in_place(make_rig, build):
    found = []
    for lazily in (False, True):
        rig = make_rig(build.box("crate", 0.0, 0.0, 3.0, static=False))
        pusher = Pusher(rig)
        run(rig, 0.23, lazily)
        rig.ports.send("/push", "now")
        run(rig, 0.12, lazily)
        rig.simulator.settle()
        found.append((pusher.seen, rig.pose("crate")))
    assert len(found[0][0]) == 1 and found[0] == found[1]


def test_changes_between_steps_count_from_the_next_step(make_rig, build):
    rig = make_rig(build.box("crate", 0.0, 0.0, 3.0, static=False, mass=2.0))
    forces = Forces(rig.simulator)
    rig.simulator.add_observer(forces, "forces")
    run(rig, 0.1, False)
    forces.push_link(rig.simulator.models["crate"], "link", (4.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, 200 * MS)
    run(rig, 0.3, True)
    rig.simulator.settle()
    speed = rig.simulator.models["crate"].state(rig.engine).linear_velocity[0]
    assert speed == pytest.approx(0.4, abs=1e-9)            # 4 N for 0.2 s on 2 kg


def test_a_listener_that_comes_is_served_within_50_ms(m2wr_rig):
    rig = m2wr_rig()
    scans = rig.ports.topics["/m2wr/laser/scan"]
    scans.listening = False
    run(rig, 0.52, True)
    scans.listening = True
    run(rig, 0.06, True)
    assert len(rig.messages("/m2wr/laser/scan")) >= 1


def test_a_plugin_that_fails_ends_alone(m2wr_rig, caplog):
    class Broken(Plugin):
        calls = 0

        def configure(self, spec, ctx):
            """Nothing to configure."""

        def next_before(self, now_ns):
            return 100 * MS

        def before_step(self, now_ns):
            Broken.calls += 1
            raise RuntimeError("broken")

    rig = m2wr_rig()
    rig.simulator.add_observer(Broken(), "the broken one")
    run(rig, 0.3, True)
    assert Broken.calls == 1 and rig.simulator.steps == 300
    assert "the broken one failed and is switched off" in caplog.text


def test_ports_that_cannot_tell_are_asked_every_time(make_rig, monkeypatch):
    rig = make_rig()
    delivered = []
    monkeypatch.setattr(rig.ports, "waiting", lambda: Ports.waiting(rig.ports))
    monkeypatch.setattr(rig.ports, "deliver", lambda: delivered.append(rig.simulator.now_ns))
    run(rig, 0.1, True)
    assert len(delivered) >= 10
