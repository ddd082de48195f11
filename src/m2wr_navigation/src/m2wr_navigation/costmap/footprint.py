# SPDX-License-Identifier: BSD-3-Clause
"""The outline of the robot: read from parameters, padded, measured."""
from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from m2wr_node.numbers import number

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

MOST_CORNERS = 1000
FARTHEST = 100.0            # m: no robot has a corner farther from its centre
CIRCLE_CORNERS = 16         # of costmap_2d's polygon for robot_radius
_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_PAIR = re.compile(r"[\[(]\s*({0})\s*,\s*({0})\s*[\])]".format(_NUMBER))


class FootprintError(ValueError):
    """A footprint cannot be used; the message says why."""


def parse(value: object) -> FloatArray:
    """Return the corners (K, 2) of a footprint [m].

    Parameters
    ----------
    value : str or list
        ``"[[0.1, 0.2], ...]"`` or a list of pairs, in the base frame.

    Raises
    ------
    FootprintError
        If it is not a polygon of three or more corners without crossing sides.
    """
    if isinstance(value, str):
        if len(value) > 100 * MOST_CORNERS:
            raise FootprintError("the footprint is a text of {} characters; expected at most {} corners".format(
                len(value), MOST_CORNERS))
        pairs = [[float(part) for part in pair] for pair in _PAIR.findall(value)]
        rest = re.sub(r"[\s,\[\]()]", "", _PAIR.sub("", value))
        if rest:
            raise FootprintError("the footprint is {!r}; expected [[x, y], [x, y], ...]".format(value[:200]))
    elif isinstance(value, (list, tuple)):
        pairs = []
        for pair in value:
            numbers = [number(part) for part in pair] if isinstance(pair, (list, tuple)) else []
            if len(numbers) != 2 or None in numbers:
                raise FootprintError("the footprint has the corner {!r}; expected two numbers".format(pair))
            pairs.append([float(part) for part in numbers if part is not None])
    else:
        raise FootprintError("the footprint is {!r}; expected a list of corners [x, y]".format(value))
    return checked(np.array(pairs, float).reshape(-1, 2))


def checked(corners: FloatArray) -> FloatArray:
    """Return corners (K, 2) counter-clockwise, or raise FootprintError with the reason why they cannot be used."""
    if not 3 <= len(corners) <= MOST_CORNERS:
        raise FootprintError("the footprint has {} corners; expected 3 to {}".format(len(corners), MOST_CORNERS))
    if not (np.abs(corners) <= FARTHEST).all():
        raise FootprintError("the footprint has a corner that is not within {:g} m".format(FARTHEST))
    crossing = _crossing(corners)
    if crossing is not None:
        raise FootprintError("sides {} and {} of the footprint cross; expected corners in order".format(*crossing))
    x, y = corners.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    if abs(area) < 1e-8:
        raise FootprintError("the footprint has no area; expected corners that are not on one line")
    return corners if area > 0 else corners[::-1].copy()


def _crossing(corners: FloatArray) -> Optional[Tuple[int, int]]:
    """Return the numbers of two sides that cross, or None."""
    begin, end = corners, np.roll(corners, -1, 0)

    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        turned: FloatArray = (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) \
            - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
        return turned

    for k in range(len(corners)):
        apart = side(begin[k], end[k], begin) * side(begin[k], end[k], end) < 0
        across = side(begin, end, begin[k]) * side(begin, end, end[k]) < 0
        found = np.nonzero(apart & across)[0]
        if len(found):
            return k, int(found[0])
    return None


def circle(radius: float) -> FloatArray:
    """Return the polygon (16, 2) that stands for a round robot of a radius [m]."""
    angles = np.arange(CIRCLE_CORNERS) * (2.0 * math.pi / CIRCLE_CORNERS)
    return radius * np.stack([np.cos(angles), np.sin(angles)], -1)


def padded(corners: FloatArray, padding: float) -> FloatArray:
    """Return corners (K, 2) moved outwards by ``padding`` along x and y, by the signs of their coordinates.

    Parameters
    ----------
    corners : (K, 2) float64
        [m]
    padding : float
        [m]
    """
    return corners + padding * np.sign(corners)


def radii(corners: FloatArray) -> Tuple[float, float]:
    """Return the inscribed and the circumscribed radius of a footprint about the base frame's origin [m].

    Parameters
    ----------
    corners : (K, 2) float64
        [m]

    Returns
    -------
    inscribed : float
        Least distance from the origin to a side.
    circumscribed : float
        Greatest distance from the origin to a corner.
    """
    begin, along = corners, np.roll(corners, -1, 0) - corners
    squares = np.maximum(np.sum(along * along, -1), 1e-18)
    share = np.clip(-np.sum(begin * along, -1) / squares, 0.0, 1.0)
    nearest = begin + share[:, None] * along
    return float(np.hypot(*nearest.T).min()), float(np.hypot(*corners.T).max())


def half_width(corners: FloatArray) -> float:
    """Return what a footprint needs on each side of the line that the base frame's origin drives along [m].

    Parameters
    ----------
    corners : (K, 2) float64
        [m]

    Returns
    -------
    float
        Greatest distance of a corner from the x axis, on the wider side.
    """
    return float(np.abs(corners[:, 1]).max())


def placed(corners: FloatArray, pose: FloatArray) -> FloatArray:
    """Return points at a pose, such as the corners of a footprint, in the frame of the pose [m].

    Parameters
    ----------
    corners : (K, 2) or (2,) float64
        In the frame that has the pose, such as the base frame [m].
    pose : (3,) float64
        [m, m, rad]
    """
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return corners @ np.array([[cosine, sine], [-sine, cosine]]) + np.asarray(pose[:2], float)
