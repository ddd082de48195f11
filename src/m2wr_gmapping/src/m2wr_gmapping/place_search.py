"""Finding a place again: newest scans against old ones, coarse to fine, and what speaks against what was found."""
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping import correlative_kernels as ck
from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping.se2 import between, compose
from m2wr_gmapping.tile_maps import NEVER, TileMaps

NEAR_RASTER, WIDE_RASTER = 0.1, 0.2     # cell of the search raster [m]
MARGIN = 1.0                # of the raster around what can be hit [m]
RASTER_SCORE = 0.6          # least share of the best possible score
APART, APART_TURN = 0.6, 0.3            # a rival is that far from the best [m, rad]
RIVAL = 0.92                # a rival of that share of the best makes the place ambiguous
AGAIN, AGAIN_TURN = 0.5, 0.08           # window in which a wide find is looked for with the finer raster
BESIDE, BESIDE_TURN = 0.3, 0.06         # window of a place that is not the only one that fits
ROOM = 2.5                  # a wide search looks no farther than this from where the robot has been before [m]
BEYOND = 1.3                # rivals are looked for that much farther than the newest node may have drifted
ALIKE, ALIKE_TURN = 15.0, 0.1           # places that look alike are looked for so far around [m, rad]
ALIKE_SHARE, ALIKE_LONG = 0.8, 0.7      # what looks alike by that share of the score, and along a long stretch
FINE_REACH = 5.0            # old nodes that near to the found pose make the map of the fine match [m]
REFERENCE_NODES = 24        # old scans that make a map or the raster of a near search
WIDE_NODES, LONG_NODES = 160, 320       # old scans that make the raster of a wide search
JOINED_NODES = 4.0          # and more of them for each metre of a stretch that is matched together [1/m]
FINE_SHARE, FINE_FOUND = 0.5, 0.6       # least score and partners of the fine match, as shares of the beams
FINE_PRIOR = np.array([0.3, 0.3, 0.15])  # how far the fine match may be from the coarse one [m, m, rad]
JOINED_SPACING, JOINED_BEAMS = 0.1, 400     # cell that gives one beam to a match of several scans [m]; about so many
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
class Joined:
    """Beams (7, M) of several scans, for the matcher."""

    beams: np.ndarray


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
    parts = []
    for node in range(len(path) - 1, -1, -1):
        if along[-1] - along[node] > reach:
            break
        parts.append(np.stack(_placed(between(path[-1], path[node]), readings[node].points)))
    points = np.concatenate(parts, axis=1)
    return points[:, np.square(points).sum(axis=0) < away**2]


def _placed(pose, points):
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


def coarse_search(pose, query, path, reference, readings, window, turn, raster_cell, allowed=None):
    """Search the query around ``pose`` in a raster of the reference nodes' end points.

    Parameters
    ----------
    window, turn : float
        Half width [m], [rad].
    allowed : function, optional
        Of the offsets (N,) of blocks' middles, along x and y alike [m]; returns (N, N) bool, which are searched, rows
        along y.

    Returns
    -------
    (5,) float64
        ``best`` of ``correlative_kernels.search``.
    """
    radius = float(np.hypot(query[0], query[1]).max()) + window + MARGIN
    corner = pose[:2] - radius
    cells = int(2.0 * radius / raster_cell) + 2
    raster, coarse = np.zeros((cells, cells), np.uint8), np.empty((cells, cells), np.uint8)
    for node in reference:
        ck.stamp_points(path[node], readings[node].points, corner, 1.0 / raster_cell, raster)
    ck.block_maximum(raster, coarse)
    typical = max(1.0, float(np.hypot(query[0], query[1]).mean()))
    count = int(np.ceil(turn * typical / raster_cell))
    turns = np.arange(-count, count + 1) * (raster_cell / typical)
    blocks = int(np.ceil(window / raster_cell / ck.BLOCK))
    mask = np.ones((2 * blocks + 1, 2 * blocks + 1), np.uint8)
    if allowed is not None:
        middles = np.arange(-blocks, blocks + 1) * ck.BLOCK * raster_cell
        mask[:] = allowed(middles)
    best = np.empty(5)
    ck.search(pose, query, turns, mask, corner, 1.0 / raster_cell, raster, coarse, int(round(APART / raster_cell)),
              APART_TURN, RIVAL, best)
    return best


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
        return best[:3], False
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
    if score >= RASTER_SCORE and best[4] > RIVAL * best[3]:
        reach = LONG_PATH
        query, best, score = _stretch(scene, old, _before(scene, reach, BEYOND * shift + reach), reach, WIDE_RASTER)
    elif best[3] < RASTER_SCORE and query.shape[1] >= FEWEST_POINTS and shift <= SHORT_SHIFT:
        reach = SHORT_PATH
        query, best, score = _stretch(scene, old, reference, reach, NEAR_RASTER)
    if best[3] < RASTER_SCORE or best[4] > RIVAL * best[3]:
        return None
    away, moved = scene.path[old, :2] - scene.path[-1, :2], best[:2] - scene.path[-1, :2]
    if not ((np.hypot(*(away - moved).T) < ROOM) & (np.hypot(*moved) <= scene.shift[old])).any():
        return None
    alike = _elsewhere(scene, query)
    if np.hypot(*moved) > ROOM:
        alike = max(alike, _unmoved(scene, query, reach))
    if alike > RIVAL * score:
        return None
    return Place(best[:3], best[3], reach, alike > (ALIKE_LONG if reach == LONG_PATH else ALIKE_SHARE) * score)


def _stretch(scene, old, reference, reach, cell):
    """Search the scans of the last ``reach`` metres around the old nodes, in a raster of the ``reference`` nodes.

    Returns
    -------
    query : (2, Q) float64
    best : (5,) float64
        As ``coarse_search`` returns it, of the finest search there was; all 0 where there is too little to search.
    score : float
        Of the first search.
    """
    path, readings, pose = scene.path, scene.readings, scene.path[-1]
    query = query_points(path, scene.along, readings, reach, max(reach, QUERY_REACH))
    query = thinned(spread_out(query, WIDE_SPACING), WIDE_POINTS)
    if query.shape[1] < FEWEST_POINTS or not len(reference):
        return query, np.zeros(5), 0.0
    away, shifts, turn = path[old, :2] - pose[:2], scene.shift[old], float(scene.turn[old].max())
    best = coarse_search(pose, query, path, reference, readings, BEYOND * float(shifts.max()), turn, cell,
                         lambda middles: _allowed(middles, away, np.zeros(len(away)), BEYOND * shifts))
    score = float(best[3])
    if score >= RASTER_SCORE and best[4] <= RIVAL * score:
        best = coarse_search(best[:3], query, path, reference, readings, AGAIN, AGAIN_TURN, NEAR_RASTER)
    return query, best, score


def _before(scene, reach, distance):
    """Return old nodes within ``distance`` [m] that are not among the last ``reach`` metres, LONG_NODES at most."""
    known = scene.old[(scene.distance[scene.old] < distance)
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
    """Return the score of the best place that it cannot be: looks tell little where it is high."""
    path, known = scene.path, scene.old[scene.distance[scene.old] < ALIKE + ROOM]
    if not len(known):
        return 0.0
    reference = known[::max(1, -(-len(known) // WIDE_NODES))]
    away, least = path[known, :2] - path[-1, :2], BEYOND * scene.shift[known] + APART
    best = coarse_search(path[-1], query, path, reference, scene.readings, ALIKE, ALIKE_TURN, WIDE_RASTER,
                         lambda middles: _allowed(middles, away, least, np.full(len(away), ALIKE)))
    return best[3]


def _allowed(middles, away, least, most):
    """Return (N, N) bool: offsets that lead near an old node, and are of the size allowed for it.

    Parameters
    ----------
    middles : (N,) float
        Offsets along either axis [m].
    away : (C, 2) float
        Old nodes, seen from the newest, in the map's axes [m].
    least, most : (C,) float
        Length of the offset [m].
    """
    near = np.zeros((len(middles), len(middles)), bool)
    size = middles[1] - middles[0]
    room = int(np.ceil(ROOM / size))
    column, row = np.round((away - middles[0]) / size).astype(np.int64).T
    for dy in range(-room, room + 1):
        for dx in range(-room, room + 1):
            x, y = column + dx, row + dy
            inside = (x >= 0) & (y >= 0) & (x < len(middles)) & (y < len(middles))
            x, y = x[inside], y[inside]
            length = np.hypot(middles[x], middles[y])
            near[y, x] |= (length >= least[inside]) & (length <= most[inside])
    return near


def joined(scene, reach):
    """Return the scans (Joined) of the last ``reach`` metres, as if the newest node had seen what they have."""
    path, along, parts = scene.path, scene.along, []
    for node in range(len(path) - 1, -1, -1):
        if along[-1] - along[node] > reach:
            break
        beams, pose = scene.readings[node].beams.copy(), between(path[-1], path[node])
        beams[[mk.QX, mk.QY]] = _placed(pose, beams[[mk.QX, mk.QY]])
        beams[[mk.NX, mk.NY]] = _placed([0.0, 0.0, pose[2]], beams[[mk.NX, mk.NY]])
        parts.append(beams[:, np.square(beams[[mk.QX, mk.QY]]).sum(axis=0) < QUERY_REACH**2])
    beams = np.concatenate(parts, axis=1)
    beams = thinned(beams[:, spread_first(beams[[mk.QX, mk.QY]], JOINED_SPACING)], JOINED_BEAMS)
    qx, qy, nx, ny = beams[[mk.QX, mk.QY, mk.NX, mk.NY]]
    beams[mk.ARM_N], beams[mk.ARM_T] = ny * qx - nx * qy, nx * qx + ny * qy
    return Joined(beams)


def fine_match(matcher, resolution, scene, old, pose, reach=0.0):
    """Match the newest scan, or those of a stretch, near ``pose`` in a map of the old nodes around it.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of that map [m].
    scene : Scene
    old : (C,) int
        Nodes to take.
    pose : (3,) float64
    reach : float
        Path whose scans are matched together [m]; 0: the newest one alone.

    Returns
    -------
    node : int
        The nearest of the old nodes.
    row : (13,) float64
        Result row of ``match_kernels``.
    around : (A,) int
        The old nodes; None in place of all three where the scans do not fit.
    """
    path, readings = scene.path, scene.readings
    distance = np.hypot(path[old, 0] - pose[0], path[old, 1] - pose[1])
    order = np.argsort(distance, kind="stable")
    further = min(reach, QUERY_REACH)
    around = old[order][distance[order] < FINE_REACH + further][:REFERENCE_NODES + int(JOINED_NODES * further)]
    reading = joined(scene, reach) if reach else readings[-1]
    beams = reading.beams.shape[1]
    if not len(around) or not beams:
        return None
    maps = TileMaps(1, resolution, NEVER)
    for node in around:
        _write(maps, path[node], readings[node])
    row = matcher.match_one(maps, 0, reading, pose, pose, 1.0 / np.square(FINE_PRIOR))
    if row[mk.SCORE] < FINE_SHARE * beams or row[mk.FOUND] < FINE_FOUND * beams:
        return None
    return int(around[0]), row, around


def _write(maps, pose, reading):
    """Register a scan in a scratch map."""
    if reading.points.shape[1]:
        reach = float(np.hypot(reading.points[0], reading.points[1]).max())
        maps.cover(pose[:2] - reach, pose[:2] + reach)
        maps.register(0, pose, reading.points)


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
    for pose, node in zip(compose(pose, between(path[-1], path[nodes])), nodes):
        for other in around[:4 * LOOKS:4]:
            for eye, seen, reading, others in ((pose, path[other], readings[node], readings[other]),
                                               (path[other], pose, readings[other], readings[node])):
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
    x, y = _placed(seen, points)
    at, far = np.arctan2(y, x), np.hypot(x, y)
    after = np.searchsorted(angle, at)
    inside = (after > 0) & (after < len(angle))
    at, far, after = at[inside], far[inside], after[inside]
    gap = angle[after] - angle[after - 1]
    least = np.minimum(reach[after], reach[after - 1])
    beside = gap < 2.5 * np.median(np.diff(angle))
    return int((beside & (far + LOOKED_THROUGH < least)).sum()), int((beside & (far < least + LOOKED_THROUGH)).sum())
