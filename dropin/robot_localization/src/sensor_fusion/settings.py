# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of ``ekf_localization_node``."""
from __future__ import annotations

import math
import re
from typing import Any, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_navigation.fusion.sources import SourceSettings
from m2wr_node.numbers import number

KINDS = ("odom", "imu", "pose", "twist")
MOST_SOURCES = 10           # of one kind
_SIZE = 15
_SOURCE = re.compile(r"(odom|imu|pose|twist)[0-9]+\Z")
_KNOWN = re.compile(r"(odom|imu|pose|twist)[0-9]+_(config|differential|relative|queue_size|nodelay|"
                    r"remove_gravitational_acceleration|(pose_|twist_|linear_acceleration_)?rejection_threshold|"
                    r"pose_use_child_frame)\Z")
#: Parameters of the original that are left out; a warning says so if one is set to another value than these.
LEFT_OUT = {"use_control": False, "smooth_lagged_data": False, "dynamic_process_noise_covariance": False,
            "publish_acceleration": False, "stamped_control": False}
_WITHOUT_EFFECT = ("transform_time_offset", "transform_timeout", "print_diagnostics", "debug", "debug_out_file",
                   "permit_corrected_publication", "history_length", "control_config", "control_timeout",
                   "acceleration_limits", "deceleration_limits", "acceleration_gains", "deceleration_gains",
                   "disabled_at_startup", "gravitational_acceleration", "base_link_frame_output")


class SettingsError(ValueError):
    """A parameter that cannot be used; the message says what was expected."""


class Topic(NamedTuple):
    """One sensor: its name (``odom0``), kind, topic, queue length and settings."""

    name: str
    kind: str
    topic: str
    queue: int
    settings: SourceSettings


class Settings(NamedTuple):
    """Everything that the node reads at its start; ``warnings`` are sentences for the log."""

    frequency: float
    sensor_timeout: float
    two_d_mode: bool
    map_frame: str
    odom_frame: str
    base_link_frame: str
    world_frame: str
    publish_tf: bool
    predict_to_current_time: bool
    reset_on_time_jump: bool
    process_noise: Optional[Any]
    initial: Optional[Any]
    topics: Tuple[Topic, ...]
    warnings: Tuple[str, ...]


def read(given: Mapping[str, Any]) -> Settings:
    """Return the settings that private parameters give.

    Parameters
    ----------
    given : mapping of str to object
        As the parameter server holds them.

    Raises
    ------
    SettingsError
        If one has a value that cannot be used.
    """
    frequency = _number(given, "frequency", 30.0, 1e-3, 1000.0)
    frames = {name: _text(given, name, default) for name, default in (
        ("map_frame", "map"), ("odom_frame", "odom"), ("base_link_frame", "base_link"))}
    world = _text(given, "world_frame", frames["odom_frame"])
    if len(set(frames.values())) < 3:
        raise SettingsError("map_frame, odom_frame and base_link_frame are %s; expected three names" % (
            ", ".join(frames.values())))
    if world not in (frames["map_frame"], frames["odom_frame"]):
        raise SettingsError("world_frame is %r; expected the map_frame %r or the odom_frame %r" % (
            world, frames["map_frame"], frames["odom_frame"]))
    topics = tuple(_topic(given, name) for name in sorted(given) if _SOURCE.match(str(name)))
    if not topics:
        raise SettingsError("there is no sensor; expected odom0, imu0, pose0 or twist0 with the name of a topic")
    for kind in KINDS:
        if sum(topic.kind == kind for topic in topics) > MOST_SOURCES:
            raise SettingsError("there are more than %d sensors of the kind %s" % (MOST_SOURCES, kind))
    return Settings(frequency, _number(given, "sensor_timeout", 1.0 / frequency, 1e-6, 1e6),
                    _truth(given, "two_d_mode", False), frames["map_frame"], frames["odom_frame"],
                    frames["base_link_frame"], world, _truth(given, "publish_tf", True),
                    _truth(given, "predict_to_current_time", False), _truth(given, "reset_on_time_jump", False),
                    _matrix(given, "process_noise_covariance"), _matrix(given, "initial_estimate_covariance"),
                    topics, tuple(_warnings(given, topics)))


def _topic(given: Mapping[str, Any], name: str) -> Topic:
    config = given.get(name + "_config")
    if not isinstance(config, list) or len(config) != _SIZE or not all(
            isinstance(value, (bool, int)) for value in config):
        raise SettingsError("%s_config is %.80r; expected 15 truth values" % (name, config))
    sigmas = [_number(given, "%s_%srejection_threshold" % (name, part), math.inf, 0.0, math.inf)
              for part in (("pose_", "twist_", "linear_acceleration_") if name[:3] in ("odo", "imu") else ("",) * 3)]
    settings = SourceSettings([bool(value) for value in config], _truth(given, name + "_differential", False),
                              _truth(given, name + "_relative", False),
                              _truth(given, name + "_remove_gravitational_acceleration", False), *sigmas)
    return Topic(name, name.rstrip("0123456789"), _text(given, name, ""),
                 int(_number(given, name + "_queue_size", 10, 1, 1000)), settings)


def _warnings(given: Mapping[str, Any], topics: Tuple[Topic, ...]) -> List[str]:
    known = set(Settings._fields) | {"process_noise_covariance", "initial_estimate_covariance"}
    known |= set(LEFT_OUT) | set(_WITHOUT_EFFECT)
    found = ["%s: both differential and relative are set; relative has no effect" % topic.name for topic in topics
             if topic.settings.differential and topic.settings.relative]
    found += ["%s has all of %s_config false: it is not used" % (topic.name, topic.name) for topic in topics
              if not any(topic.settings.config)]
    for name in sorted(map(str, given)):
        if name in LEFT_OUT and given[name] != LEFT_OUT[name]:
            found.append("%s is not supported and has no effect" % name)
        elif name not in known and not _SOURCE.match(name) and not _KNOWN.match(name):
            found.append("%s is no parameter of this node and has no effect" % name)
    return found


def _number(given: Mapping[str, Any], name: str, default: float, low: float, high: float) -> float:
    value = number(given.get(name, default))
    if value is None or not low <= value <= high:
        raise SettingsError("%s is %.60r; expected a number from %g to %g" % (name, given.get(name), low, high))
    return float(value)


def _truth(given: Mapping[str, Any], name: str, default: bool) -> bool:
    value = given.get(name, default)
    if not isinstance(value, bool):
        raise SettingsError("%s is %.60r; expected true or false" % (name, value))
    return value


def _text(given: Mapping[str, Any], name: str, default: str) -> str:
    value = given.get(name, default)
    if not isinstance(value, str) or not value.strip("/"):
        raise SettingsError("%s is %.60r; expected a name" % (name, value))
    return value if name[0] in "oipt" and _SOURCE.match(name) else value.lstrip("/")


def _matrix(given: Mapping[str, Any], name: str) -> Optional[Any]:
    value = given.get(name)
    if value is None:
        return None
    numbers = [number(entry) for entry in value] if isinstance(value, list) else []
    if len(numbers) not in (_SIZE, _SIZE * _SIZE) or any(
            entry is None or not math.isfinite(entry) for entry in numbers):
        raise SettingsError("%s has %s; expected 225 numbers row by row, or the 15 of the diagonal" % (
            name, "%d entries" % len(numbers) if numbers else "%.60r" % (value,)))
    array = np.array(numbers, dtype=float)
    matrix = np.diag(array) if len(numbers) == _SIZE else array.reshape(_SIZE, _SIZE)
    if (np.diag(matrix) < 0.0).any():
        raise SettingsError("%s has a negative variance on its diagonal" % name)
    return matrix
