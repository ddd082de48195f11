# SPDX-License-Identifier: BSD-3-Clause
"""Where one map lies on another one, without a guess.

All rotations in steps of 2 degrees are tried; for each, correlation by the Fourier transform gives the score of all
shifts at once, on cells of 0.2 m. The best ones are improved on the maps' own cells. A score counts obstacles of each
map that lie on obstacles of the other, minus AGAINST times those that lie in free space of the other. What contradicts
says more than what agrees: at right places 2 % of the obstacles contradict, at the best of wrong ones 13 %. But a thing
that moved contradicts at the right place, too. The two faces of a wall are not one: obstacles whose free sides are
opposite neither agree nor contradict. Of 240 pairs of maps, by three robots in ten worlds, AGAINST = 1 places
133 rightly and 1 wrongly, 4 places 170 and 1, 10 places 174 and 9.

A wrong place is worse than none. So a place is only accepted if enough wall agrees, hardly any contradicts (the
acceptance index of Carpin, Autonomous Robots 25, 2008), and no other place explains the maps nearly as well: two equal
rooms, or a corridor without an end, are refused.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, List, Tuple

import numpy as np
from scipy import fftpack  # scipy.fft is not in the SciPy of Ubuntu 20.04

from m2wr_exploration.team.merge_kernels import agreement, draw_coarse, find_free_sides
from m2wr_maps.se2 import inverse
from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_navigation.localization.field_kernels import distance_transform

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import BoolArray, Complex64Array, FloatArray

COARSE = 0.2                # m: cells of the search
TURNS = 180                 # rotations of the search
PEAKS = 3                   # shifts of each rotation that are kept
CANDIDATES = 10             # places that are improved
AGAINST = 4.0               # obstacles that have to agree for one that contradicts
NEAR, SPREAD = 0.15, 0.06   # m: obstacles nearer than this agree; width of the peak of the score
BESIDE = 0.2                # m: within which free space tells on which side of an obstacle it is free
APART, TURNED = 0.6, 0.15   # m, rad: places that differ by more are others
WALL = 10.0                 # m of wall in each map that have to agree
AGREE = 0.96                # share of the obstacles in the overlap that have to agree
OTHER = 0.7                 # of the best score: most that another place may have
MOST_CELLS = 4096           # along a side of the search


@dataclass(frozen=True)
class Match:
    """What came of a comparison of two maps.

    Attributes
    ----------
    pose : (3,) float64
        Of the second map's frame in the first one's [m, m, rad].
    confidence : float
        Least of: wall that agrees / WALL, contradicting share allowed / found, and the distance of the second best
        place from the best one / that demanded. At least 1: can be relied on.
    wall : float
        Length of the wall that agrees [m].
    agree : float
        Share of the obstacles in the overlap that agree.
    other : float
        Score of the second best place / score of the best one.
    reason : str
        Why the confidence is below 1; otherwise empty.
    """

    pose: FloatArray
    confidence: float
    wall: float
    agree: float
    other: float
    reason: str


class _Side:
    """A map, as far as it is compared."""

    def __init__(self, costmap: Costmap) -> None:
        self.costmap, size = costmap, costmap.resolution
        lethal = costmap.costs == LETHAL
        self.points = _centres(lethal, 1, costmap)
        free = (costmap.costs != NO_INFORMATION) & ~lethal
        step = max(1, int(0.5 * COARSE / size))     # enough points for one in each coarse cell, at any rotation
        self.free = _centres(free, step, costmap)
        away = np.empty(costmap.shape, np.float32)
        distance_transform(lethal, NEAR / size + 2.0, away)
        away *= np.float32(size)
        self.field = np.where(away <= NEAR, np.exp(-0.5 * np.square(away / SPREAD)), -AGAINST * free).astype(np.float32)
        self.sides = np.zeros(costmap.shape + (2,), np.float32)
        self.normals = find_free_sides(np.ascontiguousarray(np.argwhere(lethal)), free, max(1, round(BESIDE / size)),
                                       math.ceil(NEAR / size), self.sides)
        known = np.concatenate([self.points, self.free])
        self.middle = 0.5 * (known.min(axis=0) + known.max(axis=0)) if len(known) else np.zeros(2)
        self.reach = float(np.sqrt(np.square(known - self.middle).sum(axis=1).max())) if len(known) else 0.0

    def coarse(self, yaw: float, cells: int) -> Complex64Array:
        """Return field + i obstacles of the map rotated about its middle [rad], (cells, cells), as ``draw_coarse``."""
        image = np.zeros((cells, cells), np.complex64)
        draw_coarse(image, self.points, self.free, self.middle, yaw, COARSE)
        return image


def _centres(cells: BoolArray, step: int, costmap: Costmap) -> FloatArray:
    """Return the centres of some cells, of each ``step``-th row and column [m], (N, 2)."""
    rows, columns = np.nonzero(cells[::step, ::step])
    return (np.stack([columns, rows], axis=1) * step + 0.5) * costmap.resolution + costmap.origin


def _place(first: _Side, second: _Side, yaw: float, shift: Tuple[float, float]) -> FloatArray:
    """Return the pose for which the middle of the second map lies beside that of the first one by a shift [m]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    x = first.middle[0] + shift[0] - (cosine * second.middle[0] - sine * second.middle[1])
    y = first.middle[1] + shift[1] - (sine * second.middle[0] + cosine * second.middle[1])
    return np.array([x, y, yaw])


def _search(first: _Side, second: _Side) -> List[Tuple[float, FloatArray]]:
    """Return scores and poses of the best places on coarse cells, the best one first.

    With field F and obstacles O, the real part of the correlation of O1 + i F1 with F2 + i O2 is the score of a shift,
    the sum of O1 F2 + F1 O2.
    """
    cells = 2 + math.ceil(2.0 * (first.reach + second.reach) / COARSE)
    if cells > MOST_CELLS:
        raise ValueError("the maps are {:.0f} and {:.0f} m wide; expected at most {:.0f} m together".format(
            2.0 * first.reach, 2.0 * second.reach, MOST_CELLS * COARSE))
    cells = fftpack.next_fast_len(cells)
    fixed = fftpack.fft2(1j * np.conj(first.coarse(0.0, cells)))
    found: List[Tuple[float, FloatArray]] = []
    for turn in range(TURNS):
        yaw = 2.0 * math.pi * turn / TURNS
        moved = fftpack.fft2(second.coarse(yaw, cells), overwrite_x=True)
        scores = fftpack.ifft2(fixed * np.conj(moved), overwrite_x=True).real
        for _ in range(PEAKS):
            row, column = divmod(int(np.argmax(scores)), cells)
            shift = [COARSE * (place - cells if place > cells // 2 else place) for place in (column, row)]
            found.append((float(scores[row, column]), _place(first, second, yaw, (shift[0], shift[1]))))
            window = int(APART / COARSE)
            rows = np.arange(row - window, row + window + 1) % cells
            columns = np.arange(column - window, column + window + 1) % cells
            scores[np.ix_(rows, columns)] = -np.inf
    return _distinct(second, sorted(found, key=lambda entry: -entry[0]))


def _distinct(second: _Side, found: List[Tuple[float, FloatArray]]) -> List[Tuple[float, FloatArray]]:
    """Return the first CANDIDATES that are not beside a better one, as seen at the middle of the second map."""
    kept: List[Tuple[float, FloatArray, FloatArray]] = []
    for score, pose in found:
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        middle = pose[:2] + np.array([cosine * second.middle[0] - sine * second.middle[1],
                                      sine * second.middle[0] + cosine * second.middle[1]])
        if all(np.hypot(*(middle - other)) > APART or abs(math.remainder(pose[2] - placed[2], 2.0 * math.pi)) > TURNED
               for _, placed, other in kept):
            kept.append((score, pose, middle))
        if len(kept) == CANDIDATES:
            break
    return [(score, pose) for score, pose, _ in kept]


def _both(first: _Side, second: _Side, pose: FloatArray) -> Tuple[float, int, int, int]:
    """Return the score of a place in metres, the least agreeing cells of one map, and all that agree and contradict."""
    one = agreement(second.points, second.normals, first.field, first.sides, first.costmap.resolution,
                    first.costmap.origin, pose)
    two = agreement(first.points, first.normals, second.field, second.sides, second.costmap.resolution,
                    second.costmap.origin, inverse(pose))
    return one[0] + two[0], min(one[1], two[1]), one[1] + two[1], one[2] + two[2]


def _improved(first: _Side, second: _Side, pose: FloatArray) -> Tuple[float, FloatArray]:
    """Return the best score around a pose, and its pose: steps to the best neighbour, which are halved."""
    best, step, turn = _both(first, second, pose)[0], COARSE, math.pi / TURNS
    while step > 0.004:
        tries = [pose + np.array(change) for change in (
            (step, 0, 0), (-step, 0, 0), (0, step, 0), (0, -step, 0))]
        for angle in (turn, -turn):
            rotated = pose.copy()       # about the middle of the second map
            cosine, sine = math.cos(angle), math.sin(angle)
            own = (math.cos(pose[2]), math.sin(pose[2]))
            middle = pose[:2] + np.array([own[0] * second.middle[0] - own[1] * second.middle[1],
                                          own[1] * second.middle[0] + own[0] * second.middle[1]])
            rotated[:2] = middle + np.array([(cosine, -sine), (sine, cosine)]) @ (pose[:2] - middle)
            rotated[2] += angle
            tries.append(rotated)
        scores = [_both(first, second, candidate)[0] for candidate in tries]
        if max(scores) > best:
            best, pose = max(scores), tries[int(np.argmax(scores))]
        else:
            step, turn = 0.5 * step, 0.5 * turn
    return best, np.array([pose[0], pose[1], math.remainder(pose[2], 2.0 * math.pi)])


def match(first: Costmap, second: Costmap) -> Match:
    """Find where a map lies on another one.

    Parameters
    ----------
    first, second : Costmap
        Only lethal, unknown and other cells are told apart.

    Returns
    -------
    Match

    Raises
    ------
    ValueError
        If the maps are too large for the search.
    """
    sides = _Side(first), _Side(second)
    least = [len(side.points) * side.costmap.resolution for side in sides]
    if min(least) < WALL:
        return Match(np.zeros(3), min(least) / WALL * 0.99, min(least), 0.0, 1.0, "the maps have {:.1f} m and {:.1f} m "
                     "of wall; at least {:g} m are needed".format(least[0], least[1], WALL))
    improved = sorted((_improved(sides[0], sides[1], pose) for _, pose in _search(*sides)), key=lambda each: -each[0])
    found = _distinct(sides[1], improved)
    score, pose = found[0]
    _, cells, agreeing, contradicting = _both(sides[0], sides[1], pose)
    size = max(first.resolution, second.resolution)
    wall, agree = cells * size, agreeing / max(1.0, float(agreeing + contradicting))
    other = max(0.0, found[1][0]) / score if len(found) > 1 and score > 0.0 else (0.0 if score > 0.0 else 1.0)
    tests = ((wall / WALL, "only {:.1f} m of wall agree; {:g} m are needed".format(wall, WALL)),
             ((1.0 - AGREE) / max(1e-3, 1.0 - agree), "{:.0f} % of the obstacles that both maps could have seen "
              "contradict; {:.0f} % are allowed".format(100.0 * (1.0 - agree), 100.0 * (1.0 - AGREE))),
             ((1.0 - other) / (1.0 - OTHER), "another place fits {:.0f} % as well; at most {:.0f} % are allowed".format(
                 100.0 * other, 100.0 * OTHER)))
    confidence, reason = min(tests)
    return Match(pose, float(confidence), wall, agree, other, "" if confidence >= 1.0 else reason)


def agreement_of(first: Costmap, second: Costmap, pose: FloatArray) -> float:
    """Return the share of the obstacles in the overlap of two maps that agree; 1 if they do not overlap.

    Parameters
    ----------
    first, second : Costmap
    pose : (3,) float64
        Of the second map's frame in the first one's [m, m, rad].
    """
    _, _, agreeing, contradicting = _both(_Side(first), _Side(second), pose)
    return agreeing / (agreeing + contradicting) if agreeing + contradicting else 1.0


def refined(first: Costmap, second: Costmap, pose: FloatArray) -> FloatArray:
    """Return the best place beside a known one, (3,) float64 [m, m, rad]; the known one if less than WALL agrees.

    Parameters
    ----------
    first, second : Costmap
    pose : (3,) float64
        Of the second map's frame in the first one's [m, m, rad].
    """
    sides = _Side(first), _Side(second)
    _, found = _improved(sides[0], sides[1], pose)
    enough = _both(sides[0], sides[1], found)[1] * max(first.resolution, second.resolution) >= WALL
    return found if enough else pose
