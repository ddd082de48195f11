"""The private parameters of the node: those of the filter, and its own."""
from dataclasses import dataclass

import rospy

from m2wr_gmapping.config import GmappingConfig


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
    """

    scan_queue: int = 50
    save_on_exit: str = ""
    settle_time: float = 0.0


# name: meaning; defaults are those of NodeOptions
NODE_PARAMETERS = {
    "scan_queue": "scans that may wait for their transform or their turn; the oldest is dropped first",
    "save_on_exit": "map to write when the node ends, without .pgm; empty: none",
    "settle_time": "scans of that many seconds after the first one are left out: a robot that was just put down rocks",
}


def private_parameters():
    """Return the node's private parameters as they stand on the server (dict)."""
    return dict(rospy.get_param("~", {}) or {})


def read_parameters(given):
    """Return (GmappingConfig, NodeOptions) and warnings (list of str); raises ConfigError."""
    filtered, own, warnings = dict(given), {}, []
    for name in NODE_PARAMETERS:
        if name not in filtered:
            continue
        value, kind = filtered.pop(name), type(getattr(NodeOptions, name))
        least = {int: 1, float: 0.0}.get(kind)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if number and least is not None and value >= least:
            own[name] = kind(value)
        elif kind is str and isinstance(value, str):
            own[name] = value
        else:
            warnings.append("parameter ~{}: {!r} cannot be used, {!r} is".format(
                name, value, getattr(NodeOptions, name)))
    config = GmappingConfig.from_mapping(filtered)
    if config.unknown:
        warnings.append("unknown parameters without effect: " + ", ".join("~" + name for name in config.unknown))
    if config.unusable:
        warnings.append("parameters of the wrong kind, the default is used: ~" + ", ~".join(config.unusable))
    return config, NodeOptions(**own), warnings


def frame(name):
    """Return a frame's name without the slash that tf once had in front."""
    return name.lstrip("/")
