# SPDX-License-Identifier: BSD-3-Clause
"""What the simulation says about itself, on a simulator that a test plays."""
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from m2wr_node.internals.subscriber_connections import Dropped
from m2wr_sim.physics.engine import ContactEvent
from m2wr_sim.ros import diagnostics
from m2wr_sim.ros.diagnostics import Diagnostics

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class FakePort:
    """A topic."""

    def __init__(self):
        self.listened, self.messages = True, []

    def wanted(self):
        return self.listened

    def publish(self, message):
        self.messages.append(message)


class FakePorts:
    """Ports of which only the traffic is known."""

    def __init__(self):
        self.port, self.sent, self.lost = FakePort(), {"/scan": (0, 1), "/odom": (0, 0)}, []

    def advertise(self, topic, *_):
        assert topic == "/diagnostics"
        return self.port

    def traffic(self):
        return dict(self.sent)

    def dropped(self):
        return list(self.lost)


class FakePlugin:
    """A plugin with a rhythm of 20 Hz."""

    def period_ns(self):
        return 50000000


class FakeContext:
    """A plugin's context with one topic."""

    def topics(self):
        return ["/scan"]


class FakeSimulator:
    """A simulator with one robot."""

    def __init__(self):
        self.now_ns, self.steps, self.step_ns, self.paused = 0, 0, 1000000, False
        self.engine = type("Engine", (), {"solver_messages": 0})()
        self.models = {"robot": type("Model", (), {"plugins": [(FakePlugin(), FakeContext(), "laser")]})()}
        self.contacts, self.contact_counts, self.off, self.ports = [], {"robot": 0}, [], FakePorts()

    def switched_off(self):
        return self.off


class FakeLockstep:
    """Lockstep as it stands."""

    def __init__(self):
        self.answer = (True, 7, 0.25, [], [])

    def status(self):
        return self.answer


class Rig:
    """The diagnostics of a fake simulator, with a clock that a test moves."""

    def __init__(self, monkeypatch, factor=1.0, lockstep=None):
        self.wall, self.simulator = 100.0, FakeSimulator()
        monkeypatch.setattr(diagnostics.time, "monotonic", lambda: self.wall)
        monkeypatch.setattr(rospy, "logwarn", lambda *_: None)
        self.told = Diagnostics(self.simulator, factor, lockstep)
        self.messages = self.simulator.ports.port.messages

    def run(self, wall=1.0, simulated=1.0, scans=20):
        self.wall += wall
        self.simulator.now_ns += int(simulated * 1e9)
        self.simulator.steps += int(simulated * 1e3)
        count, listeners = self.simulator.ports.sent["/scan"]
        self.simulator.ports.sent["/scan"] = (count + scans, listeners)
        self.told.turn()

    def newest(self):
        simulation, topics = self.messages[-1].status
        return simulation, topics, {pair.key: pair.value for status in (simulation, topics) for pair in status.values}


def test_two_statuses_a_second_of_wall_time(monkeypatch):
    rig = Rig(monkeypatch)
    for _ in range(40):
        rig.run(0.1, 0.1, 2)
    assert 3 <= len(rig.messages) <= 4
    simulation, topics, values = rig.newest()
    assert (simulation.name, topics.name) == ("m2wr_sim: simulation", "m2wr_sim: topics")
    assert simulation.level == topics.level == OK
    assert values["real-time factor"] == "1.00" and values["steps per second"] == "1000"
    assert values["/scan"] == "20.0 Hz, 20 Hz asked, 1 subscribers" and values["/odom"] == "not sent, 0 subscribers"
    assert float(values["peak memory [MB]"]) > 1.0


def test_nothing_is_built_without_a_subscriber(monkeypatch):
    rig = Rig(monkeypatch)
    rig.simulator.ports.port.listened = False
    monkeypatch.setattr(rig.told, "_simulation", lambda *_: pytest.fail("built without a subscriber"))
    rig.run()
    assert rig.messages == []


@pytest.mark.parametrize("change, level, words", [
    (lambda s: s.off.append("m2wr: laser"), ERROR, "m2wr: laser"),
    (lambda s: setattr(s, "paused", True), OK, "paused"),
    (lambda s: setattr(s.engine, "solver_messages", 50), WARN, "50 messages"),
    (lambda s: s.ports.lost.append(Dropped("/scan", "/slow", 9)), WARN, "9 messages dropped")])
def test_judgement_of_the_simulation(monkeypatch, change, level, words):
    rig = Rig(monkeypatch)
    change(rig.simulator)
    rig.run()
    simulation, _, _ = rig.newest()
    assert simulation.level == level and words in simulation.message


def test_who_loses_messages_is_named(monkeypatch):
    rig = Rig(monkeypatch)
    rig.simulator.ports.lost.append(Dropped("/scan", "/slow", 9))
    rig.run()
    assert rig.newest()[2]["dropped on /scan for /slow"] == "9"


def test_slow_time_is_told(monkeypatch):
    rig = Rig(monkeypatch)
    rig.run(1.0, 0.5, 10)
    assert rig.newest()[0].level == WARN and "0.50 instead of 1" in rig.newest()[0].message
    assert rig.newest()[1].level == OK          # rates are of simulated time


def test_a_topic_below_its_rate_is_told(monkeypatch):
    rig = Rig(monkeypatch)
    rig.run(2.0, 2.0, 40)
    rig.run(2.0, 2.0, 20)
    _, topics, _ = rig.newest()
    assert topics.level == WARN and "/scan 10.0 instead of 20 Hz" in topics.message


@pytest.mark.parametrize("listeners, simulated", [(0, 2.0), (1, 0.1)])
def test_a_rate_is_judged_only_where_it_can_be(monkeypatch, listeners, simulated):
    rig = Rig(monkeypatch, factor=0.0)
    rig.simulator.ports.sent["/scan"] = (0, listeners)
    rig.run(2.0, simulated, 0)
    rig.run(2.0, simulated, 0)
    assert rig.newest()[1].level == OK


def test_lockstep_says_what_it_waits_for(monkeypatch):
    lockstep = FakeLockstep()
    rig = Rig(monkeypatch, 0.0, lockstep)
    rig.run()
    _, _, values = rig.newest()
    assert values["share of time spent waiting for other nodes"] == "25 %" and values["lockstep ticks"] == "7"
    lockstep.answer = (False, 7, 0.25, [], ["the node /bug2"])
    rig.run(1.0, 0.0, 0)
    assert rig.newest()[0].level == WARN and "the node /bug2" in rig.newest()[0].message


def test_a_reset_does_no_harm(monkeypatch):
    rig = Rig(monkeypatch)
    rig.run()
    rig.simulator.now_ns = rig.simulator.steps = 0
    rig.run()
    assert rig.newest()[2]["steps per second"] == "0" and rig.newest()[2]["real-time factor"] == "0.00"


def test_of_many_new_contacts_some_are_logged_the_rest_counted(monkeypatch):
    rig, lines = Rig(monkeypatch), []
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: lines.append(text % values))
    rig.simulator.contacts = [ContactEvent(1, "a%d::l::c" % k, "b::l::c", (0.0, 0.0, 0.0), 0.001) for k in range(50)]
    for _ in range(2):
        rig.run()
    assert len(lines) == 21 and lines[19].startswith(
        "contact of a19::l::c and b::l::c at (0.00, 0.00, 0.00), 1.0 mm deep")
    assert lines[20] == "and 30 more pairs are in contact for the first time"
    rig.simulator.contacts.append(ContactEvent(2, "a50::l::c", "b::l::c", (0.0, 0.0, 0.0), 0.001))
    rig.run()
    assert len(lines) == 22 and lines[21].startswith("contact of a50::l::c and")
