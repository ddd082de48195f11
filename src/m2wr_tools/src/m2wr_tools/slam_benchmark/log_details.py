# SPDX-License-Identifier: BSD-3-Clause
"""What is known about a log besides its truth: the file NAME.json that ``make_logs`` writes beside it."""
from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple

import numpy as np

from m2wr_maps.se2 import compose, inverse, wrap
from m2wr_node.numbers import number
from m2wr_tools.slam_benchmark.laser_logs import LogError

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_tools.slam_benchmark.laser_logs import Log

LARGEST = 1 << 20           # of such a file [bytes]
#: Keys of ``calibration`` in the statistics of a run: true pose of the laser in the pose that /tf gives [m, m, rad].
CALIBRATION = ("laser_x", "laser_y", "laser_yaw")


@dataclass(frozen=True)
class LogDetails:
    """Known facts; empty if there is no such file.

    Attributes
    ----------
    difficulties : dict
        Aspect -> class.
    mount : (3,) float or None
        True pose of the laser in the one that /tf gives [m, m, rad].
    nominal : (3,) float or None
        Pose of the laser in the base frame that /tf gives [m, m, rad].
    """

    difficulties: Dict[str, str] = field(default_factory=dict)
    mount: Optional[Tuple[float, float, float]] = None
    nominal: Optional[Tuple[float, float, float]] = None

    def base_correction(self) -> Optional[FloatArray]:
        """Return the true pose (3,) of the base in the one that follows from the laser's pose by /tf, or None.

        A mapper knows where the laser is. Where the base is follows from the mount, so a wrong mount shifts it although
        the map is right.
        """
        if self.mount is None or self.nominal is None:
            return None
        laser = np.array(self.nominal)
        return compose(laser, inverse(compose(laser, np.array(self.mount))))


def read(log: Log) -> LogDetails:
    """Return what is known about a log; raises LogError if the file is there and cannot be read."""
    path = os.path.join(os.path.dirname(log.path), log.name + ".json")
    if not os.path.isfile(path):
        return LogDetails()
    try:
        if os.path.getsize(path) > LARGEST:
            raise LogError("{}: expected at most {} bytes".format(path, LARGEST))
        with open(path, encoding="utf-8") as stream:
            found = json.load(stream)
    except (OSError, ValueError, RecursionError) as error:
        raise LogError("{}: {}".format(path, error)) from error
    if not isinstance(found, dict):
        raise LogError("{}: expected a JSON object".format(path))
    classes, laser = found.get("difficulties", {}), found.get("laser", {})
    if not isinstance(classes, dict) or not all(isinstance(name, str) for name in classes.values()):
        raise LogError("{}: difficulties: expected an object of names".format(path))
    mount, nominal = (_three(laser.get(name) if isinstance(laser, dict) else None) for name in ("mount", "nominal"))
    return LogDetails(classes, mount, nominal)


def _three(values: Any) -> Optional[Tuple[float, float, float]]:
    if not isinstance(values, list) or len(values) != 3:
        return None
    x, y, yaw = (number(value) for value in values)
    return None if x is None or y is None or yaw is None else (x, y, yaw)


def calibration_errors(details: LogDetails, statistics: Dict[str, Any]) -> Dict[str, float]:
    """Return the errors of an estimated laser mount: ``laser_metres``, ``laser_degrees``; empty without an estimate.

    Parameters
    ----------
    details : LogDetails
    statistics : dict
        Of a replay; ``calibration`` in it has the keys of :data:`CALIBRATION`.
    """
    estimate = statistics.get("calibration")
    if details.mount is None or not isinstance(estimate, dict):
        return {}
    found: Dict[str, float] = {}
    (x, y, yaw), (got_x, got_y, got_yaw) = details.mount, (number(estimate.get(key)) for key in CALIBRATION)
    if got_x is not None and got_y is not None:
        found["laser_metres"] = math.hypot(got_x - x, got_y - y)
    if got_yaw is not None:
        found["laser_degrees"] = math.degrees(abs(float(wrap(got_yaw - yaw))))
    return found
