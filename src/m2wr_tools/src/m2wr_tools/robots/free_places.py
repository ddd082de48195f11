# SPDX-License-Identifier: BSD-3-Clause
"""Finds free places for many robots in a world, at a distance from each other and connected by free space.

The search is in the plane: a collision shape between the heights of the floor and the robot counts as the convex hull
of its projection, a robot as a disc.  The floor plane is no obstacle.  The search spreads from the wanted centre over
free cells, so robots do not start on the other side of a wall around it.
"""
from __future__ import annotations

import itertools
import math
from collections import deque
from typing import TYPE_CHECKING, Deque, Iterable, Iterator, List, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_sim.errors import WorldError
from m2wr_sim.geometry import rotate
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import Box, Cylinder, Plane, Sphere

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.types import World

LAYOUTS = ("grid", "circle", "random")
_CELL = 0.25                # m, of the map of free places
_LOW, _HIGH = 0.005, 0.5    # m: a shape that ends below or begins above is driven over or under
_WIDEST = 100.0             # m from the centre: limit of the search
_RIM_POINTS = 16            # of the outline of a round shape, drawn around it


def find_places(world: World, count: int, layout: str = "grid", centre: Sequence[float] = (0.0, 0.0),
                spacing: float = 1.2, radius: float = 0.45, yaw: float = 0.0,
                seed: int = 0) -> List[Tuple[float, float, float]]:
    """Find places for robots.

    Parameters
    ----------
    world : World
        With all obstacles, in its initial state.
    count : int
        Number of robots.
    layout : str
        ``grid``: squares of ``spacing``, nearest to the centre first, all heading ``yaw``; ``circle``: rings around the
        centre, heading outwards; ``random``: random places near the centre, random headings.
    centre : (float, float)
        x, y [m] around which to place them.
    spacing : float
        Least distance between two robots [m].
    radius : float
        Of the disc around each robot that is kept free of the world [m].
    yaw : float
        Heading [rad].
    seed : int
        For ``random``; the same seed gives the same places.

    Returns
    -------
    list of (float, float, float)
        x, y [m] and yaw [rad].

    Raises
    ------
    ValueError
        If an argument makes no sense.
    WorldError
        If the world has too few places.
    """
    if layout not in LAYOUTS:
        raise ValueError("layout %r; expected one of %s" % (layout, ", ".join(LAYOUTS)))
    if count < 1:
        raise ValueError("%r robots; expected at least 1" % (count,))
    if not (0.0 < radius < math.inf and 2.0 * radius <= spacing < math.inf):
        raise ValueError("spacing of %r m between robots of radius %r m; expected at least two positive radii"
                         % (spacing, radius))
    if not all(math.isfinite(value) for value in tuple(centre) + (yaw,)):
        raise ValueError("centre %r with heading %r; expected finite numbers" % (centre, yaw))
    outlines = [outline for outline in _outlines(world) if outline is not None]
    generator = np.random.default_rng(seed)
    reach = 2.0 * spacing * (math.sqrt(count) + 2.0)
    while True:
        free = _Free(outlines, centre, min(reach, _WIDEST), radius)
        places = _choose(free, count, layout, centre, spacing, yaw, generator)
        if len(places) == count:
            return places
        if reach >= _WIDEST or free.closed:
            raise WorldError("only %d of %d places found around (%g, %g): %g m apart, %g m from all obstacles; "
                             "use fewer robots, another centre or less spacing"
                             % (len(places), count, centre[0], centre[1], spacing, radius))
        reach *= 2.0


def _choose(free: _Free, count: int, layout: str, centre: Sequence[float], spacing: float, yaw: float,
            generator: np.random.Generator) -> List[Tuple[float, float, float]]:
    """Return up to ``count`` places out of the free ones."""
    wanted: Iterable[Tuple[float, float, float]]
    if layout == "grid":
        steps = range(-int(free.reach / spacing), int(free.reach / spacing) + 1)
        lattice = sorted(itertools.product(steps, steps), key=lambda cell: (cell[0] ** 2 + cell[1] ** 2, cell))
        wanted = ((centre[0] + spacing * i, centre[1] + spacing * j, yaw) for i, j in lattice)
    elif layout == "circle":
        wanted = _rings(centre, spacing, count, free.reach)
    else:
        wanted = _anywhere(free, spacing, count, generator)
    places: List[Tuple[float, float, float]] = []
    for place in wanted:
        if free.at(place[0], place[1]) and all(math.hypot(place[0] - other[0], place[1] - other[1]) >= spacing - 1e-9
                                               for other in places):
            places.append(place)
            if len(places) == count:
                break
    return places


def _rings(centre: Sequence[float], spacing: float, count: int, reach: float) -> Iterator[Tuple[float, float, float]]:
    """Yield places on a ring wide enough for all, then on the rings outside and inside it."""
    first = 0.0 if count == 1 else max(0.5 * spacing / math.sin(math.pi / count), spacing)
    rings = [first + spacing * k for k in range(max(1, int((reach - first) / spacing) + 1))]
    for ring in rings + [first - spacing * k for k in range(1, int(first / spacing) + 1)]:
        number = count if ring == first else max(1, int(2.0 * math.pi * ring / spacing))
        for k in range(number):
            angle = 2.0 * math.pi * k / number
            yield centre[0] + ring * math.cos(angle), centre[1] + ring * math.sin(angle), angle


def _anywhere(free: _Free, spacing: float, count: int,
              generator: np.random.Generator) -> Iterator[Tuple[float, float, float]]:
    """Yield free cells in random order, moved by a part of a cell, from an area that has more places than needed."""
    cells = free.cells()
    near = cells[np.argsort(np.hypot(cells[:, 0] - free.centre[0], cells[:, 1] - free.centre[1]), kind="stable")]
    enough = int(4.0 * count * (spacing / _CELL) ** 2)
    for x, y in near[generator.permutation(min(len(near), enough))]:
        shift = generator.uniform(-0.4, 0.4, 2) * _CELL
        yield float(x + shift[0]), float(y + shift[1]), float(generator.uniform(-math.pi, math.pi))


class _Free:
    """The cells around a centre from which and to which a disc can go.

    ``closed``: walls enclose the free area within ``reach``.
    """

    def __init__(self, outlines: Iterable[FloatArray], centre: Sequence[float], reach: float, radius: float) -> None:
        self.centre, self.reach, self._radius = centre, reach, radius
        self._side = 2 * int(math.ceil(reach / _CELL)) + 1
        self._origin = (centre[0] - _CELL * (self._side // 2), centre[1] - _CELL * (self._side // 2))
        self._near: List[FloatArray] = []
        blocked = np.zeros((self._side, self._side), bool)
        axis = _CELL * np.arange(self._side)
        for outline in outlines:
            low, high = outline.min(axis=0) - radius, outline.max(axis=0) + radius
            window = tuple(slice(max(0, int((low[k] - self._origin[k]) / _CELL)),
                                 max(0, int((high[k] - self._origin[k]) / _CELL) + 2)) for k in (0, 1))
            x, y = self._origin[0] + axis[window[0]], self._origin[1] + axis[window[1]]
            if len(x) and len(y):
                self._near.append(outline)
                blocked[window] |= _distance(outline, x[:, None], y[None, :]) < radius
        self._reachable, self.closed = _flood(blocked)

    def at(self, x: float, y: float) -> bool:
        """Return whether a disc at x, y is free, and its cell reachable."""
        i = int(round((x - self._origin[0]) / _CELL))
        j = int(round((y - self._origin[1]) / _CELL))
        if not (0 <= i < self._side and 0 <= j < self._side):
            return False
        around = self._reachable[max(0, i - 1):i + 2, max(0, j - 1):j + 2]
        return bool(around.any()) and all(
            float(_distance(outline, np.array(x), np.array(y))) >= self._radius for outline in self._near)

    def cells(self) -> FloatArray:
        """Return the (n, 2) centres of the reachable cells [m]."""
        return np.argwhere(self._reachable) * _CELL + np.array(self._origin)


def _flood(blocked: BoolArray) -> Tuple[BoolArray, bool]:
    """Return the free cells that are connected to the free one nearest to the middle, and whether they end inside."""
    side = blocked.shape[0]
    free = np.argwhere(~blocked)
    reachable = np.zeros_like(blocked)
    if not len(free):
        return reachable, True
    middle = side // 2
    start = tuple(free[np.argmin(((free - middle) ** 2).sum(axis=1))])
    reachable[start] = True
    waiting: Deque[Tuple[int, ...]] = deque([start])
    closed = True
    while waiting:
        i, j = waiting.popleft()
        closed = closed and 0 < i < side - 1 and 0 < j < side - 1
        for a, b in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
            if 0 <= a < side and 0 <= b < side and not blocked[a, b] and not reachable[a, b]:
                reachable[a, b] = True
                waiting.append((a, b))
    return reachable, closed


# ---- outlines --------------------------------------------------------------------------------------------------

def _outlines(world: World) -> Iterator[Optional[FloatArray]]:
    """Yield the outlines, (n, 2) corners counter-clockwise, of all obstacles of a robot."""
    for _, collision, pose in placed_collisions(world):
        yield _outline(collision.geometry, pose)


def _outline(geometry: object, pose: Pose) -> Optional[FloatArray]:
    """Return the outline of a shape, or None if robots cannot collide with it."""
    position, orientation = pose
    if isinstance(geometry, Plane):
        return None
    if isinstance(geometry, Sphere):
        points = _rim(position, geometry.radius)
        low, high = position[2] - geometry.radius, position[2] + geometry.radius
    else:
        corners = _corners(geometry)
        if corners is None:
            return None
        points = np.array([rotate(orientation, tuple(corner)) for corner in corners]) + np.array(position)
        low, high = points[:, 2].min(), points[:, 2].max()
    return None if high < _LOW or low > _HIGH else _hull(points[:, :2])


def _corners(geometry: object) -> Optional[FloatArray]:
    """Return points (n, 3) whose hull contains a shape, in its own frame; None for a shape without such points."""
    if isinstance(geometry, Box):
        return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * np.array(geometry.size)
    if isinstance(geometry, Cylinder):
        rim = _rim((0.0, 0.0), geometry.radius)
        return np.array([(x, y, z) for x, y in rim[:, :2] for z in (-0.5 * geometry.length, 0.5 * geometry.length)])
    vertices = getattr(geometry, "vertices", None)
    return None if vertices is None else np.reshape(np.asarray(vertices, dtype=float), (-1, 3))


def _rim(position: Sequence[float], radius: float) -> FloatArray:
    """Return the corners of a polygon around a circle."""
    angles = 2.0 * math.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
    wide = radius / math.cos(math.pi / _RIM_POINTS)
    return np.column_stack((position[0] + wide * np.cos(angles), position[1] + wide * np.sin(angles)))


def _hull(points: FloatArray) -> FloatArray:
    """Return the convex hull of (n, 2) points, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(map(tuple, np.round(points, 9))))
    if len(ordered) < 3:
        return np.array(ordered)

    def half(sequence: Iterable[Tuple[float, ...]]) -> List[Tuple[float, ...]]:
        chain: List[Tuple[float, ...]] = []
        for point in sequence:
            while len(chain) > 1 and ((chain[-1][0] - chain[-2][0]) * (point[1] - chain[-2][1])
                                      - (chain[-1][1] - chain[-2][1]) * (point[0] - chain[-2][0])) <= 0.0:
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array(half(ordered) + half(reversed(ordered)))


def _distance(outline: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the distance [m] of points to a convex outline, 0 inside; ``x`` and ``y`` are broadcast."""
    least: Union[float, FloatArray] = np.inf
    inside: Union[bool, BoolArray] = True
    for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, axis=0)):
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / length, 0.0, 1.0) if length > 0.0 else 0.0 * (x + y)
        least = np.minimum(least, np.hypot(x - ax - along * dx, y - ay - along * dy))
        inside = inside & ((y - ay) * dx - (x - ax) * dy >= 0.0)
    return np.where(inside & (len(outline) > 2), 0.0, least)
