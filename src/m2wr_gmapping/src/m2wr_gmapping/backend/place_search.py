# SPDX-License-Identifier: BSD-3-Clause
"""Finding a place again: newest scans against old ones, coarse to fine, and what speaks against what was found."""
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.frontend import correlative_kernels as ck
from m2wr_gmapping.se2 import between, compose

NEAR_RASTER, WIDE_RASTER = 0.1, 0.2     # cell of the search raster [m]
MARGIN = 1.0                # of the raster around what can be hit [m]
RASTER_SCORE = 0.6          # least share of the best possible score
APART, APART_TURN = 0.6, 0.3            # a rival is that far from the best [m, rad]
RIVAL = 0.92                # a rival of that share of the best makes the place ambiguous
AGAIN, AGAIN_TURN = 0.5, 0.08           # window in which a wide find is looked for with the finer raster
BESIDE, BESIDE_TURN = 0.3, 0.06         # window of a place that is not the only one that fits
ROOM = 2.5                  # a wide search looks no farther than this from where the robot has been before [m]
BEYOND = 1.3                # rivals are looked for that much farther than the newest node may have drifted
AGAINST = 3                 # a point that lies in free space speaks against a place as so many on walls speak for it
UNLIKE = 0.9                # what RIVAL is for such ratings
AS_GOOD_CELLS = 9           # cells of the finer raster a side, among which a place is rated
PUSHED = 10.0               # a stretch may have been pushed by so much onto known ground [m]
ALIKE, ALIKE_TURN = 15.0, 0.1           # places that look alike are looked for so far around [m, rad]
ALIKE_SHARE, ALIKE_LONG = 0.8, 0.7      # what looks alike by that share of the score, and along a long stretch
REFERENCE_NODES = 24        # old scans that make a map or the raster of a near search
WIDE_NODES, LONG_NODES = 160, 320       # old scans that make the raster of a wide search
FEWEST_POINTS = 30          # of a query
QUERY_REACH = 12.0          # farther end points take no part: they would make the raster large [m]
NEAR_PATH = 3.0             # path whose scans a near search takes together [m]
QUERY_POINTS, WIDE_POINTS = 160, 240
WIDE_PATH, LONG_PATH, SHORT_PATH = 10.0, 24.0, 3.0      # path whose scans a wide search takes together [m]
SHORT_SHIFT = 6.0           # the shortest one only where no more than that has drifted [m]
WIDE_SPACING = 0.25         # cell that gives one point to the query of a wide search [m]
LOOKED_THROUGH = 0.4        # a scan looks through a surface if it reaches that much farther [m]
LOOKS = 3                   # scans of the query, and of the old ones times four, that are held against each other


@dataclass(frozen=True)
class Place:
    """What a wide search has found.

    Attributes
    ----------
    pose : (3,) float64
        Of the newest node.
    score : float
    reach : float
        Path whose scans fit there [m].
    alike : bool
        Whether a place that it cannot be looks like this one, or where it is thought to be, if that is far from here.
    """

    pose: np.ndarray
    score: float
    reach: float
    alike: bool


@dataclass(frozen=True)
class Scene:
    """The path as it is now, and how far the newest node may have drifted from each other one.

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

    path: np.ndarray
    along: np.ndarray
    readings: list
    old: np.ndarray
    shift: np.ndarray
    turn: np.ndarray

    @property
    def distance(self):
        """Distance (K,) of each node from the newest [m]."""
        return np.hypot(self.path[:, 0] - self.path[-1, 0], self.path[:, 1] - self.path[-1, 1])


def query_points(path, along, readings, reach, away=QUERY_REACH):
    """Return end points (2, Q) of the scans on the last ``reach`` metres of the path, in the newest node's frame."""
    first = int(np.searchsorted(along, along[-1] - reach))
    points = np.empty((2, sum(readings[node].points.shape[1] for node in range(first, len(path)))))
    count = 0
    for node in range(len(path) - 1, first - 1, -1):
        count = ck.add_points(path[-1], path[node], readings[node].points, away, points, count)
    return points[:, :count]


def placed(pose, points):
    """Return x (Q,) and y (Q,) of points (2, Q), given in the frame ``pose`` (3,), in the one that it is given in."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return pose[0] + c * points[0] - s * points[1], pose[1] + s * points[0] + c * points[1]


def thinned(points, count):
    """Return about ``count`` of the points (2, Q), evenly."""
    return np.ascontiguousarray(points[:, ::max(1, points.shape[1] // count)])


def spread_out(points, spacing):
    """Return one of the points (2, Q) for each cell of ``spacing`` [m]: what was seen often counts once."""
    return points[:, spread_first(points, spacing)]


def spread_first(points, spacing):
    """Return the numbers (M,) of those that ``spread_out`` takes."""
    cells = np.floor(points / spacing).astype(np.int64)
    _, first = np.unique(cells[0] * 100003 + cells[1], return_index=True)
    return np.sort(first)


def _raster(pose, query, path, reference, readings, window, raster_cell):
    """Return the corner (2,) [m] and the raster of the reference nodes' end points, for the query around ``pose``."""
    radius = float(np.hypot(query[0], query[1]).max()) + window + MARGIN
    corner = pose[:2] - radius
    cells = int(2.0 * radius / raster_cell) + 2
    raster = np.zeros((cells, cells), np.uint8)
    for node in reference:
        ck.stamp_points(path[node], readings[node].points, corner, 1.0 / raster_cell, raster)
    return corner, raster


def coarse_search(pose, query, path, reference, readings, window, turn, raster_cell, allowed=None):
    """Search the query around ``pose`` in a raster of the reference nodes' end points.

    Parameters
    ----------
    window, turn : float
        Half width [m], [rad].
    allowed : function, optional
        Of the offsets (N,) of blocks' middles, along x and y alike [m]; returns (N, N) uint8, which are searched, rows
        along y.

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
              APART_TURN, RIVAL, best)
    return best


def _rated(pose, query, scene, reference, allowed, raster_cell):
    """Rate the places around ``pose`` that are ``allowed`` (N, N): ``rating`` and ``turn`` [rad] of ``ck.survey``."""
    window = len(allowed) // 2 * raster_cell
    corner, raster = _raster(pose, query, scene.path, reference, scene.readings, window, raster_cell)
    seen = np.zeros_like(raster)
    for node in reference:
        ck.mark_seen(scene.path[node], scene.readings[node].rays, corner, 1.0 / raster_cell, seen)
    turns = np.arange(-2, 3) * (0.5 * raster_cell / max(1.0, float(np.hypot(query[0], query[1]).mean())))
    rating, turn = np.empty((2, *allowed.shape))
    ck.survey(pose, query, turns, allowed, corner, 1.0 / raster_cell, raster, seen, AGAINST, UNLIKE, rating, turn)
    return rating, turns[turn.astype(np.int64)]


def looked_around(pose, query, scene, old, reference, most, raster_cell):
    """Return the place around ``pose`` for which most speaks, None where it is not the only one.

    A stretch that leads beyond what old scans saw fits best, by all of it, where it is pushed onto known ground.

    Parameters
    ----------
    old, reference : (C,) int
        Nodes near one of which the place must be, and those that make the raster.
    most : float
        The newest node may have drifted by no more [m].
    """
    path = scene.path
    blocks = int(np.ceil(min(PUSHED, 2.0 * most) / raster_cell / ck.BLOCK))
    middles = np.arange(-blocks, blocks + 1) * (ck.BLOCK * raster_cell)
    x, y = np.meshgrid(*(pose[:2, None] + middles - path[-1, :2, None]))
    allowed = _allowed(middles, path[old, :2] - pose[:2], np.zeros(len(old)), np.full(len(old), np.inf))
    allowed *= np.hypot(x, y) <= most + APART
    allowed = allowed.repeat(ck.BLOCK, axis=0).repeat(ck.BLOCK, axis=1)
    rating, turn = _rated(pose, query, scene, reference, allowed, raster_cell)
    half, room = len(allowed) // 2, int(round(APART / raster_cell))
    y, x = np.unravel_index(int(np.argmax(rating)), rating.shape)
    others = rating.copy()
    others[max(0, y - room):y + room + 1, max(0, x - room):x + room + 1] = 0.0
    if others.max() >= UNLIKE * rating[y, x]:
        return None
    if max(abs(y - half), abs(x - half)) <= room:
        return pose
    return pose + [(x - half) * raster_cell, (y - half) * raster_cell, turn[y, x]]


def near_search(scene, old):
    """Look for the newest node close to where it is thought to be.

    Parameters
    ----------
    scene : Scene
    old : (C,) int
        Nodes to look among.

    Returns
    -------
    pose : (3,) float64 or None
    ambiguous : bool
        Whether other places fit as well; then ``pose`` is the best one closest to where the node is thought to be.
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
        pose = looked_around(best[:3], query, scene, old, reference, window, NEAR_RASTER)
        if pose is not None and (pose == best[:3]).all():
            return pose, False
    least = RIVAL * best[3]
    best = coarse_search(path[-1], query, path, reference, readings, BESIDE, BESIDE_TURN, NEAR_RASTER)
    return (best[:3] if best[3] >= least else None), True


def wide_search(scene, old):
    """Look for the newest node wherever it may have drifted away from, along the old path.

    The scans of a stretch are searched together. Where several places fit, those of a longer stretch may tell which:
    ten metres of a corridor look alike more often than all of it does. A robot that has only just come back has a short
    stretch in common.

    Parameters
    ----------
    scene : Scene
    old : (C,) int
        Nodes to look among.

    Returns
    -------
    Place or None
    """
    shift = float(scene.shift[old].max())
    reach, reference = WIDE_PATH, old[::max(1, -(-len(old) // WIDE_NODES))]
    query, best, score = _stretch(scene, old, reference, reach, WIDE_RASTER)
    raster_cell = WIDE_RASTER
    if score >= RASTER_SCORE and best[4] > RIVAL * best[3]:
        closer = _closer(scene, old, query, reference, best)
        if closer[3] >= RASTER_SCORE and closer[4] <= RIVAL * closer[3]:
            best, raster_cell = closer, NEAR_RASTER
    if score >= RASTER_SCORE and best[4] > RIVAL * best[3]:
        reach = LONG_PATH
        reference = _before(scene, reach, BEYOND * shift + reach, float(scene.shift[old].min()))
        query, best, score = _stretch(scene, old, reference, reach, WIDE_RASTER)
    elif best[3] < RASTER_SCORE and query.shape[1] >= FEWEST_POINTS and shift <= SHORT_SHIFT:
        reach = SHORT_PATH
        query, best, score = _stretch(scene, old, reference, reach, NEAR_RASTER)
    if best[3] < RASTER_SCORE or best[4] > RIVAL * best[3]:
        return None
    pose = looked_around(best[:3], query, scene, old, reference, BEYOND * shift, raster_cell)
    if pose is None:
        return None
    best[:3] = pose
    away, moved = scene.path[old, :2] - scene.path[-1, :2], best[:2] - scene.path[-1, :2]
    if not ((np.hypot(*(away - moved).T) < ROOM) & (np.hypot(*moved) <= scene.shift[old])).any():
        return None
    other, known = _elsewhere(scene, query)
    if other[3] > RIVAL * score and _as_good(other[:3], known, best[:3], reference, query, scene):
        return None
    unmoved = _unmoved(scene, query, reach) if np.hypot(*moved) > ROOM else 0.0
    if unmoved > RIVAL * score:
        return None
    alike = max(other[3], unmoved)
    return Place(best[:3], best[3], reach, alike > (ALIKE_LONG if reach == LONG_PATH else ALIKE_SHARE) * score)


def _stretch(scene, old, reference, reach, cell):
    """Search the scans of the last ``reach`` metres around the old nodes, in a raster of the ``reference`` nodes.

    Returns
    -------
    query : (2, Q) float64
    best : (7,) float64
        As ``coarse_search`` returns it, of the finest search there was; all 0 where there is too little to search.
    score : float
        Of the first search.
    """
    path, readings, pose = scene.path, scene.readings, scene.path[-1]
    query = query_points(path, scene.along, readings, reach, max(reach, QUERY_REACH))
    query = thinned(spread_out(query, WIDE_SPACING), WIDE_POINTS)
    if query.shape[1] < FEWEST_POINTS or not len(reference):
        return query, np.zeros(7), 0.0
    away, shifts, turn = path[old, :2] - pose[:2], scene.shift[old], float(scene.turn[old].max())
    best = coarse_search(pose, query, path, reference, readings, BEYOND * float(shifts.max()), turn, cell,
                         lambda middles: _allowed(middles, away, np.zeros(len(away)), BEYOND * shifts))
    score = float(best[3])
    if score >= RASTER_SCORE and best[4] <= RIVAL * score:
        best = coarse_search(best[:3], query, path, reference, readings, AGAIN, AGAIN_TURN, NEAR_RASTER)
    return query, best, score


def _closer(scene, old, query, reference, best):
    """Search once more in a finer raster on the line through the best place and its rival: where a corridor leads."""
    away, most = scene.path[old, :2] - best[:2], BEYOND * scene.shift[old]
    moved = best[:2] - scene.path[-1, :2]
    along = best[5:7] - best[:2]
    along = along / max(float(np.hypot(*along)), 1e-9)      # a rival may be the same place, turned

    def allowed(middles):
        x, y = np.meshgrid(middles, middles)
        beside = np.abs(along[0] * y - along[1] * x) <= APART
        near = _allowed(middles, away, np.zeros(len(away)), np.full(len(away), np.inf))
        return near * beside * (np.hypot(x + moved[0], y + moved[1]) <= most.max())

    window = float(np.hypot(*moved)) + float(most.max())
    return coarse_search(best[:3], query, scene.path, reference, scene.readings, window, AGAIN_TURN, NEAR_RASTER,
                         allowed)


def _before(scene, reach, distance, drift=0.0):
    """Return old nodes within ``distance`` [m] that are not among the last ``reach`` metres, LONG_NODES at most.

    From each of them the newest node may have drifted by ``drift`` [m] or more: what has drifted along with it fits
    where it is thought to be, whether that is so or not.
    """
    known = scene.old[(scene.distance[scene.old] < distance) & (scene.shift[scene.old] >= drift)
                      & (scene.along[scene.old] < scene.along[-1] - reach - ROOM)]
    return known[::max(1, -(-len(known) // LONG_NODES))]


def _unmoved(scene, query, reach):
    """Return the score of the query where it is thought to be: what fits there as well need not be elsewhere."""
    reference = _before(scene, reach, QUERY_REACH + reach)
    if not len(reference):
        return 0.0
    return coarse_search(scene.path[-1], query, scene.path, reference, scene.readings, BESIDE, BESIDE_TURN,
                         WIDE_RASTER)[3]


def _elsewhere(scene, query):
    """Return the best place that it cannot be, and the nodes there: looks tell little where it fits."""
    path, known = scene.path, scene.old[scene.distance[scene.old] < ALIKE + ROOM]
    if not len(known):
        return np.zeros(7), known
    reference = known[::max(1, -(-len(known) // WIDE_NODES))]
    away, least = path[known, :2] - path[-1, :2], BEYOND * scene.shift[known] + APART
    best = coarse_search(path[-1], query, path, reference, scene.readings, ALIKE, ALIKE_TURN, WIDE_RASTER,
                         lambda middles: _allowed(middles, away, least, np.full(len(away), ALIKE)))
    return best, reference


def _as_good(other, known, pose, reference, query, scene):
    """Whether as much speaks for a place, seen among the nodes ``known``, as for ``pose`` among ``reference``."""
    allowed = np.ones((AS_GOOD_CELLS, AS_GOOD_CELLS), np.uint8)
    ratings = [_rated(place, query, scene, nodes, allowed, NEAR_RASTER)[0].max()
               for place, nodes in ((other, known), (pose, reference))]
    return bool(ratings[0] >= UNLIKE * ratings[1])


def _allowed(middles, away, least, most):
    """Return (N, N) uint8: offsets that lead near an old node, and are of the size allowed for it.

    Parameters
    ----------
    middles : (N,) float
        Offsets along either axis [m].
    away : (C, 2) float
        Old nodes, seen from the newest, in the map's axes [m].
    least, most : (C,) float
        Length of the offset [m].
    """
    near = np.zeros((len(middles), len(middles)), np.uint8)
    if len(middles) > 1:
        ck.mark_near(middles, np.ascontiguousarray(away), least, most, ROOM, near)
    return near


def looked_through(scene, pose, around):
    """Return which share of end points new and old scans look through, of those that lie where the others look.

    Parameters
    ----------
    scene : Scene
    pose : (3,) float64
        Where the newest scan would have been taken; those before it stay where they are, seen from there.
    around : (A,) int
        Old nodes.
    """
    path, readings = scene.path, scene.readings
    wanted = scene.along[-1] - np.linspace(0.0, WIDE_PATH, LOOKS)
    nodes = np.unique(np.clip(np.searchsorted(scene.along, wanted), 0, len(path) - 1))
    through = total = 0
    for moved, node in zip(compose(pose, between(path[-1], path[nodes])), nodes):
        for other in around[:4 * LOOKS:4]:
            for eye, seen, reading, others in ((moved, path[other], readings[node], readings[other]),
                                               (path[other], moved, readings[other], readings[node])):
                a, b = _through(reading.rays, between(eye, seen), others.points)
                through, total = through + a, total + b
    return through / max(1, total)


def _through(rays, seen, points):
    """Count the points (2, B) of a scan at pose ``seen`` that the rays (2, S) go through, and those they could."""
    if rays.shape[1] < 2:
        return 0, 0
    angle, reach = np.arctan2(rays[1], rays[0]), np.hypot(rays[0], rays[1])
    order = np.argsort(angle, kind="stable")
    angle, reach = angle[order], reach[order]
    x, y = placed(seen, points)
    at, far = np.arctan2(y, x), np.hypot(x, y)
    after = np.searchsorted(angle, at)
    inside = (after > 0) & (after < len(angle))
    at, far, after = at[inside], far[inside], after[inside]
    gap = angle[after] - angle[after - 1]
    least = np.minimum(reach[after], reach[after - 1])
    beside = gap < 2.5 * np.median(np.diff(angle))
    return int((beside & (far + LOOKED_THROUGH < least)).sum()), int((beside & (far < least + LOOKED_THROUGH)).sum())
