# SPDX-License-Identifier: BSD-3-Clause
"""A place with obstacles that move: actors on straight lines, to and fro, who react to nothing."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Sequence, Tuple

import numpy as np

from m2wr_view.outlines import point_distances

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_view.outlines import Outline

SIDE = 16.0                 # m
PILLARS = 6
RADIUS, HEIGHT = 0.25, 1.0  # m, of an obstacle that moves
SLOW, FAST = 0.2, 0.4       # m/s, mean speed on a line; the greatest is 1.5 times that
SHORT, LONG = 2.0, 6.0      # m, of a line
GAP = 0.1                   # m, least, to an obstacle that stands
FREE = 1.5                  # m around the start, where none begins
MOST = 200                  # moving obstacles
TRIES = 10000

_ACTOR = """
<actor name="mover_{k}"><pose>{x:.3f} {y:.3f} 0 0 0 {yaw:.4f}</pose>
<link name="body"><pose>0 0 {z:g} 0 0 0</pose>{shapes}</link>
<script><loop>true</loop><delay_start>0</delay_start><auto_start>true</auto_start>
<trajectory id="0" type="line" tension="1.0">
{points}</trajectory></script></actor>"""
_POINT = "<waypoint><time>{:.2f}</time><pose>{:.3f} {:.3f} 0 0 0 {:.4f}</pose></waypoint>\n"


def pillars(random: np.random.Generator) -> List[Tuple[float, float, float]]:
    """Return pillars of the place: centre x, y, radius [m]."""
    inside = 0.5 * SIDE - 2.0
    return [(float(x), float(y), float(radius)) for x, y, radius in np.column_stack(
        [random.uniform(-inside, inside, (PILLARS, 2)), random.uniform(0.2, 0.5, PILLARS)])]


def actors(count: int, random: np.random.Generator, obstacles: Sequence[Outline], start: Vector) -> str:
    """Return actors in SDF.

    Parameters
    ----------
    count : int
    random : Generator
    obstacles : sequence of Outline
        That stand; the lines keep away from them.
    start : (2,) float
        Where the robot starts [m].

    Raises
    ------
    ValueError
        If there is no room for so many.
    """
    found: List[str] = []
    inside = 0.5 * SIDE - RADIUS - GAP
    for _ in range(TRIES):
        if len(found) == count:
            return "".join(found)
        begin, heading = random.uniform(-inside, inside, 2), random.uniform(-math.pi, math.pi)
        length = random.uniform(SHORT, LONG)
        end = begin + length * np.array([math.cos(heading), math.sin(heading)])
        speed, share = random.uniform(SLOW, FAST), random.uniform(0.1, 0.9)
        first = begin + share * (end - begin)
        line = begin + np.linspace(0.0, 1.0, 1 + int(length / 0.1))[:, None] * (end - begin)
        if np.abs(end).max() > inside or math.hypot(first[0] - start[0], first[1] - start[1]) < FREE:
            continue
        if obstacles and min(float(point_distances(line, one).min()) for one in obstacles) < RADIUS + GAP:
            continue
        found.append(_actor(len(found), first, end, begin, speed))
    raise ValueError("no room for {} moving obstacles; expected fewer".format(count))


def _actor(number: int, first: FloatArray, end: FloatArray, begin: FloatArray, speed: float) -> str:
    """Return an actor that goes from a point to the end, to the begin and back to the point [m, m/s]."""
    there, back = float(np.hypot(*(end - first))) / speed, float(np.hypot(*(end - begin))) / speed
    rest = float(np.hypot(*(first - begin))) / speed
    yaw = math.atan2(end[1] - first[1], end[0] - first[0])
    times = np.cumsum([0.0, there, back, rest])
    points = "".join(_POINT.format(time, x, y, yaw) for time, (x, y) in zip(times, (first, end, begin, first)))
    shape = "<geometry><cylinder><radius>{:g}</radius><length>{:g}</length></cylinder></geometry>".format(
        RADIUS, HEIGHT)
    shapes = "".join("<{0} name=\"{0}\">{1}</{0}>".format(kind, shape) for kind in ("collision", "visual"))
    return _ACTOR.format(k=number, x=first[0], y=first[1], yaw=yaw, z=0.5 * HEIGHT, shapes=shapes, points=points)
