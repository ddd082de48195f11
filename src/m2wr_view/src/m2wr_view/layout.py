# SPDX-License-Identifier: BSD-3-Clause
"""Maps the world to pixels and chooses the part of the world that is shown."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Optional, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray, Int8Array
    from m2wr_view.outlines import Outline
    from m2wr_view.scene import Scene

MARGIN = 0.6            # m around what must be seen
WHOLE_WORLD = 30.0      # m; a world up to this size is shown whole: m2wr, 0.5 m long, is then 11 of 800 pixels
SURROUNDINGS = 10.0     # m around robot, goal and trail within which obstacles widen the view of a larger world
_STEPS = (1.0, 2.0, 5.0)


class Window(NamedTuple):
    """The part of a picture that shows the world [pixels]."""

    left: float
    top: float
    width: float
    height: float


class View:
    """Maps metres to pixels of a window, with the same scale along both axes.

    Parameters
    ----------
    bounds : (4,) floats
        Least x, least y, greatest x, greatest y that must be seen [m].
    window : Window
    """

    def __init__(self, bounds: Sequence[float], window: Window) -> None:
        wide, high = max(bounds[2] - bounds[0], 0.1), max(bounds[3] - bounds[1], 0.1)
        self.scale = min(window.width / wide, window.height / high)     # pixels a metre
        centre = 0.5 * (bounds[0] + bounds[2]), 0.5 * (bounds[1] + bounds[3])
        half = 0.5 * window.width / self.scale, 0.5 * window.height / self.scale
        self.window = window
        self.wanted: Tuple[float, ...] = tuple(bounds)
        self.bounds = (centre[0] - half[0], centre[1] - half[1], centre[0] + half[0], centre[1] + half[1])

    def pixel(self, x: float, y: float) -> Tuple[float, float]:
        """Return column and row, as floats, of a point [m].

        Parameters
        ----------
        x, y : float
            [m].
        """
        return (self.window.left + (x - self.bounds[0]) * self.scale,
                self.window.top + (self.bounds[3] - y) * self.scale)

    def shows(self, outline: Outline) -> bool:
        """Return whether the rectangle around an outline overlaps the bounds of the picture."""
        (x0, y0), (x1, y1) = _reach(outline)
        return x0 < self.bounds[2] and x1 > self.bounds[0] and y0 < self.bounds[3] and y1 > self.bounds[1]

    def pixels(self, points: ArrayLike) -> FloatArray:
        """Return columns and rows (n, 2) of points (n, 2) [m]."""
        return np.asarray(points) * (self.scale, -self.scale) + self.pixel(0.0, 0.0)


def nice_step(span: float, parts: int) -> float:
    """Return a step of 1, 2 or 5 times a power of ten that divides a length into at most some parts.

    Parameters
    ----------
    span : float
        The length.
    parts : int
        Largest number of parts.
    """
    least = max(span, 1e-9) / parts
    power = 10.0 ** math.floor(math.log10(least))
    for step in _STEPS:
        if step * power >= least * (1.0 - 1e-9):
            return step * power
    return 10.0 * power


def _area(bounds: Sequence[float]) -> float:
    return (bounds[2] - bounds[0]) * (bounds[3] - bounds[1])


def _reach(outline: Outline) -> Tuple[FloatArray, FloatArray]:
    return outline.vertices.min(axis=0) - outline.radius, outline.vertices.max(axis=0) + outline.radius


def with_obstacles(low: FloatArray, high: FloatArray, outlines: Sequence[Outline]) -> Tuple[FloatArray, FloatArray]:
    """Return an area widened by obstacles: by all of them, or in a large world by those nearby.

    Parameters
    ----------
    low, high : (2,) float64
        Lower left and upper right corner of the area that is shown in any case [m].
    outlines : sequence of m2wr_view.outlines.Outline
        The obstacles, in the same frame.

    Returns
    -------
    (2,) float64, (2,) float64
        Corners [m].  A side is longer than ``WHOLE_WORLD`` only if the area was, or if its surroundings are.
    """
    if not outlines:
        return low, high
    reaches = [_reach(outline) for outline in outlines]
    least = np.minimum(low, np.min([first for first, _ in reaches], axis=0))
    most = np.maximum(high, np.max([last for _, last in reaches], axis=0))
    if np.all(most - least <= WHOLE_WORLD):
        return least, most
    least, most = low - SURROUNDINGS, high + SURROUNDINGS
    for first, last in reaches:
        if np.all(first < most) and np.all(last > least):
            low, high = np.minimum(low, np.maximum(first, least)), np.maximum(high, np.minimum(last, most))
    return low, high


def needed_bounds(scene: Scene) -> Tuple[float, ...]:
    """Return what of a scene must be seen, whole metres (least x, least y, greatest x, greatest y).

    Robots, their paths, line and map are seen, and the obstacles of :func:`with_obstacles`.
    """
    points = [(x, y) for x, y, _, _ in scene.trail] + list(scene.line) + scene.hits + scene.leaves + scene.places()
    points += [*scene.team.points(), *((x, y) for x, y, _ in scene.names)]
    ends = np.array(points or [(0.0, 0.0)], dtype=float).reshape(-1, 2)
    low, high = with_obstacles(ends.min(axis=0), ends.max(axis=0), scene.solids.blocking + scene.solids.hanging)
    for ground in scene.ground:         # the rest of a large one is cut off
        spread = ground.corners.reshape(-1, 2)
        low = np.minimum(low, np.maximum(spread.min(axis=0), low - SURROUNDINGS))
        high = np.maximum(high, np.minimum(spread.max(axis=0), high + SURROUNDINGS))
    if scene.grid is not None:
        corners = _known_corners(*scene.grid)
        if corners is not None:
            low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    return tuple(np.concatenate((np.floor(low - MARGIN), np.ceil(high + MARGIN))).tolist())


def _known_corners(transform: FloatArray, resolution: float, cells: Int8Array) -> Optional[FloatArray]:
    """Return the corners (4, 2) [m] around all known cells of a map, or None if none is known."""
    known = cells >= 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return None
    corners = [(x * resolution, y * resolution, 0.0, 1.0) for x in (columns[0], columns[-1] + 1)
               for y in (rows[0], rows[-1] + 1)]
    return np.array(corners).dot(np.asarray(transform).T)[:, :2]


class Framing:
    """Chooses the view: a fixed one, or one that grows when something comes to lie outside.

    Parameters
    ----------
    window : Window
    bounds : (4,) floats, optional
        Fixed bounds [m].
    """

    def __init__(self, window: Window, bounds: Optional[Sequence[float]] = None) -> None:
        self._window, self._fixed = window, bounds
        self._view: Optional[View] = None
        self._looked: Optional[int] = None      # version of the scene that the view was chosen for

    def view(self, scene: Scene) -> View:
        """Return the :class:`View` for a scene; the same object as long as it need not change."""
        if self._fixed is not None:
            self._view = self._view or View(self._fixed, self._window)
            return self._view
        view = self._view
        outside = view is None or not all(
            view.wanted[0] <= x <= view.wanted[2] and view.wanted[1] <= y <= view.wanted[3] for x, y in scene.places())
        if outside or self._looked != scene.version:
            self._looked = scene.version
            bounds = needed_bounds(scene)
            if view is not None and (scene.trail or scene.team.members):
                old = view.wanted
                grown = tuple(min(pair) for pair in zip(old[:2], bounds[:2])) + tuple(
                    max(pair) for pair in zip(old[2:], bounds[2:]))
                # what was once shown stays in view, unless nearly all of the picture would be empty
                if _area(grown) < 4.0 * _area(bounds):
                    bounds = grown
            if view is None or bounds != view.wanted:
                view = View(bounds, self._window)
        assert view is not None         # without a view, everything is outside
        self._view = view
        return view
