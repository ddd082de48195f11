# SPDX-License-Identifier: BSD-3-Clause
"""Search for old places: the newest scans against old ones, coarse to fine, and conditions that reject a result."""
from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Callable, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_gmapping.backend.place_query import evenly, few_points, query_points, thinned
from m2wr_gmapping.backend.route import Route
from m2wr_gmapping.frontend import correlative_kernels as ck
from m2wr_gmapping.tuning import DRIFT, SEARCH
from m2wr_node.array_types import FloatArray, IndexArray, Uint8Array

NEAR_CELL, WIDE_CELL = SEARCH.cells
MARGIN = 1.0                # of the raster around what can be hit [m]


@dataclass(frozen=True)
class Place:
    """Result of a wide search.

    Attributes
    ----------
    pose : (3,) float64
        Pose of the newest node.
    score : float
    reach : float
        Length of the path whose scans fit there [m].
    rival : float
        Score of the most similar place outside the drift, or of the present pose if that is far from here, as a share
        of this place's score. If the score alone would not tell them apart, 1 less the difference of their ratings by
        points in free space.
    """

    pose: FloatArray
    score: float
    reach: float
    rival: float


@dataclass(frozen=True)
class Scene(Route):
    """The path, and the drift of the newest node against each other node.

    Attributes
    ----------
    count : int
        So many nodes count as old, from the first on.
    shift, turn : (K,) float64
        Drift [m], [rad].
    """

    count: int
    shift: FloatArray
    turn: FloatArray

    @property
    def distance(self) -> FloatArray:
        """Distance (K,) of each node from the newest [m]."""
        return np.hypot(self.path[:, 0] - self.path[-1, 0], self.path[:, 1] - self.path[-1, 1])


@dataclass(frozen=True)
class Raster:
    """End points of old scans around a place.

    Attributes
    ----------
    corner : (2,) float64
        Position in ``map`` [m].
    cell : float
        [m]
    values : (H, W) uint8
        Of ``correlative_kernels.stamp_points``.
    """

    corner: FloatArray
    cell: float
    values: Uint8Array

    @functools.cached_property
    def maxima(self) -> Tuple[Uint8Array, Uint8Array]:
        """Maxima of the blocks of two sizes, for ``correlative_kernels.search``."""
        found = np.empty_like(self.values), np.empty_like(self.values)
        for out, size in zip(found, (ck.BLOCK // 2, ck.BLOCK)):
            ck.block_maximum(self.values, size, out)
        return found


def raster_around(pose: FloatArray, query: FloatArray, route: Route, reference: IndexArray, window: float,
                  cell: float) -> Raster:
    """Return the raster of old end points in which the query can be searched around ``pose``.

    Parameters
    ----------
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    query : (2, Q) float64
        Points of the query in the newest node's frame [m].
    route : Route
    reference : (R,) int64
        Nodes whose end points make the raster.
    window : float
        Greatest half width of a search [m].
    cell : float
        [m]
    """
    radius = float(np.hypot(query[0], query[1]).max()) + window + MARGIN
    corner = pose[:2] - radius
    cells = int(2.0 * radius / cell) + 2
    values = np.zeros((cells, cells), np.uint8)
    if len(reference):
        scans = [route.readings[node].points for node in reference]
        ends = np.cumsum([points.shape[1] for points in scans])
        ck.stamp_points(route.path[reference], ends, np.concatenate(scans, axis=1), corner, 1.0 / cell, values)
    return Raster(corner, cell, values)


def coarse_search(raster: Raster, pose: FloatArray, query: FloatArray, window: float, turn: float, least: float = 0.0,
                  allowed: Optional[Callable[[FloatArray], Uint8Array]] = None,
                  headings: Sequence[float] = (0.0,)) -> FloatArray:
    """Search the query around ``pose`` in a raster.

    Parameters
    ----------
    raster : Raster
        Around ``pose``.
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    query : (2, Q) float64
        Points of the query in the newest node's frame [m].
    window, turn : float
        Half widths of the search [m], [rad].
    least : float
        Places with a smaller score are not searched, except for rivals; this saves time.
    allowed : callable or None
        Takes the offsets (N,) of the blocks' centres along x and y [m]; returns (N, N) uint8, nonzero for blocks to
        search, rows along y.
    headings : sequence of float
        Rotations that are searched, each with its half width ``turn`` [rad].

    Returns
    -------
    (7,) float64
        ``best`` of ``correlative_kernels.search``.
    """
    cell = raster.cell
    typical = max(1.0, float(np.hypot(query[0], query[1]).mean()))
    count = int(np.ceil(turn * typical / cell))
    turns = np.add.outer(headings, np.arange(-count, count + 1) * (cell / typical)).ravel()
    blocks = int(np.ceil(window / cell / ck.BLOCK))
    mask = np.ones((2 * blocks + 1, 2 * blocks + 1), np.uint8)
    if allowed is not None:
        middles = np.arange(-blocks, blocks + 1) * ck.BLOCK * cell
        mask[:] = allowed(middles)
    best = np.empty(7)
    ck.search(pose, query, turns, mask, raster.corner, 1.0 / cell, raster.values, *raster.maxima,
              int(round(SEARCH.apart[0] / cell)), SEARCH.apart[1], SEARCH.rival, least, best)
    return best


def _rated(pose: FloatArray, query: FloatArray, scene: Scene, reference: IndexArray, allowed: Uint8Array,
           raster_cell: float) -> Tuple[FloatArray, FloatArray]:
    """Rate the ``allowed`` (N, N) places around ``pose``.

    Returns ``rating`` and ``turn`` [rad] of ``correlative_kernels.survey``.
    """
    window = len(allowed) // 2 * raster_cell
    raster = raster_around(pose, query, scene, reference, window, raster_cell)
    seen = np.zeros_like(raster.values)
    for node in reference:
        ck.mark_seen(scene.path[node], scene.readings[node].rays, raster.corner, 1.0 / raster_cell, seen)
    turns = np.arange(-2, 3) * (0.5 * raster_cell / max(1.0, float(np.hypot(query[0], query[1]).mean())))
    rating, turn = np.empty((2, *allowed.shape))
    ck.survey(pose, query, turns, allowed, raster.corner, 1.0 / raster_cell, raster.values, seen, SEARCH.against,
              SEARCH.rival, rating, turn)
    return rating, turns[turn.astype(np.int64)]


def best_place_around(pose: FloatArray, query: FloatArray, scene: Scene, old: IndexArray, reference: IndexArray,
                      most: float, raster_cell: float) -> Optional[FloatArray]:
    """Return the place around ``pose`` with the best rating, or None if it is ambiguous.

    A segment that leads beyond the known area scores best if it is shifted into that area. The rating also counts
    points in free space.

    Parameters
    ----------
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    query : (2, Q) float64
        Points of the query in the newest node's frame [m].
    scene : Scene
        The path and its drift.
    old : (C,) int64
        The place must be near one of these nodes.
    reference : (R,) int64
        Nodes whose end points make the raster.
    most : float
        Greatest drift of the newest node [m].
    raster_cell : float
        Cell size of the raster [m].

    Returns
    -------
    (3,) float64 or None
    """
    path = scene.path
    blocks = int(np.ceil(min(SEARCH.path, 2.0 * most) / raster_cell / ck.BLOCK))
    middles = np.arange(-blocks, blocks + 1) * (ck.BLOCK * raster_cell)
    x, y = np.meshgrid(*(pose[:2, None] + middles - path[-1, :2, None]))
    allowed = near_places(middles, path[old, :2] - pose[:2], DRIFT.room)
    allowed *= np.hypot(x, y) <= most + SEARCH.apart[0]
    allowed = allowed.repeat(ck.BLOCK, axis=0).repeat(ck.BLOCK, axis=1)
    rating, turn = _rated(pose, query, scene, reference, allowed, raster_cell)
    half, room = len(allowed) // 2, int(round(SEARCH.apart[0] / raster_cell))
    row, column = (int(index) for index in np.unravel_index(int(np.argmax(rating)), rating.shape))
    others = rating.copy()
    others[max(0, row - room):row + room + 1, max(0, column - room):column + room + 1] = 0.0
    if others.max() >= SEARCH.rival * rating[row, column]:
        return None
    if max(abs(row - half), abs(column - half)) <= room:
        return pose
    return pose + [(column - half) * raster_cell, (row - half) * raster_cell, turn[row, column]]


def near_search(scene: Scene, old: IndexArray) -> Tuple[Optional[FloatArray], bool]:
    """Search for the newest node close to its present pose.

    Parameters
    ----------
    scene : Scene
        The path and its drift.
    old : (C,) int64
        Nodes to search.

    Returns
    -------
    pose : (3,) float64 or None
    ambiguous : bool
        Whether other places fit as well; ``pose`` is then the best one close to the present pose.
    """
    path = scene.path
    near = old[np.argsort(scene.distance[old], kind="stable")][:4 * SEARCH.nodes[0]]
    reference = near[::max(1, len(near) // SEARCH.nodes[0])]
    query = thinned(query_points(scene, SEARCH.near_path), SEARCH.points)
    if query.shape[1] < SEARCH.fewest:
        return None, False
    window, turn = scene.shift[old].max(), scene.turn[old].max()
    raster = raster_around(path[-1], query, scene, reference, window, NEAR_CELL)
    best = coarse_search(raster, path[-1], query, window, turn, SEARCH.least_score)
    if best[3] < SEARCH.least_score:
        return None, False
    if not _has_rival(best):
        pose = best_place_around(best[:3], query, scene, old, reference, window, NEAR_CELL)
        if pose is not None and (pose == best[:3]).all():
            return pose, False
    least = SEARCH.rival * best[3]
    best = coarse_search(raster, path[-1], query, *SEARCH.local, least)
    return (best[:3] if best[3] >= least else None), True


def wide_search(scene: Scene, old: IndexArray) -> Optional[Place]:
    """Search for the newest node within its drift, along the old path.

    The scans of a segment are searched together. If several places fit, a longer segment is used: ten metres of a
    corridor are ambiguous more often than the whole corridor. A robot that has just returned shares only a short
    segment.

    Parameters
    ----------
    scene : Scene
        The path and its drift.
    old : (C,) int64
        Nodes to search.

    Returns
    -------
    Place or None
    """
    shift = float(scene.shift[old].max())
    reach, reference = SEARCH.path, evenly(old, SEARCH.nodes[1])
    query, best, score = _search_segment(scene, old, reference, reach, WIDE_CELL)
    raster_cell = WIDE_CELL
    if score >= SEARCH.least_score and _has_rival(best):
        closer = _search_along_corridor(scene, old, query, reference, best)
        if is_unique(closer):
            best, raster_cell = closer, NEAR_CELL
    if score >= SEARCH.least_score and _has_rival(best):
        reach = SEARCH.long_path
        reference = _older_nodes(scene, reach, SEARCH.beyond * shift + reach, float(scene.shift[old].min()))
        query, best, score = _search_segment(scene, old, reference, reach, WIDE_CELL)
    elif best[3] < SEARCH.least_score and query.shape[1] >= SEARCH.fewest and shift <= SEARCH.short_drift:
        reach = SEARCH.near_path
        query, best, score = _search_segment(scene, old, reference, reach, NEAR_CELL)
    if not is_unique(best):
        return None
    pose = best_place_around(best[:3], query, scene, old, reference, SEARCH.beyond * shift, raster_cell)
    if pose is None:
        return None
    best[:3] = pose
    away, moved = scene.path[old, :2] - scene.path[-1, :2], best[:2] - scene.path[-1, :2]
    if not ((np.hypot(*(away - moved).T) < DRIFT.room) & (np.hypot(*moved) <= scene.shift[old])).any():
        return None
    other, known = _excluded_place(scene, query)
    rival = float(other[3]) / score
    if rival > SEARCH.rival:
        others, own = _ratings(other[:3], known, best[:3], reference, query, scene)
        if others >= SEARCH.rival * own:
            return None
        rival = 1.0 - (own - others)
    unmoved = _score_without_shift(scene, query, reach) if np.hypot(*moved) > DRIFT.room else 0.0
    if unmoved > SEARCH.rival * score:
        return None
    return Place(best[:3], best[3], reach, max(rival, unmoved / score))


def is_unique(best: FloatArray) -> bool:
    """Whether the result (7,) of a search fits, and no other place fits as well."""
    return bool(best[3] >= SEARCH.least_score) and not _has_rival(best)


def _has_rival(best: FloatArray) -> bool:
    return bool(best[4] > SEARCH.rival * best[3])


def _search_segment(scene: Scene, old: IndexArray, reference: IndexArray, reach: float,
                    cell: float) -> Tuple[FloatArray, FloatArray, float]:
    """Search the scans of the last ``reach`` metres around the old nodes, in a raster of the ``reference`` nodes.

    Returns
    -------
    query : (2, Q) float64
    best : (7,) float64
        As of ``coarse_search``, of the finest search; 0 with too few points.
    score : float
        Score of the first search.
    """
    pose, query = scene.path[-1], few_points(query_points(scene, reach))
    if query.shape[1] < SEARCH.fewest or not len(reference):
        return query, np.zeros(7), 0.0
    away, shifts, turn = scene.path[old, :2] - pose[:2], scene.shift[old], float(scene.turn[old].max())
    window = SEARCH.beyond * float(shifts.max())
    best = coarse_search(raster_around(pose, query, scene, reference, window, cell), pose, query, window, turn,
                         SEARCH.least_score,
                         lambda middles: near_places(middles, away, DRIFT.room, 0.0, SEARCH.beyond * shifts))
    score = float(best[3])
    if is_unique(best):
        raster = raster_around(best[:3], query, scene, reference, DRIFT.least[0], NEAR_CELL)
        best = coarse_search(raster, best[:3], query, *DRIFT.least, SEARCH.least_score)
    return query, best, score


def _search_along_corridor(scene: Scene, old: IndexArray, query: FloatArray, reference: IndexArray,
                           best: FloatArray) -> FloatArray:
    """Search again in a finer raster on the line through the best place and its rival, which is often a corridor."""
    away, most = scene.path[old, :2] - best[:2], SEARCH.beyond * scene.shift[old]
    moved = best[:2] - scene.path[-1, :2]
    along = best[5:7] - best[:2]
    along = along / max(float(np.hypot(*along)), 1e-9)      # the rival may have the same position

    def allowed(middles: FloatArray) -> Uint8Array:
        x, y = np.meshgrid(middles, middles)
        beside = np.abs(along[0] * y - along[1] * x) <= SEARCH.apart[0]
        return near_places(middles, away, DRIFT.room) * beside * (np.hypot(x + moved[0], y + moved[1]) <= most.max())

    window = float(np.hypot(*moved)) + float(most.max())
    raster = raster_around(best[:3], query, scene, reference, window, NEAR_CELL)
    return coarse_search(raster, best[:3], query, window, DRIFT.least[1], SEARCH.least_score, allowed)


def _older_nodes(scene: Scene, reach: float, distance: float, drift: float = 0.0) -> IndexArray:
    """Return at most ``nodes[2]`` old nodes within ``distance`` [m], without the last ``reach`` metres of path.

    The drift against each is at least ``drift`` [m]. Nodes with the same drift as the newest one fit at its present
    pose, whether this is right or not.
    """
    known = np.flatnonzero((scene.distance < distance) & (scene.shift >= drift)
                           & (scene.along < scene.along[-1] - reach - DRIFT.room))
    return evenly(known[known < scene.count], SEARCH.nodes[2])


def _score_without_shift(scene: Scene, query: FloatArray, reach: float) -> float:
    """Return the score of the query at its present pose. If it fits there, no correction is needed."""
    reference = _older_nodes(scene, reach, SEARCH.reach + reach)
    if not len(reference):
        return 0.0
    return score_here(query, scene, reference)


def score_here(query: FloatArray, route: Route, reference: IndexArray) -> float:
    """Return the score of the query close to the present pose of the newest node.

    Parameters
    ----------
    query : (2, Q) float64
        Points of the query in the newest node's frame [m].
    route : Route
    reference : (R,) int64
        Nodes whose end points make the raster.
    """
    newest = route.path[-1]
    raster = raster_around(newest, query, route, reference, SEARCH.local[0], WIDE_CELL)
    return float(coarse_search(raster, newest, query, *SEARCH.local)[3])


def _excluded_place(scene: Scene, query: FloatArray) -> Tuple[FloatArray, IndexArray]:
    """Return the best place outside the drift, and the nodes there. If the query fits there, the area is ambiguous."""
    path, known = scene.path, np.flatnonzero(scene.distance[:scene.count] < SEARCH.alike + DRIFT.room)
    if not len(known):
        return np.zeros(7), known
    reference = evenly(known, SEARCH.nodes[1])
    away, least = path[known, :2] - path[-1, :2], SEARCH.beyond * scene.shift[known] + SEARCH.apart[0]
    raster = raster_around(path[-1], query, scene, reference, SEARCH.alike, WIDE_CELL)
    best = coarse_search(raster, path[-1], query, SEARCH.alike, DRIFT.least[1], 0.0,
                         lambda middles: near_places(middles, away, DRIFT.room, least, SEARCH.alike))
    return best, reference


def _ratings(other: FloatArray, known: IndexArray, pose: FloatArray, reference: IndexArray, query: FloatArray,
             scene: Scene) -> Tuple[float, float]:
    """Return the rating of a place, seen among the nodes ``known``, and that of ``pose`` among ``reference``."""
    width = 2 * int(round(SEARCH.local[0] / NEAR_CELL)) + 1
    allowed = np.ones((width, width), np.uint8)
    others, own = (float(_rated(place, query, scene, nodes, allowed, NEAR_CELL)[0].max())
                   for place, nodes in ((other, known), (pose, reference)))
    return others, own


def near_places(middles: FloatArray, away: FloatArray, reach: Union[float, FloatArray],
                least: Union[float, FloatArray] = 0.0, most: Union[float, FloatArray] = np.inf) -> Uint8Array:
    """Return the offsets of a search that are near a place.

    Parameters
    ----------
    middles : (N,) float64
        Offsets along either axis [m].
    away : (C, 2) float64
        Places, as offsets in the map's axes [m].
    reach : float or (C,) float64
        Greatest distance from each place [m].
    least, most : float or (C,) float64
        Least and greatest length of an offset for each place [m].

    Returns
    -------
    (N, N) uint8
        Rows along y.
    """
    near = np.zeros((len(middles), len(middles)), np.uint8)
    if len(middles) > 1:
        limits = [np.array(np.broadcast_to(limit, len(away)), float) for limit in (least, most, reach)]
        ck.mark_near(middles, np.ascontiguousarray(away), *limits, near)
    return near
