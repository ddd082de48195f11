# SPDX-License-Identifier: BSD-3-Clause
"""Generated floor plans: the same kind and random generator give the same building.

A new kind is one function and one line in :data:`KINDS`.
"""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Callable, Dict, List, NamedTuple, Tuple

import numpy as np

from m2wr_tools.buildings.floor_plan import FloorPlan
from m2wr_tools.buildings.rooms import Rect, enclose, hull, split

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray
    from m2wr_tools.buildings.rooms import Wall

ROOM = 0.75                 # least distance of a place to visit from walls and furniture [m]
LANE = 1.1                  # free width that furniture leaves [m]
_TRIES = 60                 # for a piece of furniture or a place


class Layout(NamedTuple):
    """Rooms with their walls, before furniture."""

    rooms: List[Rect]
    walls: List[Wall]
    furniture: Tuple[int, int]      # least and greatest number of pieces in a room
    visits: int                     # places to visit in a room


def generate(kind: str, rng: np.random.Generator, glass_share: float = 0.0) -> FloorPlan:
    """Return a building.

    Parameters
    ----------
    kind : str
        A key of :data:`KINDS`.
    rng : numpy.random.Generator
    glass_share : float
        Probability that a wall is of glass.

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    if kind not in KINDS:
        raise ValueError("no kind of building %r; expected one of %s" % (kind, ", ".join(sorted(KINDS))))
    layout = KINDS[kind](rng)
    walls = np.array(layout.walls)
    bare = FloorPlan(kind, walls, rng.random(len(walls)) < glass_share, np.empty((0, 5)), np.empty((0, 3)),
                     np.empty((0, 2)))
    furnished = _furnish(bare, layout, rng)
    return replace(furnished, places=_places(furnished, layout, rng))


def _furnish(plan: FloorPlan, layout: Layout, rng: np.random.Generator) -> FloorPlan:
    """Put boxes and pillars into the rooms, each at a wall or with a free lane around it."""
    boxes: List[Tuple[float, ...]] = []
    pillars: List[Tuple[float, ...]] = []
    for room in layout.rooms:
        for _ in range(int(rng.integers(layout.furniture[0], layout.furniture[1] + 1))):
            for _ in range(_TRIES):
                at = np.array([[rng.uniform(room.x0, room.x1), rng.uniform(room.y0, room.y1)]])
                round_one = rng.random() < 0.3
                size = rng.uniform(0.15, 0.4) if round_one else rng.uniform(0.3, 1.2)
                width = rng.uniform(0.3, 0.8)
                reach = size if round_one else 0.5 * float(np.hypot(size, width))
                if plan.clearance(at)[0] < reach + LANE:
                    continue
                if round_one:
                    pillars.append((at[0, 0], at[0, 1], size))
                else:
                    boxes.append((at[0, 0], at[0, 1], size, width, rng.uniform(0.0, np.pi)))
                plan = replace(plan, boxes=np.array(boxes).reshape(-1, 5), pillars=np.array(pillars).reshape(-1, 3))
                break
    return plan


def _places(plan: FloorPlan, layout: Layout, rng: np.random.Generator) -> FloatArray:
    found = []
    for room in layout.rooms:
        for _ in range(layout.visits):
            inner = room.inset(min(ROOM, 0.45 * min(room.width, room.depth)))
            points = np.column_stack([rng.uniform(inner.x0, inner.x1, _TRIES), rng.uniform(inner.y0, inner.y1, _TRIES)])
            free = points[plan.clearance(points) >= ROOM]
            if len(free):
                found.append(free[0])
    return np.array(found).reshape(-1, 2)


def _band(rect: Rect, rng: np.random.Generator) -> List[Rect]:
    """Divide a band of rooms along a corridor."""
    return split(rect, rng.uniform(3.0, 4.5), rng)


def office(rng: np.random.Generator) -> Layout:
    """Return rooms on both sides of a corridor that runs round a core."""
    width, depth = rng.uniform(24.0, 44.0), rng.uniform(20.0, 30.0)
    band, corridor = rng.uniform(4.0, 5.5), rng.uniform(1.8, 2.6)
    ring = Rect(0.0, 0.0, width, depth).inset(band)
    core = ring.inset(corridor)
    halls = [ring._replace(y1=core.y0), ring._replace(y0=core.y1),
             ring._replace(x1=core.x0, y0=core.y0, y1=core.y1), ring._replace(x0=core.x1, y0=core.y0, y1=core.y1)]
    rooms = _band(Rect(0.0, 0.0, width, band), rng) + _band(Rect(0.0, depth - band, width, depth), rng)
    rooms += _band(Rect(0.0, band, band, depth - band), rng) + _band(Rect(width - band, band, width, depth - band), rng)
    rooms += split(core, 3.5, rng)
    everything = halls + rooms
    corridors = [True] * len(halls) + [False] * len(rooms)
    walls = enclose(everything, corridors, [False] * len(everything), (0.7, 0.1), rng)
    return Layout(everything, walls, (0, 2), 1)


def house(rng: np.random.Generator) -> Layout:
    """Return rooms beside rooms, some with several doors."""
    rooms = split(Rect(0.0, 0.0, rng.uniform(10.0, 18.0), rng.uniform(8.0, 14.0)), 3.0, rng)
    plain = [False] * len(rooms)
    return Layout(rooms, enclose(rooms, plain, plain, (0.5, 0.5), rng), (0, 3), 2)


def corridors(rng: np.random.Generator) -> Layout:
    """Return corridors that cross, between blocks that are filled or divided into rooms."""
    columns, lines = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    wide = rng.uniform(1.6, 2.6)
    xs = np.cumsum(np.concatenate([[0.0], np.ravel([[wide, rng.uniform(6.0, 16.0)] for _ in range(columns)]), [wide]]))
    ys = np.cumsum(np.concatenate([[0.0], np.ravel([[wide, rng.uniform(5.0, 12.0)] for _ in range(lines)]), [wide]]))
    rooms: List[Rect] = []
    is_corridor: List[bool] = []
    solid: List[bool] = []
    for column in range(2 * columns + 1):
        for line in range(2 * lines + 1):
            cell = Rect(float(xs[column]), float(ys[line]), float(xs[column + 1]), float(ys[line + 1]))
            block = bool(column % 2 and line % 2)
            parts = split(cell, 3.5, rng) if block and rng.random() < 0.6 else [cell]
            filled = block and len(parts) == 1
            rooms += parts
            is_corridor += [not block] * len(parts)
            solid += [filled] * len(parts)
    walls = enclose(rooms, is_corridor, solid, (0.6, 0.1), rng)
    free = [room for room, filled in zip(rooms, solid) if not filled]
    return Layout(free, walls, (0, 1), 1)


def hall(rng: np.random.Generator) -> Layout:
    """Return one large room with free-standing walls and much furniture."""
    whole = Rect(0.0, 0.0, rng.uniform(16.0, 40.0), rng.uniform(14.0, 30.0))
    walls = hull([whole])
    for _ in range(int(rng.integers(3, 8))):
        length, yaw = rng.uniform(2.0, 7.0), rng.choice([0.0, 0.5 * np.pi]) + rng.normal(0.0, 0.05)
        reach = 0.5 * length * np.array([np.cos(yaw), np.sin(yaw)])
        middle = np.array([rng.uniform(5.0, whole.x1 - 5.0), rng.uniform(5.0, whole.y1 - 5.0)])
        walls.append((*(middle - reach), *(middle + reach)))
    return Layout([whole], walls, (8, 22), 14)


#: Kind -> function from a random generator to a layout.
KINDS: Dict[str, Callable[[np.random.Generator], Layout]] = {
    "corridors": corridors, "hall": hall, "house": house, "office": office}
