# SPDX-License-Identifier: BSD-3-Clause
"""Dynamic parameters, for ``dynamic_reconfigure``."""
from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, Callable, Dict, Mapping, Tuple

import rospy

from m2wr_gmapping.config import PARAMETERS, GmappingConfig

try:
    from dynamic_reconfigure.server import Server
except ImportError:                 # optional package; all parameters can also be set before the start
    Server = None

# name: (least, greatest) value of the slider
CHANGEABLE: Dict[str, Tuple[float, float]] = {
    "throttle_scans": (1, 100), "map_update_interval": (0.0, 60.0), "transform_publish_period": (0.0, 1.0),
    "minimumScore": (0.0, 1000.0), "linearUpdate": (0.0, 10.0), "angularUpdate": (0.0, 3.15),
    "temporalUpdate": (-1.0, 60.0)}


def description(config: GmappingConfig) -> SimpleNamespace:
    """Return what dynamic_reconfigure's generator would make of :data:`CHANGEABLE`."""
    kinds = {name: "int" if isinstance(PARAMETERS[name].default, int) else "double" for name in CHANGEABLE}
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "groups": [],
             "parameters": [{"name": name, "type": kinds[name], "level": 1, "edit_method": "",
                             "description": PARAMETERS[name].meaning} for name in CHANGEABLE]}
    limits = {name: (min(low, config[name]), max(high, config[name])) for name, (low, high) in CHANGEABLE.items()}
    return SimpleNamespace(config_description=group, defaults={name: config[name] for name in CHANGEABLE},
                           min={name: low for name, (low, _) in limits.items()},
                           max={name: high for name, (_, high) in limits.items()})


def changed(config: GmappingConfig, values: Mapping[str, Any]) -> GmappingConfig:
    """Return a configuration with other values of :data:`CHANGEABLE`.

    Parameters
    ----------
    config : GmappingConfig
    values : mapping of str to number
        Public name -> new value; other names are ignored.
    """
    merged = dict(config.values)
    merged.update((name, type(merged[name])(values[name])) for name in CHANGEABLE if name in values)
    return replace(config, values=merged)


def make_reconfigure(config: GmappingConfig, take: Callable[[Mapping[str, Any]], object]) -> Any:
    """Serve ``~set_parameters``.

    Parameters
    ----------
    config : GmappingConfig
        With the present values.
    take : callable
        Called with the values of all :data:`CHANGEABLE` after each change.

    Returns
    -------
    dynamic_reconfigure.server.Server or None
        None where the package is missing.
    """
    if Server is None:
        rospy.loginfo("the Python package dynamic_reconfigure is not installed: there is no ~set_parameters")
        return None

    def change(values: Mapping[str, Any], _: int) -> Mapping[str, Any]:
        take(values)
        return values

    # the server reads its first values from ~ without type conversion
    for name in CHANGEABLE:
        if rospy.has_param("~" + name):
            rospy.set_param("~" + name, config[name])
    return Server(description(config), change)
