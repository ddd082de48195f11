# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of m2wr's navigation while it explores: the same files as those of ``explore.launch``."""
from __future__ import annotations

import os
from typing import Any, Dict

import yaml

from m2wr_sim.api.loading import package_folder

#: Parameters of explore, as in explore.launch [m].
EXPLORER = {"robot_radius": 0.455, "least_clearance": 0.25, "min_frontier_size": 0.25, "min_corner_size": 1.0}


def _merged(below: Dict[str, Any], above: Dict[str, Any]) -> Dict[str, Any]:
    result = dict(below)
    for name, value in above.items():
        both = isinstance(value, dict) and isinstance(below.get(name), dict)
        result[name] = _merged(below[name], value) if both else value
    return result


def navigation_parameters() -> Dict[str, Any]:
    """Return the parameters of move_base, as nested mappings."""
    parameters: Dict[str, Any] = {}
    for package in ("m2wr_navigation", "m2wr_exploration"):
        with open(os.path.join(package_folder(package), "config", "m2wr.yaml"), encoding="utf-8") as stream:
            parameters = _merged(parameters, yaml.safe_load(stream))
    return parameters
