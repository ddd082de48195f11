# SPDX-License-Identifier: BSD-3-Clause
"""Reduces the contacts that libode finds for a pair of geoms: averages, selects and sorts them in compiled code.

``values`` holds the contacts one after another, the first at word ``first``; see step_layout.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np
from numba import njit

from m2wr_sim.physics.step_layout import (
    C_DEPTH,
    C_GEOMETRY,
    C_NORMAL,
    C_POSITION,
    CONTACT_WORDS,
    MAX_FOUND,
    SAME_DEPTH,
    SAME_DIRECTION,
    SAME_PLACE,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]
    Values = NDArray[np.float64]

FACES, _SAME_FACE, _SAME_PLANE = 4, 0.8, 0.998          # as in contacts


@njit(cache=True, nogil=True, error_model="numpy")
def rotate(x: float, y: float, z: float, w: float, vx: float, vy: float, vz: float) -> Tuple[float, float, float]:
    """Rotate a vector by a unit quaternion, with the order of operations of geometry.rotate.

    Parameters
    ----------
    x, y, z, w : float
        Unit quaternion.
    vx, vy, vz : float
        Vector.

    Returns
    -------
    (float, float, float)
    """
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


@njit(cache=True, nogil=True, error_model="numpy")
def copy_contact(values: Values, to: int, at: int) -> None:
    """Copy position, normal and depth of a contact.

    Parameters
    ----------
    values : (W,) float64
        The block.
    to, at : int
        Words of the contact that is written, and of the one that is read.
    """
    for word in range(C_GEOMETRY, C_DEPTH + 1):
        values[to + word] = values[at + word]


@njit(cache=True, nogil=True, error_model="numpy")
def with_direction(values: Values, first: int, count: int) -> int:
    """Move the contacts with a valid normal to the front, see contacts.has_direction.

    Parameters
    ----------
    values : (W,) float64
        The block.
    first : int
        Word of the first contact.
    count : int
        Number of contacts.

    Returns
    -------
    int
        Number of contacts that remain, at the front.
    """
    kept = 0
    for index in range(count):
        at = first + index * CONTACT_WORDS + C_NORMAL
        x, y, z = values[at], values[at + 1], values[at + 2]
        if not 0.5 < x * x + y * y + z * z < 2.0:
            continue
        if kept != index:
            copy_contact(values, first + kept * CONTACT_WORDS, first + index * CONTACT_WORDS)
        kept += 1
    return kept


@njit(cache=True, nogil=True, error_model="numpy")
def merge(values: Values, first: int, count: int) -> None:
    """Average contacts into the first one, as contacts.merge does, with the same order of operations.

    Parameters
    ----------
    values : (W,) float64
        The block.
    first : int
        Word of the first contact.
    count : int
        Number of contacts.
    """
    px = py = pz = nx = ny = nz = depth = 0.0
    deepest = first
    for index in range(count):
        at = first + index * CONTACT_WORDS
        px += values[at + C_POSITION]
        py += values[at + C_POSITION + 1]
        pz += values[at + C_POSITION + 2]
        nx += values[at + C_NORMAL]
        ny += values[at + C_NORMAL + 1]
        nz += values[at + C_NORMAL + 2]
        if values[at + C_DEPTH] > depth:
            depth, deepest = values[at + C_DEPTH], at
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 0.5 * count:
        copy_contact(values, first, deepest)
        return
    position, normal = first + C_POSITION, first + C_NORMAL
    values[position], values[position + 1], values[position + 2] = px / count, py / count, pz / count
    values[normal], values[normal + 1], values[normal + 2] = nx / norm, ny / norm, nz / norm
    values[first + C_DEPTH] = depth


@njit(cache=True, nogil=True, error_model="numpy")
def merge_faces(values: Values, first: int, count: int, limit: int) -> int:
    """Average contacts with similar normals, as contacts.merge_faces does.

    Parameters
    ----------
    values : (W,) float64
        The block.
    first : int
        Word of the first contact.
    count : int
        Number of contacts.
    limit : int
        Greatest number of contacts that remain.

    Returns
    -------
    int
        Number of contacts that remain, at the front.
    """
    place, seeds, sizes = np.full(MAX_FOUND, -1), np.zeros(FACES, np.int64), np.zeros(FACES, np.int64)
    places = 0
    for index in range(count):
        at = first + index * CONTACT_WORDS + C_NORMAL
        for known in range(places):
            seed = first + seeds[known] * CONTACT_WORDS + C_NORMAL
            if (values[seed] * values[at] + values[seed + 1] * values[at + 1]
                    + values[seed + 2] * values[at + 2]) > _SAME_FACE:
                place[index] = known
                break
        if place[index] < 0 and places < limit:
            place[index], seeds[places] = places, index
            places += 1
        if place[index] >= 0:
            sizes[place[index]] += 1
    taken = np.zeros((count, C_DEPTH + 1 - C_GEOMETRY))
    for index in range(count):
        for word in range(taken.shape[1]):
            taken[index, word] = values[first + index * CONTACT_WORDS + C_GEOMETRY + word]
    row = 0
    for known in range(places):         # sort the contacts by group, without changing their order within one
        start = row
        for index in range(count):
            if place[index] == known:
                for word in range(taken.shape[1]):
                    values[first + row * CONTACT_WORDS + C_GEOMETRY + word] = taken[index, word]
                row += 1
        if sizes[known] > 1:
            merge(values, first + start * CONTACT_WORDS, sizes[known])
        seeds[known] = start
    for known in range(places):
        if seeds[known] != known:
            copy_contact(values, first + known * CONTACT_WORDS, first + seeds[known] * CONTACT_WORDS)
    return places


@njit(cache=True, nogil=True, error_model="numpy")
def deepest_faces(values: Values, first: int, count: int, limit: int) -> int:
    """Select contacts as contacts.deepest_faces does.

    Parameters
    ----------
    values : (W,) float64
        The block.
    first : int
        Word of the first contact.
    count : int
        Number of contacts.
    limit : int
        Greatest number of contacts that remain.

    Returns
    -------
    int
        Number of contacts that remain, at the front.
    """
    words = C_DEPTH + 1 - C_GEOMETRY
    gone, kept, places = np.zeros(MAX_FOUND, np.bool_), np.zeros((FACES, words)), 0
    while places < limit:
        best = -1
        for index in range(count):
            at = first + index * CONTACT_WORDS + C_DEPTH
            if not gone[index] and (best < 0 or values[at] > values[first + best * CONTACT_WORDS + C_DEPTH]):
                best = index
        if best < 0:
            break
        for word in range(words):
            kept[places, word] = values[first + best * CONTACT_WORDS + C_GEOMETRY + word]
        places += 1
        gone[best] = True
        seed = first + best * CONTACT_WORDS + C_NORMAL
        for index in range(count):
            at = first + index * CONTACT_WORDS + C_NORMAL
            if (values[seed] * values[at] + values[seed + 1] * values[at + 1]
                    + values[seed + 2] * values[at + 2]) > _SAME_PLANE:
                gone[index] = True
    for row in range(places):
        for word in range(words):
            values[first + row * CONTACT_WORDS + C_GEOMETRY + word] = kept[row, word]
    return places


@njit(cache=True, nogil=True, error_model="numpy")
def spread(values: Values, first: int, count: int, limit: int) -> None:
    """Move the contacts that contacts.spread selects to the front, in their order.

    Parameters
    ----------
    values : (W,) float64
        The block.
    first : int
        Word of the first contact.
    count : int
        Number of contacts.
    limit : int
        Greatest number of contacts that remain.
    """
    chosen = np.zeros(MAX_FOUND, np.bool_)
    nearest = np.full(MAX_FOUND, math.inf)
    last = 0
    for index in range(count):
        if values[first + index * CONTACT_WORDS + C_DEPTH] > values[first + last * CONTACT_WORDS + C_DEPTH]:
            last = index
    chosen[last] = True
    for _ in range(limit - 1):
        origin = first + last * CONTACT_WORDS + C_POSITION
        best, best_distance = -1, -1.0
        for index in range(count):
            at = first + index * CONTACT_WORDS + C_POSITION
            dx, dy = values[at] - values[origin], values[at + 1] - values[origin + 1]
            dz = values[at + 2] - values[origin + 2]
            distance = dx * dx + dy * dy + dz * dz
            if distance < nearest[index]:
                nearest[index] = distance
            if nearest[index] > best_distance and not chosen[index]:
                best, best_distance = index, nearest[index]
        chosen[best] = True
        last = best
    kept = 0
    for index in range(count):
        if chosen[index]:
            if kept != index:
                copy_contact(values, first + kept * CONTACT_WORDS, first + index * CONTACT_WORDS)
            kept += 1


@njit(cache=True, nogil=True, error_model="numpy")
def is_repeated(values: Values, at: int, other: int, sign: float) -> bool:
    """Return whether two contacts are one, as contacts.is_repeated does.

    Parameters
    ----------
    values : (W,) float64
        The block.
    at, other : int
        Words of the contacts.
    sign : float
        -1.0 if the normal of the other one points the other way.
    """
    one, two = at + C_NORMAL, other + C_NORMAL
    nx, ny, nz = values[one], values[one + 1], values[one + 2]
    mx, my, mz = sign * values[two], sign * values[two + 1], sign * values[two + 2]
    if not (abs(values[at + C_DEPTH] - values[other + C_DEPTH]) < SAME_DEPTH
            and nx * mx + ny * my + nz * mz > SAME_DIRECTION):
        return False
    x = values[at + C_POSITION] - values[other + C_POSITION]
    y = values[at + C_POSITION + 1] - values[other + C_POSITION + 1]
    z = values[at + C_POSITION + 2] - values[other + C_POSITION + 2]
    along = x * nx + y * ny + z * nz
    return bool(x * x + y * y + z * z - along * along < SAME_PLACE * SAME_PLACE)
