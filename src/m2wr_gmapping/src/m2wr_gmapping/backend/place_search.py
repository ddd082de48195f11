# SPDX-License-Identifier: BSD-3-Clause
"""Search for old places: the newest scans against old ones, coarse to fine, and conditions that reject a result."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Callable, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_gmapping.backend.place_query import QUERY_REACH, evenly, query_points, thinned, wide_query
from m2wr_gmapping.frontend import correlative_kernels as ck

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray, IndexArray, Uint8Array
    from m2wr_gmapping.frontend.scan import ScanReading

NEAR_RASTER, WIDE_RASTER = 0.1, 0.2     # cell of the search raster [m]
MARGIN = 1.0                # of the raster around what can be hit [m]
RASTER_SCORE = 0.6          # least score, as a share of the best possible one
APART, RIVAL_TURN = 0.6, 0.3            # least distance of a rival from the best pose [m, rad]
RIVAL = 0.92                # a rival with this share of the best score makes the place ambiguous
AGAIN, REFINED_TURN = 0.5, 0.08           # window of the refined search in the finer raster [m, rad]
BESIDE, LOCAL_TURN = 0.3, 0.06         # window of the local search of an ambiguous place [m, rad]
ROOM = 2.5                  # greatest distance of a result of a wide search from an old node [m]
BEYOND = 1.3                # rivals are searched within the drift times this factor
AGAINST = 3                 # weight of a point in free space against a point on a wall
UNLIKE = 0.9                # as RIVAL, for ratings
AS_GOOD_CELLS = 9           # width of the area in which a place is rated [cells of the finer raster]
PUSHED = 10.0               # greatest false shift of a segment into the known area [m]
ALIKE, ALIKE_TURN = 15.0, 0.1           # radius of the search for similar places [m, rad]
REFERENCE_NODES = 24        # old scans of a map, or of the raster of a near search
WIDE_NODES, LONG_NODES = 160, 320       # old scans of the raster of a wide search
FEWEST_POINTS = 30          # of a query
NEAR_PATH = 3.0             # path whose scans a near search uses [m]
QUERY_POINTS = 160          # of the query of a near search
WIDE_PATH, LONG_PATH, SHORT_PATH = 10.0, 24.0, 3.0      # path whose scans a wide search uses [m]
SHORT_SHIFT = 6.0           # the shortest segment is used only with less drift than this [m]


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
        of this place's score.
    """

    pose: FloatArray
    score: float
    reach: float
    rival: float


@dataclass(frozen=True)
class Scene:
    """The path, and the drift of the newest node against each other node.

    Attributes
    ----------
    path : (K, 3) float64
    along : (K,) float64
        Length of the path up to each node [m].
    readings : sequence of K ScanReading
    old : (C,) int
        Nodes that count as old.
    shift, turn : (K,) float64
        Drift [m], [rad].
    """

    path: FloatArray
    along: FloatArray
    readings: Sequence[ScanReading]
    old: IndexArray
    shift: FloatArray
    turn: FloatArray

    @property
    def distance(self) -> FloatArray:
        """Distance (K,) of each node from the newest [m]."""
        return np.hypot(self.path[:, 0] - self.path[-1, 0], self.path[:, 1] - self.path[-1, 1])


def _raster(pose: FloatArray, query: FloatArray, path: FloatArray, reference: IndexArray,
            readings: Sequence[ScanReading], window: float, raster_cell: float) -> Tuple[FloatArray, Uint8Array]:
    """Return the corner (2,) [m] and the raster of the reference nodes' end points around ``pose``."""
    radius = float(np.hypot(query[0], query[1]).max()) + window + MARGIN
    corner = pose[:2] - radius
    cells = int(2.0 * radius / raster_cell) + 2
    raster = np.zeros((cells, cells), np.uint8)
    for node in reference:
        ck.stamp_points(path[node], readings[node].points, corner, 1.0 / raster_cell, raster)
    return corner, raster


def coarse_search(pose: FloatArray, query: FloatArray, path: FloatArray, reference: IndexArray,
                  readings: Sequence[ScanReading], window: float, turn: float, raster_cell: float,
                  allowed: Optional[Callable[[FloatArray], Uint8Array]] = None) -> FloatArray:
    """Search the query around ``pose`` in a raster of the reference nodes' end points.

    Parameters
    ----------
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    query : (2, Q) float64
        Points of the query in the newest node's frame [m].
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    reference : (R,) int64
        Nodes whose end points make the raster.
    readings : sequence of K ScanReading
        Scans of the path's nodes.
    window : float
        Half width of the search [m].
    turn : float
        Half width of the search [rad].
    raster_cell : float
        Cell size of the raster [m].
    allowed : callable or None
        Takes the offsets (N,) of the blocks' centres along x and y [m]; returns (N, N) uint8, nonzero for blocks to
        search, rows along y.

    Returns
    -------
    (7,) float64
        ``best`` of ``correlative_kernels.search``.
    """
    corner, raster = _raster(pose, query, path, reference, readings, window, raster_cell)
    coarse = np.empty_like(raster)
    ck.block_maximum(raster, coarse)
    typical = max(1.0, float(np.hypot(query[0], query[1]).mean()))
    count = int(np.ceil(turn * typical / raster_cell))
    turns = np.arange(-count, count + 1) * (raster_cell / typical)
    blocks = int(np.ceil(window / raster_cell / ck.BLOCK))
    mask = np.ones((2 * blocks + 1, 2 * blocks + 1), np.uint8)
    if allowed is not None:
        middles = np.arange(-blocks, blocks + 1) * ck.BLOCK * raster_cell
        mask[:] = allowed(middles)
    best = np.empty(7)
    ck.search(pose, query, turns, mask, corner, 1.0 / raster_cell, raster, coarse, int(round(APART / raster_cell)),
              RIVAL_TURN, RIVAL, best)
    return best


def _rated(pose: FloatArray, query: FloatArray, scene: Scene, reference: IndexArray, allowed: Uint8Array,
           raster_cell: float) -> Tuple[FloatArray, FloatArray]:
    """Rate the ``allowed`` (N, N) places around ``pose``.

    Returns ``rating`` and ``turn`` [rad] of ``correlative_kernels.survey``.
    """
    window = len(allowed) // 2 * raster_cell
    corner, raster = _raster(pose, query, scene.path, reference, scene.readings, window, raster_cell)
    seen = np.zeros_like(raster)
    for node in reference:
        ck.mark_seen(scene.path[node], scene.readings[node].rays, corner, 1.0 / raster_cell, seen)
    turns = np.arange(-2, 3) * (0.5 * raster_cell / max(1.0, float(np.hypot(query[0], query[1]).mean())))
    rating, turn = np.empty((2, *allowed.shape))
    ck.survey(pose, query, turns, allowed, corner, 1.0 / raster_cell, raster, seen, AGAINST, UNLIKE, rating, turn)
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
    blocks = int(np.ceil(min(PUSHED, 2.0 * most) / raster_cell / ck.BLOCK))
    middles = np.arange(-blocks, blocks + 1) * (ck.BLOCK * raster_cell)
    x, y = np.meshgrid(*(pose[:2, None] + middles - path[-1, :2, None]))
    allowed = near_places(middles, path[old, :2] - pose[:2], ROOM)
    allowed *= np.hypot(x, y) <= most + APART
    allowed = allowed.repeat(ck.BLOCK, axis=0).repeat(ck.BLOCK, axis=1)
    rating, turn = _rated(pose, query, scene, reference, allowed, raster_cell)
    half, room = len(allowed) // 2, int(round(APART / raster_cell))
    row, column = (int(index) for index in np.unravel_index(int(np.argmax(rating)), rating.shape))
    others = rating.copy()
    others[max(0, row - room):row + room + 1, max(0, column - room):column + room + 1] = 0.0
    if others.max() >= UNLIKE * rating[row, column]:
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
    path, readings = scene.path, scene.readings
    near = old[np.argsort(scene.distance[old], kind="stable")][:4 * REFERENCE_NODES]
    reference = near[::max(1, len(near) // REFERENCE_NODES)]
    query = thinned(query_points(path, scene.along, readings, NEAR_PATH), QUERY_POINTS)
    if query.shape[1] < FEWEST_POINTS:
        return None, False
    window, turn = scene.shift[old].max(), scene.turn[old].max()
    best = coarse_search(path[-1], query, path, reference, readings, window, turn, NEAR_RASTER)
    if best[3] < RASTER_SCORE:
        return None, False
    if best[4] <= RIVAL * best[3]:
        pose = best_place_around(best[:3], query, scene, old, reference, window, NEAR_RASTER)
        if pose is not None and (pose == best[:3]).all():
            return pose, False
    least = RIVAL * best[3]
    best = coarse_search(path[-1], query, path, reference, readings, BESIDE, LOCAL_TURN, NEAR_RASTER)
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
    reach, reference = WIDE_PATH, evenly(old, WIDE_NODES)
    query, best, score = _search_segment(scene, old, reference, reach, WIDE_RASTER)
    raster_cell = WIDE_RASTER
    if score >= RASTER_SCORE and best[4] > RIVAL * best[3]:
        closer = _search_along_corridor(scene, old, query, reference, best)
        if closer[3] >= RASTER_SCORE and closer[4] <= RIVAL * closer[3]:
            best, raster_cell = closer, NEAR_RASTER
    if score >= RASTER_SCORE and best[4] > RIVAL * best[3]:
        reach = LONG_PATH
        reference = _older_nodes(scene, reach, BEYOND * shift + reach, float(scene.shift[old].min()))
        query, best, score = _search_segment(scene, old, reference, reach, WIDE_RASTER)
    elif best[3] < RASTER_SCORE and query.shape[1] >= FEWEST_POINTS and shift <= SHORT_SHIFT:
        reach = SHORT_PATH
        query, best, score = _search_segment(scene, old, reference, reach, NEAR_RASTER)
    if best[3] < RASTER_SCORE or best[4] > RIVAL * best[3]:
        return None
    pose = best_place_around(best[:3], query, scene, old, reference, BEYOND * shift, raster_cell)
    if pose is None:
        return None
    best[:3] = pose
    away, moved = scene.path[old, :2] - scene.path[-1, :2], best[:2] - scene.path[-1, :2]
    if not ((np.hypot(*(away - moved).T) < ROOM) & (np.hypot(*moved) <= scene.shift[old])).any():
        return None
    other, known = _excluded_place(scene, query)
    if other[3] > RIVAL * score and _is_as_good(other[:3], known, best[:3], reference, query, scene):
        return None
    unmoved = _score_without_shift(scene, query, reach) if np.hypot(*moved) > ROOM else 0.0
    if unmoved > RIVAL * score:
        return None
    return Place(best[:3], best[3], reach, max(float(other[3]), unmoved) / score)


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
    path, readings, pose = scene.path, scene.readings, scene.path[-1]
    query = wide_query(path, scene.along, readings, reach)
    if query.shape[1] < FEWEST_POINTS or not len(reference):
        return query, np.zeros(7), 0.0
    away, shifts, turn = path[old, :2] - pose[:2], scene.shift[old], float(scene.turn[old].max())
    best = coarse_search(pose, query, path, reference, readings, BEYOND * float(shifts.max()), turn, cell,
                         lambda middles: near_places(middles, away, ROOM, 0.0, BEYOND * shifts))
    score = float(best[3])
    if score >= RASTER_SCORE and best[4] <= RIVAL * score:
        best = coarse_search(best[:3], query, path, reference, readings, AGAIN, REFINED_TURN, NEAR_RASTER)
    return query, best, score


def _search_along_corridor(scene: Scene, old: IndexArray, query: FloatArray, reference: IndexArray,
                           best: FloatArray) -> FloatArray:
    """Search again in a finer raster on the line through the best place and its rival, which is often a corridor."""
    away, most = scene.path[old, :2] - best[:2], BEYOND * scene.shift[old]
    moved = best[:2] - scene.path[-1, :2]
    along = best[5:7] - best[:2]
    along = along / max(float(np.hypot(*along)), 1e-9)      # the rival may have the same position

    def allowed(middles: FloatArray) -> Uint8Array:
        x, y = np.meshgrid(middles, middles)
        beside = np.abs(along[0] * y - along[1] * x) <= APART
        return near_places(middles, away, ROOM) * beside * (np.hypot(x + moved[0], y + moved[1]) <= most.max())

    window = float(np.hypot(*moved)) + float(most.max())
    return coarse_search(best[:3], query, scene.path, reference, scene.readings, window, REFINED_TURN, NEAR_RASTER,
                         allowed)


def _older_nodes(scene: Scene, reach: float, distance: float, drift: float = 0.0) -> IndexArray:
    """Return at most LONG_NODES old nodes within ``distance`` [m], without the last ``reach`` metres of path.

    The drift against each is at least ``drift`` [m]. Nodes with the same drift as the newest one fit at its present
    pose, whether this is right or not.
    """
    known = scene.old[(scene.distance[scene.old] < distance) & (scene.shift[scene.old] >= drift)
                      & (scene.along[scene.old] < scene.along[-1] - reach - ROOM)]
    return evenly(known, LONG_NODES)


def _score_without_shift(scene: Scene, query: FloatArray, reach: float) -> float:
    """Return the score of the query at its present pose. If it fits there, no correction is needed."""
    reference = _older_nodes(scene, reach, QUERY_REACH + reach)
    if not len(reference):
        return 0.0
    return score_here(query, scene.path, reference, scene.readings)


def score_here(query: FloatArray, path: FloatArray, reference: IndexArray, readings: Sequence[ScanReading]) -> float:
    """Return the score of the query close to the present pose of the newest node.

    Parameters
    ----------
    query : (2, Q) float64
        Points of the query in the newest node's frame [m].
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    reference : (R,) int64
        Nodes whose end points make the raster.
    readings : sequence of K ScanReading
        Scans of the path's nodes.
    """
    return float(coarse_search(path[-1], query, path, reference, readings, BESIDE, LOCAL_TURN, WIDE_RASTER)[3])


def _excluded_place(scene: Scene, query: FloatArray) -> Tuple[FloatArray, IndexArray]:
    """Return the best place outside the drift, and the nodes there. If the query fits there, the area is ambiguous."""
    path, known = scene.path, scene.old[scene.distance[scene.old] < ALIKE + ROOM]
    if not len(known):
        return np.zeros(7), known
    reference = evenly(known, WIDE_NODES)
    away, least = path[known, :2] - path[-1, :2], BEYOND * scene.shift[known] + APART
    best = coarse_search(path[-1], query, path, reference, scene.readings, ALIKE, ALIKE_TURN, WIDE_RASTER,
                         lambda middles: near_places(middles, away, ROOM, least, ALIKE))
    return best, reference


def _is_as_good(other: FloatArray, known: IndexArray, pose: FloatArray, reference: IndexArray, query: FloatArray,
                scene: Scene) -> bool:
    """Whether a place, seen among the nodes ``known``, is rated as well as ``pose`` among ``reference``."""
    allowed = np.ones((AS_GOOD_CELLS, AS_GOOD_CELLS), np.uint8)
    ratings = [_rated(place, query, scene, nodes, allowed, NEAR_RASTER)[0].max()
               for place, nodes in ((other, known), (pose, reference))]
    return bool(ratings[0] >= UNLIKE * ratings[1])


def near_places(middles: FloatArray, away: FloatArray, reach: float, least: Union[float, FloatArray] = 0.0,
                most: Union[float, FloatArray] = np.inf) -> Uint8Array:
    """Return the offsets of a search that are near a place.

    Parameters
    ----------
    middles : (N,) float64
        Offsets along either axis [m].
    away : (C, 2) float64
        Places, as offsets in the map's axes [m].
    reach : float
        Greatest distance from a place [m].
    least, most : float or (C,) float64
        Least and greatest length of an offset for each place [m].

    Returns
    -------
    (N, N) uint8
        Rows along y.
    """
    near = np.zeros((len(middles), len(middles)), np.uint8)
    if len(middles) > 1:
        least, most = (np.array(np.broadcast_to(limit, len(away)), float) for limit in (least, most))
        ck.mark_near(middles, np.ascontiguousarray(away), least, most, reach, near)
    return near
