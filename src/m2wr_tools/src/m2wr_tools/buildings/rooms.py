# SPDX-License-Identifier: BSD-3-Clause
"""Divides rectangles into rooms and gives the borders between them walls and doors."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, List, NamedTuple, Optional, Sequence, Tuple

if TYPE_CHECKING:
    import numpy as np

DOOR = (1.2, 1.6)           # clear width of a door; m2wr needs 0.9 m to turn on the spot [m]
POST = 0.2                  # least wall beside a door [m]
_SAME = 1e-6               # borders nearer than this are the same [m]

Wall = Tuple[float, float, float, float]


class Rect(NamedTuple):
    """An upright rectangle: least x and y, greatest x and y [m]."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width(self) -> float:
        """Extent along x [m]."""
        return self.x1 - self.x0

    @property
    def depth(self) -> float:
        """Extent along y [m]."""
        return self.y1 - self.y0

    @property
    def centre(self) -> Tuple[float, float]:
        """Its middle (x, y) [m]."""
        return 0.5 * (self.x0 + self.x1), 0.5 * (self.y0 + self.y1)

    def inset(self, distance: float) -> Rect:
        """Return the rectangle without a margin of ``distance`` [m]."""
        return Rect(self.x0 + distance, self.y0 + distance, self.x1 - distance, self.y1 - distance)


@dataclass(frozen=True)
class Border:
    """A line that two rooms share.

    Attributes
    ----------
    first, second : int
        Indices of the rooms.
    vertical : bool
        Whether it runs along y.
    at, low, high : float
        Its fixed coordinate, and its ends [m].
    """

    first: int
    second: int
    vertical: bool
    at: float
    low: float
    high: float

    def wall(self, low: float, high: float) -> Wall:
        """Return a piece of it.

        Parameters
        ----------
        low, high : float
            Its ends [m].

        Returns
        -------
        (4,) float
            x0, y0, x1, y1 [m].
        """
        return (self.at, low, self.at, high) if self.vertical else (low, self.at, high, self.at)


def split(rect: Rect, least: float, rng: np.random.Generator) -> List[Rect]:
    """Divide a rectangle into rooms, halving the longer side at random places.

    Parameters
    ----------
    rect : Rect
    least : float
        Least extent of a room [m].
    rng : numpy.random.Generator

    Returns
    -------
    list of Rect
    """
    longest = max(rect.width, rect.depth)
    if longest < 2.0 * least or (longest < 3.0 * least and rng.random() < 0.3):
        return [rect]
    share = rng.uniform(least, longest - least)
    if rect.width >= rect.depth:
        parts = rect._replace(x1=rect.x0 + share), rect._replace(x0=rect.x0 + share)
    else:
        parts = rect._replace(y1=rect.y0 + share), rect._replace(y0=rect.y0 + share)
    return [room for part in parts for room in split(part, least, rng)]


def borders(rooms: Sequence[Rect]) -> List[Border]:
    """Return the borders of all pairs of neighbouring rooms."""
    found = []
    for first, one in enumerate(rooms):
        for second in range(first + 1, len(rooms)):
            other = rooms[second]
            for vertical, at, beside in ((True, one.x1, other.x0), (True, one.x0, other.x1),
                                         (False, one.y1, other.y0), (False, one.y0, other.y1)):
                if abs(at - beside) > _SAME:
                    continue
                low, high = (max(one.y0, other.y0), min(one.y1, other.y1)) if vertical else (
                    max(one.x0, other.x0), min(one.x1, other.x1))
                if high - low > _SAME:
                    found.append(Border(first, second, vertical, at, low, high))
    return found


def hull(rooms: Sequence[Rect]) -> List[Wall]:
    """Return the four outer walls of rooms that fill a rectangle."""
    x0, y0 = min(room.x0 for room in rooms), min(room.y0 for room in rooms)
    x1, y1 = max(room.x1 for room in rooms), max(room.y1 for room in rooms)
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


class _Groups:
    """Rooms that doors connect (union-find)."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))

    def of(self, room: int) -> int:
        while self._parent[room] != room:
            room = self._parent[room]
        return room

    def join(self, one: int, other: int) -> bool:
        one, other = self.of(one), self.of(other)
        self._parent[one] = other
        return one != other


def enclose(rooms: Sequence[Rect], corridors: Sequence[bool], solid: Sequence[bool], doors: Tuple[float, float],
            rng: np.random.Generator) -> List[Wall]:
    """Return the walls of all rooms, with doors such that all rooms that are not solid are connected.

    Neighbouring corridors have no wall between them.

    Parameters
    ----------
    rooms : sequence of Rect
        They fill a rectangle.
    corridors, solid : sequence of bool
        Which rooms are corridors; which are filled and have no door.
    doors : (float, float)
        Probability of a door between a room and a corridor, and between two rooms.
    rng : numpy.random.Generator
    """
    lines = borders(rooms)
    groups, has_door = _Groups(len(rooms)), {}
    for line in lines:
        kinds = corridors[line.first] + corridors[line.second]
        wide_enough = line.high - line.low >= DOOR[0] + 2.0 * POST
        usable = wide_enough and not (solid[line.first] or solid[line.second])
        has_door[line] = usable and (kinds == 2 or bool(rng.random() < doors[0 if kinds else 1]))
        if has_door[line]:
            groups.join(line.first, line.second)
    for index in rng.permutation(len(lines)):
        line = lines[int(index)]
        if (not has_door[line] and line.high - line.low >= DOOR[0] + 2.0 * POST
                and not (solid[line.first] or solid[line.second]) and groups.join(line.first, line.second)):
            has_door[line] = True
    walls = hull(rooms)
    for line in lines:
        open_border = corridors[line.first] and corridors[line.second] and has_door[line]
        if not open_border and not (solid[line.first] and solid[line.second]):
            walls.extend(_pierced(line, _gap(line, rng) if has_door[line] else None))
    return walls


def _gap(line: Border, rng: np.random.Generator) -> Tuple[float, float]:
    width = min(rng.uniform(*DOOR), line.high - line.low - 2.0 * POST)
    low = line.low + POST + rng.random() * max(0.0, line.high - line.low - 2.0 * POST - width)
    return low, low + width


def _pierced(line: Border, gap: Optional[Tuple[float, float]]) -> List[Wall]:
    if gap is None:
        return [line.wall(line.low, line.high)]
    return [line.wall(low, high) for low, high in ((line.low, gap[0]), (gap[1], line.high))]
