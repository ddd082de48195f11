# SPDX-License-Identifier: BSD-3-Clause
"""The node's parameters: each read once, checked, and kept in one frozen record."""
import math
from dataclasses import dataclass, field, fields
from typing import Any, Callable, Dict, List, Optional, Tuple

import rospy

from m2wr_node.numbers import number
from m2wr_sim.control.diff_drive import CONVENTIONS
from m2wr_sim.engine_names import ENGINES
from m2wr_sim.errors import ParameterError
from m2wr_sim.ros.gazebo_services.reconfigure import PARAMETERS

Check = Callable[[Any], Optional[str]]      # returns what was expected, or None if the value is valid


def _parameter(default: Any, help_text: str, check: Optional[Check] = None) -> Any:
    return field(default=default, metadata={"help": help_text, "check": check})


def _at_least(least: float) -> Check:
    def check(value: float) -> Optional[str]:
        if not (math.isfinite(value) and value >= least):
            return "expected a finite number of at least %g" % least
        return None
    return check


def _one_of(*values: str) -> Check:
    def check(value: str) -> Optional[str]:
        return None if value in values else "expected one of %s" % ", ".join(values)
    return check


def _names(help_text: str) -> Any:
    return field(default_factory=list, metadata={"help": help_text, "check": None})


def _step(value: float) -> Optional[str]:
    return None if math.isfinite(value) and (value == 0.0 or 1e-5 <= value <= 0.1) else "expected 0 or 0.00001 to 0.1 s"


@dataclass(frozen=True)
class NodeConfig:
    """All private parameters of the simulation node."""

    world: str = _parameter("empty.world", "world file: a path, or a name from this package's worlds folder")
    fallback_world: str = _parameter("", "world to load if the other cannot be read; empty: the node exits")
    real_time_factor: Optional[float] = _parameter(
        None, "simulated seconds per second; 0: as fast as possible; unset: as the world requests (1 for most)",
        _at_least(0.0))
    seed: int = _parameter(0, "seed of all sensor noise", _at_least(0))
    step: float = _parameter(0.0, "physics step [s]; 0: the world's max_step_size", _step)
    engine: str = _parameter(
        "auto", "physics loop: native (compiled), pyode (same numbers, slower) or auto", _one_of(*ENGINES))
    solver: str = _parameter("step", "step (direct) or quick (iterative)", _one_of("step", "quick"))
    paused: bool = _parameter(False, "start paused")
    pub_clock_frequency: float = _parameter(
        100.0, "rate of /clock [Hz of simulated time]; 0: every step", _at_least(0.0))
    pub_state_frequency: float = _parameter(
        100.0, "rate of model_states and link_states [Hz of simulated time]; 0: every step", _at_least(0.0))
    world_markers_rate: float = _parameter(
        10.0, "rate of checks for changes [Hz of simulated time]; 0: only at the start", _at_least(0.0))
    world_markers_frame: str = _parameter("odom", "frame of world_markers; its axes are those of the world")
    wheel_convention: str = _parameter(
        "noetic", "which wheel is left: noetic, kinetic or rep103", _one_of(*CONVENTIONS))
    wheel_conventions: Dict[str, str] = field(default_factory=dict, metadata={
        "help": "wheel convention of single models, by name", "check": None})
    urdf_surface: str = _parameter(
        "honour", "<surface> in a collision of a URDF: honour (friction and slip are used) or gazebo (ignored)",
        _one_of("honour", "gazebo"))
    command_timeout: float = _parameter(
        0.0, "stop a robot that long after its last command [s]; 0: it keeps the last command", _at_least(0.0))
    enable_ros_network: bool = _parameter(
        True, "false: only /clock, no services, no state topics; plugins keep their topics")
    gazebo_faults: bool = _parameter(True, "reproduce faults of Gazebo's services, see docs/reference/services.md")
    joint_states: bool = _parameter(True, "publish joint_states for robots whose description has no plugin for it")
    joint_state_rate: float = _parameter(50.0, "rate of these joint_states [Hz]", _at_least(0.0))
    loss_ends: bool = _parameter(
        False, "a model that leaves the world ends the node with an error, for tests; false: it is removed")
    lockstep: bool = _parameter(False, "simulated time waits for the nodes below, see docs/how-to/lockstep.md")
    lockstep_controllers: List[str] = _names("nodes that control the robot, called in this order")
    lockstep_replies: List[str] = _names("topics on which other nodes answer: \"/TRIGGER -> /TOPIC [by /NODE] [once]\"")
    lockstep_listeners: List[str] = _names("nodes that get all messages: \"/NODE [respawned][: /TOPIC /TOPIC ...]\"")
    lockstep_tick: str = _parameter(
        "scan", "messages that start a tick: scan, odometry or both", _one_of("scan", "odometry", "both"))
    lockstep_patience: float = _parameter(
        10.0, "greatest wall time for each answer [s]", _at_least(0.1))
    lockstep_on_silence: str = _parameter(
        "stop", "if one does not answer: stop (ends the node with an error) or go_on (warning)",
        _one_of("stop", "go_on"))


_NUMBERS = {"real_time_factor": float, "seed": int, "step": float, "pub_clock_frequency": float,
            "pub_state_frequency": float, "world_markers_rate": float, "command_timeout": float,
            "joint_state_rate": float, "lockstep_patience": float}


def read_config(parameters: Dict[str, Any]) -> Tuple[NodeConfig, List[str]]:
    """Return the :class:`NodeConfig` of a dictionary of parameters, and the names of unknown parameters.

    Raises
    ------
    ParameterError
        If a value is of the wrong type or out of range; the message names parameter, value and range.
    """
    known = {entry.name: entry for entry in fields(NodeConfig)}
    values: Dict[str, Any] = {}
    for name, value in parameters.items():
        if name not in known:
            continue
        value = _typed(name, value)
        check = known[name].metadata["check"]
        problem = check(value) if check is not None and value is not None else None
        if problem:
            raise ParameterError("parameter ~%s is %r; %s" % (name, value, problem))
        values[name] = value
    for model, convention in values.get("wheel_conventions", {}).items():
        if convention not in CONVENTIONS:
            raise ParameterError("parameter ~wheel_conventions/%s is %r; expected one of %s"
                                 % (model, convention, ", ".join(CONVENTIONS)))
    return NodeConfig(**values), sorted(set(parameters) - set(known))


def _typed(name: str, value: Any) -> Any:
    """Return a value with its type: ints are accepted for floats, whole floats for ints."""
    if name in _NUMBERS:
        if name == "real_time_factor" and value == "":
            return None
        whole = _NUMBERS[name] is int
        amount = number(value)
        if amount is None or whole and (isinstance(value, str) or not math.isfinite(amount) or amount != int(amount)):
            raise ParameterError("parameter ~%s is %r; expected %s"
                                 % (name, value, "a whole number" if whole else "a number"))
        return _NUMBERS[name](amount)
    if name in ("paused", "joint_states", "enable_ros_network", "gazebo_faults", "lockstep"):
        if not isinstance(value, bool):
            raise ParameterError("parameter ~%s is %r; expected true or false" % (name, value))
        return value
    if name == "wheel_conventions":
        if not isinstance(value, dict):
            raise ParameterError("parameter ~wheel_conventions is %r; expected names of models with a convention each"
                                 % (value,))
        return value
    if name in ("lockstep_controllers", "lockstep_replies", "lockstep_listeners"):
        if isinstance(value, list):     # "/NODE: /TOPIC" without quotes is a pair for YAML
            value = [": ".join(map(str, *entry.items())) if isinstance(entry, dict) and len(entry) == 1 else entry
                     for entry in value]
        if not isinstance(value, list) or not all(isinstance(entry, str) and entry.strip() for entry in value):
            raise ParameterError("parameter ~%s is %r; expected a list of names" % (name, value))
        return value
    return str(value)


def private_parameters() -> Dict[str, Any]:
    """Return this node's private parameters, without those of rospy and of the dynamic parameters."""
    others = {"log_level", "enable_statistics"}.union(PARAMETERS)
    return {name: value for name, value in rospy.get_param("~", {}).items() if name not in others}
