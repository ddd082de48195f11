# SPDX-License-Identifier: BSD-3-Clause
"""The private parameters of the node: those of the filter, and its own."""
from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from typing import Any, Dict, List, Mapping, Optional, Tuple

import rospy

from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_node.numbers import number
from m2wr_node.ros.transform_buffer import frame


@dataclass(frozen=True)
class NodeOptions:
    """Parameters of the live node only.

    Attributes
    ----------
    scan_queue : int
        Greatest number of waiting scans; the oldest is dropped first.
    save_on_exit : str
        Map to write when the node ends, without ending; empty: none.
    settle_time : float
        Scans in this many seconds after the first one are skipped [s].
    state_file : str
        State to continue from, if it exists; default file of the services.
    state_folder : str
        Folder of the files that clients of the services name; empty: ``m2wr`` below ROS_HOME.
    state_save_period : float
        Wall time between two autosaved states [s]; 0: none.
    respawn : bool
        roslaunch restarts the node: after a fatal error at the start it waits for the shutdown.
    odometry_runs_on : bool
        Whether odometry was not reset since the state was saved.
    map_file : str
        Saved map to start on.
    initial_pose_x, initial_pose_y, initial_pose_a : float or None
        Pose of the base on that map at the first scan [m, rad]; default: odometry.
    """

    scan_queue: int = 500
    save_on_exit: str = ""
    settle_time: float = 0.0
    state_file: str = ""
    state_folder: str = ""
    state_save_period: float = 60.0
    respawn: bool = False
    odometry_runs_on: bool = True
    map_file: str = ""
    initial_pose_x: Optional[float] = None
    initial_pose_y: Optional[float] = None
    initial_pose_a: Optional[float] = None

    @property
    def initial_pose(self) -> Optional[List[float]]:
        """Pose (3,) of the base on the saved map, with 0 for missing values; None without any value."""
        given = self.initial_pose_x, self.initial_pose_y, self.initial_pose_a
        return None if given == (None, None, None) else [value or 0.0 for value in given]


# name: meaning; defaults are those of NodeOptions
NODE_PARAMETERS = {
    "scan_queue": "greatest number of waiting scans; the oldest is dropped first",
    "save_on_exit": "map to write when the node ends, without .pgm; empty: none",
    "settle_time": "scans in this many seconds after the first one are skipped, while a robot settles",
    "state_file": "state to continue from, if the file exists; default file of save_state and load_state",
    "state_folder": "folder of the files that save_state and load_state name; empty: m2wr below ROS_HOME (~/.ros)",
    "state_save_period": "wall seconds between two autosaved states, from which a killed node continues; 0: none",
    "respawn": "roslaunch restarts this node: after a fatal error at the start it waits for the shutdown",
    "odometry_runs_on": "false: odometry was reset since the state was saved; the robot is at its last pose",
    "map_file": "saved map (YAML) to start on; its cell size replaces `delta`",
    "initial_pose_x": "x of the base on that map at the first scan, within 1 m [m]; default: odometry",
    "initial_pose_y": "y, likewise [m]",
    "initial_pose_a": "heading, within 0.5 rad [rad]",
}
LEAST = {"scan_queue": 1, "settle_time": 0.0, "state_save_period": 0.0}


def private_parameters() -> Dict[str, Any]:
    """Return the node's private parameters on the server."""
    return dict(rospy.get_param("~", {}) or {})


def read_parameters(given: Mapping[str, Any]) -> Tuple[GmappingConfig, NodeOptions, List[str]]:
    """Return the parameters of the filter, those of the node, and warnings; raises ConfigError."""
    filtered = dict(given)
    own: Dict[str, Any] = {}
    warnings: List[str] = []
    for name in NODE_PARAMETERS:
        if name not in filtered:
            continue
        value, default = filtered.pop(name), getattr(NodeOptions, name)
        kind, amount = float if default is None else type(default), number(value)
        if kind in (int, float) and amount is not None and math.isfinite(amount) \
                and amount >= LEAST.get(name, -math.inf):
            own[name] = kind(amount)
        elif kind in (str, bool) and isinstance(value, kind):
            own[name] = value
        else:
            warnings.append("parameter ~{}: {!r} cannot be used, {!r} is".format(name, value, default))
    config = GmappingConfig.from_mapping(filtered)
    if config.unknown:
        warnings.append("unknown parameters without effect: " + ", ".join("~" + name for name in config.unknown))
    if config.unusable:
        warnings.append("parameters of the wrong kind, the default is used: ~" + ", ~".join(config.unusable))
    return config, NodeOptions(**own), warnings


AT_FIRST_SCAN = ("maxRange", "maxUrange")      # gmapping reads these then, all others at the start


def read_ranges(config: GmappingConfig) -> GmappingConfig:
    """Return a GmappingConfig with the present ``maxRange`` and ``maxUrange`` of the server.

    If the server does not answer or has an unusable value, those of ``config`` are kept.
    """
    try:
        given = private_parameters()
        now = GmappingConfig.from_mapping({name: given[name] for name in AT_FIRST_SCAN if name in given})
    except (OSError, rospy.ROSException, ConfigError) as error:
        rospy.logwarn("%s are taken as at the start: %s", " and ".join(AT_FIRST_SCAN), error)
        return config
    values = dict(config.values, **{name: now[name] for name in AT_FIRST_SCAN})
    return replace(config, values=values)


def tf_prefix() -> str:
    """Return the parameter ``tf_prefix`` of this node, searched upwards; empty if there is none."""
    found = rospy.search_param("tf_prefix")
    prefix = rospy.get_param(found) if found else ""
    return prefix.strip("/") if isinstance(prefix, str) else ""


def with_prefix(config: GmappingConfig, prefix: str) -> GmappingConfig:
    """Return a configuration whose frames have a prefix, as tf resolves names.

    A name with a leading slash, or with the prefix already, is not changed.

    Parameters
    ----------
    config : GmappingConfig
    prefix : str
        Without slashes at its ends; empty: none.
    """
    values = dict(config.values)
    for name in ("base_frame", "odom_frame", "map_frame"):
        value = values[name]
        if value.startswith("/") or not prefix or value.startswith(prefix + "/"):
            values[name] = frame(value)
        else:
            values[name] = "{}/{}".format(prefix, value)
    return replace(config, values=values)


def save_on_exit_warnings(name: str) -> List[str]:
    """Return warnings (list of str) if a map cannot be written as ``name`` (may be empty) at the end."""
    folder = os.path.dirname(os.path.abspath(os.path.expanduser(name)))
    if not name or (os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)):
        return []
    return ["~save_on_exit: {} {}, so no map can be written there at the end".format(
        "this node may not write into" if os.path.isdir(folder) else "there is no folder", folder)]


def check_frames(config: GmappingConfig) -> None:
    """Raise ConfigError unless base, odometry and map have three different frames."""
    names = {name: frame(config[name]) for name in ("base_frame", "odom_frame", "map_frame")}
    if not all(names.values()) or len(set(names.values())) < len(names):
        raise ConfigError("parameters {}: expected three different frames".format(
            ", ".join("{} {!r}".format(*item) for item in names.items())))
