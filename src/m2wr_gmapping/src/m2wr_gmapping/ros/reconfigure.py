# SPDX-License-Identifier: BSD-3-Clause
"""Dynamic parameters, for ``dynamic_reconfigure``."""
from dataclasses import replace
from types import SimpleNamespace

import rospy

from m2wr_gmapping.config import PARAMETERS

try:
    from dynamic_reconfigure.server import Server
except ImportError:                 # optional package; all parameters can also be set before the start
    Server = None

# name: (least, greatest) value of the slider
CHANGEABLE = {"throttle_scans": (1, 100), "map_update_interval": (0.0, 60.0), "transform_publish_period": (0.0, 1.0),
              "minimumScore": (0.0, 1000.0), "linearUpdate": (0.0, 10.0),
              "angularUpdate": (0.0, 3.15), "temporalUpdate": (-1.0, 60.0)}


def description(config):
    """Return what dynamic_reconfigure's generator would make of :data:`CHANGEABLE`."""
    kinds = {name: "int" if isinstance(PARAMETERS[name].default, int) else "double" for name in CHANGEABLE}
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "groups": [],
             "parameters": [{"name": name, "type": kinds[name], "level": 1, "edit_method": "",
                             "description": PARAMETERS[name].meaning} for name in CHANGEABLE]}
    limits = {name: (min(low, config[name]), max(high, config[name])) for name, (low, high) in CHANGEABLE.items()}
    return SimpleNamespace(config_description=group, defaults={name: config[name] for name in CHANGEABLE},
                           min={name: low for name, (low, _) in limits.items()},
                           max={name: high for name, (_, high) in limits.items()})


def changed(config, values):
    """Return a GmappingConfig with other values of :data:`CHANGEABLE`."""
    merged = config.as_dict()
    merged.update((name, type(merged[name])(values[name])) for name in CHANGEABLE if name in values)
    return replace(config, values=tuple(merged.items()))


def make_reconfigure(config, take):
    """Serve ``~set_parameters``; ``take(values)`` gets all :data:`CHANGEABLE`. None where the package is missing."""
    if Server is None:
        rospy.loginfo("the Python package dynamic_reconfigure is not installed: there is no ~set_parameters")
        return None

    def change(values, _):
        take(values)
        return values

    # the server reads its first values from ~ without type conversion
    for name in CHANGEABLE:
        if rospy.has_param("~" + name):
            rospy.set_param("~" + name, config[name])
    return Server(description(config), change)
