# SPDX-License-Identifier: BSD-3-Clause
"""Processor time of ros_control in a physics step: robots with controllers against the same robots without.

Each robot stands in an empty world, without subscribers, for steps of 1 ms.  The time of the controllers is the
difference to the same robot without the plugin, whose engine still makes one step at a time.
"""
from __future__ import annotations

import statistics
import time
from typing import Any, Dict, List, NamedTuple, Tuple

from m2wr_sim.model.types import Collision as Shape
from m2wr_sim.model.types import Link, Model, Plane, World
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene

STEPS = 5000
_STEP_NS = 1000000
_BODY = """<link name="{0}"><inertial><mass value="{1}"/>
<inertia ixx="{2}" iyy="{2}" izz="{2}" ixy="0" ixz="0" iyz="0"/></inertial>{3}</link>"""
_WHEEL = '<collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>'
_JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{0}_link"/><origin xyz="{3}"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="200" velocity="5"/></joint>"""
_TRANSMISSION = """<transmission name="{0}_t"><type>transmission_interface/SimpleTransmission</type><joint name="{0}">
<hardwareInterface>hardware_interface/{1}JointInterface</hardwareInterface></joint><actuator name="{0}_m"/>
</transmission>"""
_PLUGIN = '<gazebo><plugin name="control" filename="libgazebo_ros_control.so"/></gazebo>'
_PLACES = {"front_left": "0.2 0.25 -0.05", "rear_left": "-0.2 0.25 -0.05", "front_right": "0.2 -0.25 -0.05",
           "rear_right": "-0.2 -0.25 -0.05"}
_STATES = {"type": "joint_state_controller/JointStateController", "publish_rate": 50}
_DRIVE = {"type": "diff_drive_controller/DiffDriveController", "left_wheel": ["front_left", "rear_left"],
          "right_wheel": ["front_right", "rear_right"], "pose_covariance_diagonal": [0.001] * 6,
          "twist_covariance_diagonal": [0.001] * 6, "cmd_vel_timeout": 1000.0}
_ARM = ["joint_%d" % number for number in range(1, 7)]


class Case(NamedTuple):
    """A row: name, URDF without plugin, transmissions, controllers with their parameters, gains."""

    name: str
    robot: str
    transmissions: str
    controllers: Dict[str, Dict[str, Any]]
    gains: Dict[str, Any] = {}


def _cart() -> str:
    box = '<collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision>'
    return _BODY.format("base", 10, 0.3, box) + "".join(
        _BODY.format(name + "_link", 0.5, 0.003, _WHEEL) + _JOINT.format(name, "continuous", "base", place)
        for name, place in _PLACES.items())


def _arm() -> str:
    text, parent = _BODY.format("base", 50, 1.0, ""), "base"
    for name in _ARM:
        text += _BODY.format(name + "_link", 1.0, 0.01, "") + _JOINT.format(name, "revolute", parent, "0 0 0.2")
        parent = name + "_link"
    fix = "<link name='world'/><joint name='fix' type='fixed'><parent link='world'/><child link='base'/></joint>"
    return fix + text


def _driven(names: Any, interface: str) -> str:
    return "".join(_TRANSMISSION.format(name, interface) for name in names)


CASES = (
    Case("joint states of 4 wheels", _cart(), _driven(_PLACES, "Velocity"), {"states": _STATES}),
    Case("joint states and drive, 4 wheels", _cart(), _driven(_PLACES, "Velocity"),
         {"states": _STATES, "drive": _DRIVE}),
    Case("the same with PID gains", _cart(), _driven(_PLACES, "Velocity"), {"states": _STATES, "drive": _DRIVE},
         {"gazebo_ros_control/pid_gains/" + name: {"p": 10.0, "i": 1.0, "i_clamp": 1.0} for name in _PLACES}),
    Case("joint states and trajectory, arm of 6 joints", _arm(), _driven(_ARM, "Position"),
         {"states": _STATES, "arm": {"type": "position_controllers/JointTrajectoryController", "joints": _ARM}}),
)


class _Silent:
    """A topic without subscribers."""

    def wanted(self) -> bool:
        return False

    def publish(self, message: Any) -> None:
        pass

    def close(self) -> None:
        pass


class _Ports(LocalPorts):
    def advertise(self, topic: str, message_class: Any, queue_size: int, namespace: str) -> Any:
        return _Silent()


def _simulator(case: Case, controlled: bool) -> Simulator:
    ports = _Ports()
    simulator = Simulator(make_engine("auto", EngineSettings(step_ns=_STEP_NS)), RayScene(), ports,
                          SimConfig(joint_states=False))
    floor = Link("link", collisions=(Shape("c", Plane()),))
    simulator.load_world(World(models=(Model("floor", (floor,), static=True),)))
    text = "<robot name='robot'>%s%s</robot>" % (case.robot, case.transmissions + _PLUGIN if controlled else "")
    ports.parameters["/robot_description"] = text
    for name, values in list(case.controllers.items()) + list(case.gains.items()):
        ports.parameters["/" + name] = values
    simulator.spawn(load_urdf(text, "benchmark"), ((0.0, 0.0, 0.15), (0.0, 0.0, 0.0, 1.0)), namespace="/")
    if controlled:
        manager = simulator.models["robot"].plugins[0][0].manager
        if not (all([manager.load(name) for name in case.controllers])
                and manager.switch(list(case.controllers), [], True, 0)):
            raise ValueError("the controllers of \"%s\" did not start" % case.name)
    return simulator


def time_of(case: Case, steps: int = STEPS) -> Tuple[float, float]:
    """Return the processor time of a step [us], without the controllers and with them.

    Parameters
    ----------
    case : Case
    steps : int
        How many are measured.
    """
    found: List[float] = []
    for controlled in (False, True):
        simulator = _simulator(case, controlled)
        try:
            times = []
            for _ in range(5):
                begun, until = time.thread_time(), simulator.now_ns + steps // 5 * _STEP_NS
                while simulator.now_ns < until:
                    simulator.advance(simulator.now_ns + _STEP_NS)
                times.append((time.thread_time() - begun) / (steps // 5))
            found.append(1e6 * statistics.median(times))
        finally:
            simulator.close()
    return found[0], found[1]


def report(steps: int = STEPS) -> str:
    """Return a table: for each case the time of a step without and with controllers, and the difference [us].

    Parameters
    ----------
    steps : int
        How many are measured of each.
    """
    lines = ["| controllers | step without [us] | step with [us] | controllers [us] |", "|---|---|---|---|"]
    for case in CASES:
        without, controlled = time_of(case, steps)
        lines.append("| %s | %.1f | %.1f | %.1f |" % (case.name, without, controlled, controlled - without))
    return "\n".join(lines) + "\n"
