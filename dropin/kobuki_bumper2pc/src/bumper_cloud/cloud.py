# SPDX-License-Identifier: BSD-3-Clause
"""Points for the bumpers and cliff sensors of a Kobuki that are active, without ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, Mapping, NamedTuple

import numpy as np

from m2wr_node.numbers import number

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEFT, CENTRE, RIGHT = 4, 2, 1       # bits of the sensors, of bumpers and cliffs alike (kobuki_msgs/SensorState)
FAR = 100.0                         # m: a sensor that is not active has a point out of every costmap
BOUNDS = {"pointcloud_radius": (0.0, 10.0), "pointcloud_height": (-10.0, 10.0),
          "side_point_angle": (-math.pi, math.pi)}


class ConfigurationError(ValueError):
    """Parameters that cannot be used; the message names them and what was expected."""


class Settings(NamedTuple):
    """Where the points are: distance and height [m], and angle of the side points from the y axis [rad]."""

    pointcloud_radius: float = 0.25
    pointcloud_height: float = 0.04
    side_point_angle: float = 0.34906585        # 20 degrees
    base_link_frame: str = "base_link"


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Return the settings in a node's private parameters.

    Parameters
    ----------
    given : mapping
        Name to value, as the parameter server holds them.

    Raises
    ------
    ConfigurationError
        If a value is no number, out of range, or the frame is no text.
    """
    values: Dict[str, Any] = Settings()._asdict()
    for name, (least, most) in BOUNDS.items():
        value = number(given.get(name, values[name]))
        if value is None or not least <= value <= most:
            raise ConfigurationError("%s is %.60r; expected a number from %g to %g" % (
                name, given.get(name), least, most))
        values[name] = float(value)
    frame = given.get("base_link_frame", values["base_link_frame"])
    if not isinstance(frame, str) or not frame:
        raise ConfigurationError("base_link_frame is %.60r; expected a name" % (frame,))
    return Settings(**dict(values, base_link_frame=frame))


def points(active: int, settings: Settings) -> NDArray[np.float32]:
    """Return the points (3, 3) float32 of the left, central and right sensor, in the base's frame [m].

    Parameters
    ----------
    active : int
        Bits of the sensors that are active.
    settings : Settings
    """
    found = []
    for bit, side in ((LEFT, 1.0), (CENTRE, 0.0), (RIGHT, -1.0)):
        radius = settings.pointcloud_radius if active & bit else FAR
        angle = settings.side_point_angle if side else 0.5 * math.pi
        found.append((radius * math.sin(angle), side * radius * math.cos(angle), settings.pointcloud_height))
    return np.array(found, np.float32)
