# SPDX-License-Identifier: BSD-3-Clause
"""A simulation in this process whose ports serialise all output, and its invariants."""
import io
import math

from geometry_msgs.msg import Twist

from harness import Wrong
from m2wr_sim.model.sdf.loader import load_world  # noqa: F401 (also for targets)
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.runtime.ports import LocalPort, LocalPorts
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene

EMPTY = """<sdf version="1.6"><world name="default"><model name="ground_plane"><static>1</static><link name="link">
<collision name="c"><geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link>
</model><model name="wall"><static>1</static><pose>3 0 0.5 0 0 0</pose><link name="link"><collision name="c"><geometry>
<box><size>0.2 4 1</size></box></geometry></collision></link></model></world></sdf>"""


class _Port(LocalPort):
    """Serialises each message, as a connection would, and forgets it."""

    def publish(self, message):
        if hasattr(message, "message"):
            message = message.message()
        message.serialize(io.BytesIO())
        self.count = getattr(self, "count", 0) + 1


class Ports(LocalPorts):
    """All topics have a subscriber; stamps are those of ROS."""

    def advertise(self, topic, message_class, queue_size, namespace):
        port = self.topics[self.resolve(topic, namespace)] = _Port(self.resolve(topic, namespace))
        return port

    def subscribe(self, topic, message_class, callback, namespace, keep=1):
        subscription = super().subscribe(topic, message_class, callback, namespace, keep)
        subscription.message_class = message_class
        return subscription

    def transform(self, stamp, parent, child, position, orientation):
        if not all(map(math.isfinite, tuple(position) + tuple(orientation))):
            raise Wrong("transform %s -> %s is not finite" % (parent, child))

    def moment(self, now_ns):
        return stamp_of(now_ns)

    def clock(self, now_ns):
        self.clock_ns = [now_ns]


def make_simulator(world=None, step_ms=1.0, engine="auto"):
    """Return a simulator of a World record, by default of :data:`EMPTY`; must be closed."""
    world = world or load_world(EMPTY)
    settings = EngineSettings(step_ns=int(step_ms * 1e6))
    simulator = Simulator(make_engine(engine, settings), RayScene(), Ports(), SimConfig())
    try:
        simulator.load_world(world)
    except BaseException:
        simulator.close()
        raise
    return simulator


def check(simulator):
    """Raise Wrong if the state of any link is not finite."""
    simulator.settle()
    for name, model in simulator.models.items():
        for link, number in model.handle.links.items():
            for part in simulator.engine.link_state(number):
                if not all(map(math.isfinite, part)):
                    raise Wrong("%s::%s is not finite: %s" % (name, link, tuple(part)))


def run(simulator, steps):
    """Make steps, and check that time advanced; then check the states."""
    end_ns = simulator.now_ns + steps * simulator.step_ns
    while simulator.now_ns < end_ns:
        before_ns = simulator.now_ns
        simulator.advance(end_ns)
        if simulator.now_ns <= before_ns:
            if simulator.paused:
                return
            raise Wrong("time stopped at %d ns" % before_ns)
    check(simulator)


def upright(x=0.0, y=0.0, z=0.1):
    """Return a pose as spawn takes it."""
    return ((x, y, z), (0.0, 0.0, 0.0, 1.0))


def send_commands(simulator, linear, angular):
    """Send a velocity to every topic that takes one."""
    for topic, subscription in list(simulator.ports.subscriptions.items()):
        if subscription.message_class is Twist:
            message = Twist()
            message.linear.x, message.angular.z = linear, angular
            simulator.ports.send(topic, message)


__all__ = ["Wrong", "make_simulator", "check", "run", "upright", "send_commands"]
