# SPDX-License-Identifier: BSD-3-Clause
"""The private parameters of the node: those of the filter, and its own."""
import math
import os
import typing
from dataclasses import dataclass, replace

import rospy

from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_node.numbers import number


@dataclass(frozen=True)
class NodeOptions:
    """What only the live node needs.

    Attributes
    ----------
    scan_queue : int
        Scans that may wait for their transform or their turn; the oldest is dropped first.
    save_on_exit : str
        Map to write when the node ends, without ending; empty: none.
    settle_time : float
        Scans of that many seconds after the first one are left out.
    state_file : str
        State to begin from, if it exists; also the name that the services take when they get none.
    state_folder : str
        Where the services save and load states that they are given a name for; empty: ``m2wr`` below ROS_HOME.
    state_save_period : float
        Between two states that are kept for a node that roslaunch starts again [s], wall; 0: none is.
    respawn : bool
        roslaunch starts a node that ends again and again: one that cannot begin waits for the end of the run.
    odometry_runs_on : bool
        Whether the odometry is still the one that the state was made with.
    map_file : str
        Saved map to begin on.
    initial_pose_x, initial_pose_y, initial_pose_a : float or None
        Pose of the base on that map at the first scan [m, rad]; none given: as the odometry says.
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
    initial_pose_x: typing.Optional[float] = None
    initial_pose_y: typing.Optional[float] = None
    initial_pose_a: typing.Optional[float] = None

    @property
    def initial_pose(self):
        """Pose (3,) of the base on the saved map, what was not given being 0; None where nothing was given."""
        given = self.initial_pose_x, self.initial_pose_y, self.initial_pose_a
        return None if given == (None, None, None) else [value or 0.0 for value in given]


# name: meaning; defaults are those of NodeOptions
NODE_PARAMETERS = {
    "scan_queue": "scans that may wait for their transform or their turn; the oldest is dropped first",
    "save_on_exit": "map to write when the node ends, without .pgm; empty: none",
    "settle_time": "scans of that many seconds after the first one are left out: a robot that was just put down rocks",
    "state_file": "state to go on from, if that file exists; also what save_state and load_state take without a name",
    "state_folder": "folder of the files that save_state and load_state are given; empty: m2wr below ROS_HOME (~/.ros)",
    "state_save_period": "wall seconds between two states kept beside the log, to go on from when killed; 0: none",
    "respawn": "roslaunch restarts this node whenever it ends: one that cannot begin waits for the end",
    "odometry_runs_on": "false: the odometry has begun anew since the state was saved, the robot stands where it stood",
    "map_file": "saved map (YAML) to begin on; `delta` is then its cell size",
    "initial_pose_x": "where the base stands on it at the first scan, within 1 m [m]; default as the odometry says",
    "initial_pose_y": "likewise [m]",
    "initial_pose_a": "its heading, within 0.5 rad [rad]",
}
MIN_DEVIATION = {"scan_queue": 1, "settle_time": 0.0, "state_save_period": 0.0}


def private_parameters():
    """Return the node's private parameters as they stand on the server (dict)."""
    return dict(rospy.get_param("~", {}) or {})


def read_parameters(given):
    """Return (GmappingConfig, NodeOptions) and warnings (list of str); raises ConfigError."""
    filtered, own, warnings = dict(given), {}, []
    for name in NODE_PARAMETERS:
        if name not in filtered:
            continue
        value, default = filtered.pop(name), getattr(NodeOptions, name)
        kind, amount = float if default is None else type(default), number(value)
        if kind in (int, float) and amount is not None and math.isfinite(amount) \
                and amount >= MIN_DEVIATION.get(name, -math.inf):
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


AT_FIRST_SCAN = ("maxRange", "maxUrange")      # the original reads these then, all others at the start


def read_ranges(config):
    """Return a GmappingConfig with ``maxRange`` and ``maxUrange`` as they stand on the server now.

    Where the server does not answer, or has a value that cannot be used, those of ``config`` stay.
    """
    try:
        given = private_parameters()
        now = GmappingConfig.from_mapping({name: given[name] for name in AT_FIRST_SCAN if name in given})
    except (OSError, rospy.ROSException, ConfigError) as error:
        rospy.logwarn("%s are taken as at the start: %s", " and ".join(AT_FIRST_SCAN), error)
        return config
    values = dict(config.as_dict(), **{name: now[name] for name in AT_FIRST_SCAN})
    return replace(config, values=tuple(values.items()))


def tf_prefix():
    """Return the parameter ``tf_prefix`` that holds for this node, the nearest one upwards; empty if there is none."""
    found = rospy.search_param("tf_prefix")
    prefix = rospy.get_param(found) if found else ""
    return prefix.strip("/") if isinstance(prefix, str) else ""


def with_prefix(config, prefix):
    """Return a GmappingConfig whose frames have the prefix, as tf resolves names.

    A name that begins with a slash is meant as it stands; one that has the prefix already does not get it twice.
    """
    values = config.as_dict()
    for name in ("base_frame", "odom_frame", "map_frame"):
        value = values[name]
        if value.startswith("/") or not prefix or value.startswith(prefix + "/"):
            values[name] = frame(value)
        else:
            values[name] = "{}/{}".format(prefix, value)
    return replace(config, values=tuple(values.items()))


def save_on_exit_warnings(name):
    """Return warnings (list of str) on a map that could not be written as ``name`` (may be empty) at the end."""
    folder = os.path.dirname(os.path.abspath(os.path.expanduser(name)))
    if not name or (os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)):
        return []
    return ["~save_on_exit: {} {}, so no map can be written there at the end".format(
        "this node may not write into" if os.path.isdir(folder) else "there is no folder", folder)]


def check_frames(config):
    """Raise ConfigError unless base, odometry and map have three different frames."""
    names = {name: frame(config[name]) for name in ("base_frame", "odom_frame", "map_frame")}
    if not all(names.values()) or len(set(names.values())) < len(names):
        raise ConfigError("parameters {}: expected three different frames".format(
            ", ".join("{} {!r}".format(*item) for item in names.items())))


def frame(name):
    """Return a frame's name without the slash that tf once had in front."""
    return name.lstrip("/")
