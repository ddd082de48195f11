# SPDX-License-Identifier: BSD-3-Clause
"""Worlds, robots and simulators for the tests of this folder, all in this process and without a ROS master."""
import pickle
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src"
sys.path.insert(0, str(SOURCE))         # for a plain pytest run; catkin's environment leads to the same files

from builders import at, box, cylinder, ground, one_link, sphere  # noqa: E402, F401
from m2wr_sim.api.loading import read_robot  # noqa: E402
from m2wr_sim.model.types import PluginSpec, World  # noqa: E402
from m2wr_sim.physics import factory  # noqa: E402
from m2wr_sim.physics.engine import EngineSettings  # noqa: E402
from m2wr_sim.runtime.ports import LocalPorts  # noqa: E402
from m2wr_sim.runtime.simulator import SimConfig, Simulator  # noqa: E402
from m2wr_sim.sensors.ray_scene import RayScene  # noqa: E402
from trace_plugin import Trace  # noqa: E402

try:
    import numba  # noqa: F401
    ENGINES = ("native", "pyode")
except ImportError:
    ENGINES = ("pyode",)                # all that there is then, and all that the tests can ask for
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
WHEEL_RADIUS, WHEEL_TRACK = 0.1, 0.4


def package_folder(name):
    """Return a package's folder: the installed or built one, else the one that stands beside this one."""
    import rospkg
    try:
        return rospkg.RosPack().get_path(name)
    except rospkg.ResourceNotFound:
        return str(Path(__file__).resolve().parents[3] / name)


@pytest.fixture(scope="session")
def m2wr():
    """Return the report's robot, read from its xacro."""
    return read_robot("m2wr")


@pytest.fixture(scope="session")
def build():
    """Return the functions that make models."""
    return SimpleNamespace(at=at, one_link=one_link, ground=ground, box=box, sphere=sphere, cylinder=cylinder)


def copied(message):
    """Return a copy of a message; far faster for long lists than copy.deepcopy."""
    return pickle.loads(pickle.dumps(message, pickle.HIGHEST_PROTOCOL))


@pytest.fixture(params=ENGINES)
def engine_kind(request):
    """Return a kind of engine; a test that asks for it, or for the makers below, runs with each."""
    return request.param


@pytest.fixture
def make_engine(engine_kind):
    """Return a function that makes engines; they are closed after the test."""
    engines = []

    def make(step_ms=1.0, models=(), **settings):
        engine = factory.make_engine(engine_kind, EngineSettings(step_ns=int(round(step_ms * 1e6)), **settings))
        engines.append(engine)
        engine.handles = [engine.add_model(model, model.pose) for model in models]
        return engine

    yield make
    for engine in engines:
        engine.close()


@pytest.fixture
def drive():
    """Return a function that sets m2wr's wheel motors for a twist that REP 103 would agree with."""
    def set_motors(engine, handle, linear_x, angular_z):
        turn = 0.5 * WHEEL_TRACK * angular_z
        # the wheel named left stands at y = -0.2, on the right
        engine.set_joint_motor(handle.joints["joint_left_wheel"], (linear_x + turn) / WHEEL_RADIUS, 5.0)
        engine.set_joint_motor(handle.joints["joint_right_wheel"], (linear_x - turn) / WHEEL_RADIUS, 5.0)
    return set_motors


class Rig:
    """A simulator with local ports and what a test wants to do with it in one line each."""

    def __init__(self, simulator):
        self.simulator, self.ports, self.engine = simulator, simulator.ports, simulator.engine

    def run(self, seconds, chunk_ns=10**15):
        """Advance by some simulated seconds, at most ``chunk_ns`` a call."""
        end_ns = self.simulator.now_ns + int(round(seconds * 1e9))
        while self.simulator.now_ns < end_ns:
            before_ns = self.simulator.now_ns
            self.simulator.advance(min(end_ns, before_ns + chunk_ns))
            assert self.simulator.now_ns > before_ns, "simulated time does not advance at %d ns" % before_ns
        return self

    def send(self, linear_x, angular_z, topic="/cmd_vel"):
        """Send a velocity command."""
        from geometry_msgs.msg import Twist
        message = Twist()
        message.linear.x, message.angular.z = linear_x, angular_z
        self.ports.send(topic, message)
        return self

    def messages(self, topic):
        """Return what was published on a topic."""
        return self.ports.topics[topic].messages

    def stamps_ms(self, topic):
        """Return the stamps of a topic in milliseconds."""
        return [message.header.stamp / 1e6 for message in self.messages(topic)]

    def pose(self, model="m2wr"):
        """Return a model's pose in the world."""
        return self.simulator.models[model].pose(self.engine)

    def rate(self, joint, model="m2wr"):
        """Return a joint's rate."""
        return self.engine.joint_rate(self.simulator.models[model].handle.joints[joint])


@pytest.fixture
def make_rig(engine_kind):
    """Return a function that makes a :class:`Rig` of a ground plane and more models; closed after the test."""
    rigs = []

    def make(*models, **options):
        step_ms, world = options.pop("step_ms", 1.0), options.pop("world", None)
        engine = factory.make_engine(engine_kind, EngineSettings(step_ns=int(round(step_ms * 1e6))))
        rig = Rig(Simulator(engine, RayScene(), LocalPorts(copied), SimConfig(**options)))
        rigs.append(rig)
        rig.simulator.load_world(world or World(models=(ground(),) + models))
        return rig

    yield make
    for rig in rigs:
        rig.simulator.close()


@pytest.fixture
def make_robot(make_rig):
    """Return a function that makes a robot of :mod:`control_robots` with ros_control, on the ground."""
    from control_robots import Robot
    return lambda text, z=0.15, **parameters: Robot(make_rig(), text, parameters, z)


@pytest.fixture
def m2wr_rig(make_rig, m2wr):
    """Return a function that makes a rig with m2wr in it, spawned as spawn_model does."""
    def make(*models, **options):
        pose, namespace = options.pop("pose", at(z=0.1)), options.pop("namespace", "/")
        robot = options.pop("robot", m2wr)
        rig = make_rig(*models, **options)
        rig.simulator.spawn(robot, pose, namespace=namespace)
        return rig
    return make


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
