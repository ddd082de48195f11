# SPDX-License-Identifier: BSD-3-Clause
"""Generated floor plans: the same kind and random generator give the same building.

A new kind is one function and one line in :data:`KINDS`.
"""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Callable, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from m2wr_tools.buildings.floor_plan import FloorPlan
from m2wr_tools.buildings.rooms import Rect, enclose, hull, split

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_tools.buildings.rooms import Wall

    Point = Tuple[float, float]

ROOM = 0.75                 # least distance of a place to visit from walls and furniture [m]
LANE = 1.1                  # free width that furniture leaves [m]
_TRIES = 60                 # for a piece of furniture or a place
_OFF_ROUTE = 0.4            # greatest distance of a place from the line of its route, along each axis [m]


class Layout(NamedTuple):
    """Rooms with their walls, before furniture."""

    rooms: List[Rect]
    walls: List[Wall]
    furniture: Tuple[int, int]      # least and greatest number of pieces in a room
    visits: int                     # places to visit in a room
    route: Tuple[Point, ...] = ()   # places of a tour in their order [m], instead of places in the rooms


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
    if layout.route:
        return replace(furnished, places=_along(furnished, layout.route, rng), in_order=True)
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
                if plan.clearance(at)[0] < reach + LANE or _distance(at, layout.route) < reach + ROOM + _OFF_ROUTE:
                    continue
                if round_one:
                    pillars.append((at[0, 0], at[0, 1], size))
                else:
                    boxes.append((at[0, 0], at[0, 1], size, width, rng.uniform(0.0, np.pi)))
                plan = replace(plan, boxes=np.array(boxes).reshape(-1, 5), pillars=np.array(pillars).reshape(-1, 3))
                break
    return plan


def _distance(point: FloatArray, route: Sequence[Point]) -> float:
    """Return the distance [m] of a point (1, 2) from the nearest one of a route."""
    return float(np.hypot(*(np.reshape(route, (-1, 2)) - point).T).min(initial=np.inf))


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


def _along(plan: FloorPlan, route: Sequence[Point], rng: np.random.Generator) -> FloatArray:
    """Return a free place near each point of a route."""
    found = []
    for point in route:
        points = np.array(point) + rng.uniform(-_OFF_ROUTE, _OFF_ROUTE, (_TRIES, 2))
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


class _Blocks(NamedTuple):
    """Rectangles that fill a building: corridors, and between them blocks that are divided into rooms or filled."""

    rooms: List[Rect]
    corridor: List[bool]
    solid: List[bool]

    @property
    def free(self) -> List[Rect]:
        """The rooms and corridors."""
        return [room for room, filled in zip(self.rooms, self.solid) if not filled]

    def crossing(self, column: int, line: int, wide: float) -> Point:
        """Return the middle of the crossing after so many columns and lines of blocks.

        Parameters
        ----------
        column, line : int
        wide : float
            Width of the corridors [m].
        """
        xs = sorted({room.x0 for room, corridor in zip(self.rooms, self.corridor) if corridor})
        ys = sorted({room.y0 for room, corridor in zip(self.rooms, self.corridor) if corridor})
        return xs[2 * column] + 0.5 * wide, ys[2 * line] + 0.5 * wide

    def walls(self, doors: Tuple[float, float], rng: np.random.Generator) -> List[Wall]:
        """Return all walls, with doors of these probabilities to corridors and to other rooms."""
        return enclose(self.rooms, self.corridor, self.solid, doors, rng)


def _blocks(widths: Vector, depths: Vector, wide: float, share: float, least: float,
            rng: np.random.Generator) -> _Blocks:
    """Return blocks of these extents with corridors between and around them.

    Parameters
    ----------
    widths, depths : sequence of float
        Of the columns and lines of blocks [m].
    wide : float
        Width of all corridors [m].
    share : float
        Probability that a block is divided into rooms; the others are filled.
    least : float
        Least extent of a room [m].
    rng : numpy.random.Generator
    """
    xs = np.cumsum([0.0, wide] + [value for width in widths for value in (width, wide)])
    ys = np.cumsum([0.0, wide] + [value for depth in depths for value in (depth, wide)])
    made = _Blocks([], [], [])
    for column in range(len(xs) - 1):
        for line in range(len(ys) - 1):
            cell = Rect(float(xs[column]), float(ys[line]), float(xs[column + 1]), float(ys[line + 1]))
            block = bool(column % 2 and line % 2)
            parts = split(cell, least, rng) if block and rng.random() < share else [cell]
            made.rooms.extend(parts)
            made.corridor.extend([not block] * len(parts))
            made.solid.extend([block and len(parts) == 1] * len(parts))
    return made


def corridors(rng: np.random.Generator) -> Layout:
    """Return corridors that cross, between blocks that are filled or divided into rooms."""
    columns, lines = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    made = _blocks(rng.uniform(6.0, 16.0, columns), rng.uniform(5.0, 12.0, lines), rng.uniform(1.6, 2.6), 0.6, 3.5, rng)
    return Layout(made.free, made.walls((0.6, 0.1), rng), (0, 1), 1)


def large(rng: np.random.Generator) -> Layout:
    """Return a building of about 100 m x 60 m: long corridors that cross, rooms and courtyards between them.

    The tour is a walk through the corridors that does not turn back, with detours into rooms.
    """
    columns, lines = int(rng.integers(3, 5)), int(rng.integers(2, 4))
    wide = rng.uniform(2.0, 2.8)
    made = _blocks(rng.uniform(0.9, 1.1, columns) * 100.0 / columns - wide,
                   rng.uniform(0.9, 1.1, lines) * 60.0 / lines - wide, wide, 0.6, 6.0, rng)
    rooms = [room for room, corridor, solid in zip(made.rooms, made.corridor, made.solid) if not corridor and not solid]
    route: List[Point] = []
    for crossing in _walk(columns, lines, 60, rng):
        route.append(made.crossing(*crossing, wide))
        if rooms and rng.random() < 0.2:
            route.append(min(rooms, key=lambda room: float(np.hypot(*np.subtract(room.centre, route[-1])))).centre)
    return Layout(made.free, made.walls((0.3, 0.1), rng), (0, 1), 1, tuple(route))


def _walk(columns: int, lines: int, count: int, rng: np.random.Generator) -> List[Tuple[int, int]]:
    """Return the crossings (column, line) of a walk through a grid of corridors that never turns back."""
    found, before = [(0, 0)], (-1, -1)
    while len(found) < count:
        column, line = found[-1]
        ways = [(x, y) for x, y in ((column + 1, line), (column - 1, line), (column, line + 1), (column, line - 1))
                if 0 <= x <= columns and 0 <= y <= lines and (x, y) != before]
        before = found[-1]
        found.append(ways[int(rng.integers(len(ways)))])
    return found


def aisles(rng: np.random.Generator) -> Layout:
    """Return a store: equal parallel aisles between equal shelves, which a laser cannot tell apart.

    The tour goes along one aisle after the other, in any order.
    """
    count, shelf, wide = int(rng.integers(4, 8)), rng.uniform(1.0, 1.6), rng.uniform(2.0, 2.6)
    made = _blocks([shelf] * count, [rng.uniform(14.0, 24.0)], wide, 0.0, shelf, rng)
    route: List[Point] = []
    for number in range(20):
        column = int(rng.integers(count + 1))
        route += [made.crossing(column, line, wide) for line in ((0, 1) if number % 2 else (1, 0))]
    return Layout(made.free, made.walls((0.0, 0.0), rng), (0, 0), 1, tuple(route))


def loops(rng: np.random.Generator) -> Layout:
    """Return a hall round two filled cores, where the robot drives round one, both and the other, again and again."""
    wide = rng.uniform(3.0, 4.5)
    made = _blocks(rng.uniform(14.0, 36.0, 2), [rng.uniform(14.0, 30.0)], wide, 0.0, wide, rng)
    corners = [made.crossing(column, line, wide) for line in range(2) for column in range(3)]
    route = tuple(corners[index] for index in (0, 1, 4, 3, 0, 1, 2, 5, 4, 3, 0, 1, 2, 5, 4, 1, 2, 5, 4, 3))
    return Layout(made.free, made.walls((0.0, 0.0), rng), (0, 1), 1, route)


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
    "aisles": aisles, "corridors": corridors, "hall": hall, "house": house, "large": large, "loops": loops,
    "office": office}
