# SPDX-License-Identifier: BSD-3-Clause
"""How well an occupancy grid agrees with the world it was made in."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.errors import WorldError
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_tools.robot_height import LASER_HEIGHT
from m2wr_view.outlines import convex_hull

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import BoolArray, FloatArray, Uint8Array
    from m2wr_sim.model.types import World
    from m2wr_view.outlines import Outline

SLICE = 1e-6                # thickness of the slice of the world that the laser sees [m]
STEP = 0.1                  # of a cell, between two points of a wall
HIDDEN = 1e-6               # depth in another obstacle from which on a surface cannot be seen [m]
NEIGHBOURHOOD = 1           # cells that a wall may be drawn beside its place
INSIDE, WALL, OUTSIDE = 2, 1, 0


@dataclass(frozen=True)
class Agreement:
    """Comparison of a map with its world.

    Attributes
    ----------
    occupied : int
        Occupied cells of the map.
    on_walls : float
        Share of them within one cell of a true wall.
    doubled : int
        Of the others, those with free cells on both sides, as of a wall that was drawn twice.
    farthest : float
        Largest distance of an occupied cell from the nearest true wall [m].
    free : int
        Free cells.
    truly_free : float
        Share of them whose middle is in no obstacle.
    found : float
        Share of the walls next to free cells that have an occupied cell within one cell.
    """

    occupied: int
    on_walls: float
    doubled: int
    farthest: float
    free: int
    truly_free: float
    found: float


def _segments(outline: Outline) -> FloatArray:
    """Return the corners (M, 2) of the border of an outline, closed; discs and rounded corners as polygons."""
    vertices, radius = outline.vertices, outline.radius
    if radius <= 0.0:
        return vertices
    turns = np.linspace(0.0, 2.0 * math.pi, 120, endpoint=False)
    points = (vertices[:, None] + radius * np.stack((np.cos(turns), np.sin(turns)), -1)).reshape(-1, 2)
    return convex_hull(points)


def _inside(points: FloatArray, corners: FloatArray, depth: float = 0.0) -> BoolArray:
    """Return whether points (N, 2) are deeper than ``depth`` [m] in a convex polygon; corners counter-clockwise."""
    if len(corners) < 3:
        return np.zeros(len(points), bool)
    inside = np.ones(len(points), bool)
    for one, two in zip(corners, np.roll(corners, -1, axis=0)):
        way = two - one
        inside &= way[0] * (points[:, 1] - one[1]) - way[1] * (points[:, 0] - one[0]) > depth * math.hypot(*way)
    return inside


class Truth:
    """A world at the height of the laser, in the frame of a map.

    Parameters
    ----------
    world : m2wr_sim.model.types.World
    height : float
        Of the laser above the floor [m].
    frame : (3,) float
        Pose x, y [m], yaw [rad] in the world of the frame in which maps and points are given.

    Raises
    ------
    WorldError
        If the world has no obstacle there: nothing could be compared.
    """

    def __init__(self, world: World, height: float = LASER_HEIGHT, frame: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        outlines = obstacle_outlines(world, height - 0.5 * SLICE, height + 0.5 * SLICE)
        if not outlines:
            raise WorldError("the world has nothing at the height of the laser, %.2f m; expected walls" % height)
        cosine, sine = math.cos(frame[2]), math.sin(frame[2])
        turn = np.array([[cosine, -sine], [sine, cosine]])          # points as rows: world to frame
        self._corners = [(_segments(outline) - np.asarray(frame[:2], float)) @ turn for outline in outlines]
        self._step: Optional[float] = None      # of the surfaces found last
        self._points = np.zeros((0, 2))

    def drawn(self, shape: Tuple[int, ...], resolution: float, origin: FloatArray) -> Uint8Array:
        """Return the truth (H, W) on a grid: INSIDE an obstacle, WALL where a surface that can be seen crosses the
        cell, OUTSIDE.

        Parameters
        ----------
        shape : (int, int)
            Rows and columns.
        resolution : float
            [m].
        origin : (2,) float
            Middle of cell (0, 0) in the frame [m].
        """
        grid = np.full(shape, OUTSIDE, np.uint8)
        for corners in self._corners:
            self._fill(grid, corners, resolution, origin)
        cells = np.floor((self._surfaces(STEP * resolution) - origin) / resolution + 0.5).astype(int)
        seen = (cells >= 0).all(axis=1) & (cells[:, 0] < shape[1]) & (cells[:, 1] < shape[0])
        grid[cells[seen, 1], cells[seen, 0]] = WALL
        return grid

    def _surfaces(self, step: float) -> FloatArray:
        """Return points (N, 2), a ``step`` [m] apart, along all borders, without those inside another obstacle."""
        if step != self._step:              # kept for the next map: this takes most of the time
            found = []
            for index, corners in enumerate(self._corners):
                points = self._border(corners, step)
                hidden = np.zeros(len(points), bool)
                for other, polygon in enumerate(self._corners):
                    if other != index and len(polygon):
                        near = ((points >= polygon.min(axis=0)) & (points <= polygon.max(axis=0))).all(axis=1)
                        if near.any():      # two that lie flush are both seen, whichever way they are rounded
                            hidden[near] |= _inside(points[near], polygon, HIDDEN)
                found.append(points[~hidden])
            self._step, self._points = step, np.concatenate(found)
        return self._points

    @staticmethod
    def _border(corners: FloatArray, step: float) -> FloatArray:
        parts = []
        for one, two in zip(corners, np.roll(corners, -1, axis=0)):
            count = max(1, int(math.ceil(float(np.hypot(*(two - one))) / step)))
            parts.append(one + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (two - one))
        return np.concatenate(parts)

    @staticmethod
    def _fill(grid: Uint8Array, corners: FloatArray, resolution: float, origin: FloatArray) -> None:
        low = np.floor((corners.min(axis=0) - origin) / resolution).astype(int)
        high = np.ceil((corners.max(axis=0) - origin) / resolution).astype(int) + 1
        low, high = np.maximum(low, 0), np.minimum(high, grid.shape[::-1])
        if (low >= high).any():
            return
        columns, rows = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        points = np.stack((columns.ravel(), rows.ravel()), -1) * resolution + origin
        inside = _inside(points, corners).reshape(rows.shape)
        part = grid[low[1]:high[1], low[0]:high[0]]
        part[inside] = INSIDE

    def distances(self, points: FloatArray) -> FloatArray:
        """Return the distances (N,) [m] of points to the nearest border of an obstacle."""
        nearest = np.full(len(points), math.inf)
        for corners in self._corners:
            for one, two in zip(corners, np.roll(corners, -1, axis=0)):
                way = two - one
                along = np.clip((points - one) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
                nearest = np.minimum(nearest, np.hypot(*(points - one - along[:, None] * way).T))
        return nearest


def widened(mask: BoolArray, cells: int = NEIGHBOURHOOD) -> BoolArray:
    """Return a mask dilated by some cells, also diagonally.

    Parameters
    ----------
    mask : (H, W) bool
        Cells.
    cells : int
        Number of cells.
    """
    out = mask.copy()
    for _ in range(cells):
        wide = out.copy()
        wide[1:] |= out[:-1]
        wide[:-1] |= out[1:]
        out = wide.copy()
        out[:, 1:] |= wide[:, :-1]
        out[:, :-1] |= wide[:, 1:]
    return out


def _between_free(occupied: BoolArray, free: BoolArray) -> BoolArray:
    """Return the occupied cells with free ones within two cells on opposite sides, along an axis or a diagonal."""
    padded = np.pad(free, 2)
    rows, columns = occupied.shape

    def at(dy: int, dx: int) -> BoolArray:
        return padded[2 + dy:2 + dy + rows, 2 + dx:2 + dx + columns]

    found = np.zeros_like(occupied)
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        found |= (at(dy, dx) | at(2 * dy, 2 * dx)) & (at(-dy, -dx) | at(-2 * dy, -2 * dx))
    return occupied & found


def compare(data: ArrayLike, resolution: float, origin: FloatArray, truth: Truth) -> Agreement:
    """Return the :class:`Agreement` of a map.

    Parameters
    ----------
    data : (H, W) int8
        -1 unknown, 0 free, 100 occupied, lowest row first.
    resolution : float
        Side of a cell [m].
    origin : (2,) float
        Middle of cell (0, 0) in the frame of the truth [m].
    truth : Truth
    """
    data = np.asarray(data)
    occupied, free = data == 100, data == 0
    drawn = truth.drawn(data.shape, resolution, origin)
    wall = drawn == WALL
    right = occupied & widened(wall)
    rows, columns = np.nonzero(occupied)
    apart = truth.distances(np.stack((columns, rows), -1) * resolution + origin)
    visible = wall & widened(free)
    count = int(occupied.sum())
    return Agreement(
        occupied=count, on_walls=float(right.sum()) / max(count, 1),
        doubled=int(_between_free(occupied & ~right, free).sum()), farthest=float(apart.max(initial=0.0)),
        free=int(free.sum()), truly_free=float((free & (drawn != INSIDE)).sum()) / max(int(free.sum()), 1),
        found=float((visible & widened(occupied)).sum()) / max(int(visible.sum()), 1))


def format_agreement(found: Agreement) -> str:
    """Return the agreement as one line of text."""
    return ("%d wall cells, %.2f %% within one cell of a true wall (farthest %.3f m, doubled %d); %d free cells, "
            "%.2f %% truly free; %.1f %% of the walls beside them are drawn" % (
                found.occupied, 100.0 * found.on_walls, found.farthest, found.doubled, found.free,
                100.0 * found.truly_free, 100.0 * found.found))


def picture(data: ArrayLike, resolution: float, origin: FloatArray, truth: Truth) -> Uint8Array:
    """Return the map over the truth as colours (H, W, 3) uint8, top row first, cut to what is known.

    Grey: unknown; white: free; black: a wall where one is; red: a wall where none is; blue: a true wall not drawn.

    Parameters
    ----------
    data : (H, W) int8
        -1 unknown, 0 free, 100 occupied, lowest row first.
    resolution : float
        Side of a cell [m].
    origin : (2,) float
        Middle of cell (0, 0) in the frame of the truth [m].
    truth : Truth
        The world in the frame of the map.
    """
    data = np.asarray(data)
    drawn = truth.drawn(data.shape, resolution, origin)
    wall = drawn == WALL
    colours = np.full(data.shape + (3,), 205, np.uint8)
    colours[data == 0] = 255
    colours[wall & ~widened(data == 100)] = (90, 130, 255)
    colours[(data == 100) & widened(wall)] = 0
    colours[(data == 100) & ~widened(wall)] = (230, 30, 30)
    known = widened(data >= 0, 8) | wall
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if len(rows):
        colours = colours[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]
    return colours[::-1]
