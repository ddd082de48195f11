# SPDX-License-Identifier: BSD-3-Clause
"""Shortest paths of a vehicle that drives ahead and backwards with a least turning radius (Reeds and Shepp 1990).

Such a path has at most five parts, each an arc of the least radius or a straight line. Up to three symmetries all of
them are of eight forms: drive time backwards, mirror left and right, and read the path from its end.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

MOST_PARTS = 5
_FORMS = 8
_QUARTER = 0.5 * math.pi
_ROUNDING = 1e-10           # of an angle or a length in radii
#: Steering of the parts of each form: 1 to the left, -1 to the right, 0 straight.
_STEERING = np.array([[1, 0, 1, 0, 0], [1, 0, -1, 0, 0], [1, -1, 1, 0, 0], [1, -1, 1, -1, 0], [1, -1, 1, -1, 0],
                      [1, -1, 0, 1, 0], [1, -1, 0, -1, 0], [1, -1, 0, 1, -1]], np.float64)
_PARTS = np.array([3, 3, 3, 4, 4, 4, 4, 5])
#: Forms that read from the end are others.
_TURNED_ROUND = np.array([False, False, True, False, False, True, True, False])


@kernel
def _wrapped(angle: float) -> float:
    """Return an angle from -pi to pi."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@kernel
def _outer_turns(inner: float, other: float, x: float, y: float, heading: float) -> Tuple[float, float]:
    """Return the first and the last turn of a path of four arcs whose inner ones are known (the paper's tau, omega)."""
    between = _wrapped(inner - other)
    a, b = math.sin(inner) - math.sin(between), math.cos(inner) - math.cos(between) - 1.0
    first = math.atan2(y * a - x * b, x * a + y * b)
    if 2.0 * (math.cos(between) - math.cos(other) - math.cos(inner)) + 3.0 < 0.0:
        first += math.pi
    first = _wrapped(first)
    return first, _wrapped(first - inner + other - heading)


@kernel
def _solve(form: int, x: float, y: float, heading: float, turns: FloatArray) -> bool:
    """Write the signed lengths of a form's parts, in radii, that lead from the origin to a pose; False: none do."""
    same = form == 0 or form == 2 or form == 5          # the last arc bends as the first one
    side = 1.0 if same else -1.0
    across, up = x - side * math.sin(heading), y - 1.0 + side * math.cos(heading)
    far, towards = math.hypot(across, up), math.atan2(up, across)
    if form == 0:
        t, u, v = towards, far, _wrapped(heading - towards)
        turns[0], turns[1], turns[2] = t, u, v
        return t >= -_ROUNDING and v >= -_ROUNDING
    if form == 1:
        if far < 2.0:
            return False
        u = math.sqrt(far * far - 4.0)
        t = _wrapped(towards + math.atan2(2.0, u))
        v = _wrapped(t - heading)
        turns[0], turns[1], turns[2] = t, u, v
        return t >= -_ROUNDING and v >= -_ROUNDING
    if form == 2:
        if far > 4.0:
            return False
        u = -2.0 * math.asin(0.25 * far)
        t = _wrapped(towards + 0.5 * u + math.pi)
        turns[0], turns[1], turns[2] = t, u, _wrapped(heading - t + u)
        return t >= -_ROUNDING
    if form == 3:
        cosine = 0.25 * (2.0 + far)
        if cosine > 1.0:
            return False
        u = math.acos(cosine)
        t, v = _outer_turns(u, -u, across, up, heading)
        turns[0], turns[1], turns[2], turns[3] = t, u, -u, v
        return t >= -_ROUNDING and v <= _ROUNDING
    if form == 4:
        cosine = (20.0 - far * far) / 16.0
        if not 0.0 <= cosine <= 1.0:
            return False
        u = -math.acos(cosine)
        t, v = _outer_turns(u, u, across, up, heading)
        turns[0], turns[1], turns[2], turns[3] = t, u, u, v
        return t >= -_ROUNDING and v >= -_ROUNDING
    if far < 2.0:
        return False
    if form == 5:
        root = math.sqrt(far * far - 4.0)
        t = _wrapped(towards + math.atan2(root, -2.0))
        u, v = 2.0 - root, _wrapped(heading - _QUARTER - t)
        turns[0], turns[1], turns[2], turns[3] = t, -_QUARTER, u, v
        return t >= -_ROUNDING and u <= _ROUNDING and v <= _ROUNDING
    if form == 6:
        t = math.atan2(across, -up)
        u, v = 2.0 - far, _wrapped(t + _QUARTER - heading)
        turns[0], turns[1], turns[2], turns[3] = t, -_QUARTER, u, v
        return t >= -_ROUNDING and u <= _ROUNDING and v <= _ROUNDING
    u = 4.0 - math.sqrt(far * far - 4.0)
    t = _wrapped(math.atan2((4.0 - u) * across - 2.0 * up, -2.0 * across + (u - 4.0) * up))
    v = _wrapped(t - heading)
    turns[0], turns[1], turns[2], turns[3], turns[4] = t, -_QUARTER, u, -_QUARTER, v
    return u <= _ROUNDING and t >= -_ROUNDING and v >= -_ROUNDING


@kernel
def reeds_shepp(start: Tuple[float, float, float], goal: Tuple[float, float, float], radius: float, backwards: float,
                change: float, before: float, parts: FloatArray) -> float:
    """Find the path with the least cost in free space.

    Parameters
    ----------
    start, goal : (float, float, float)
        x, y, heading [rad].
    radius : float
        Least turning radius.
    backwards : float
        Cost of driving backwards over that of driving ahead.
    change : float
        Added cost of each change between ahead and backwards.
    before : float
        1 or -1: how the vehicle drives before the start; 0: the first part is no change.
    parts : (5, 2) float64
        Written: signed length and curvature of each part; length 0: not used.

    Returns
    -------
    float
        Its cost; its length, if ``backwards`` is 1 and ``change`` 0.
    """
    across, up = (goal[0] - start[0]) / radius, (goal[1] - start[1]) / radius
    c, s = math.cos(start[2]), math.sin(start[2])
    ahead, left, heading = c * across + s * up, -s * across + c * up, _wrapped(goal[2] - start[2])
    best, turns = np.inf, np.empty(MOST_PARTS)
    parts[:] = 0.0
    for symmetry in range(8):
        flip = -1.0 if symmetry & 1 else 1.0            # of the sense of driving
        mirror = -1.0 if symmetry & 2 else 1.0          # left and right
        reverse = symmetry & 4 != 0
        x, y, yaw = flip * ahead, mirror * left, flip * mirror * heading
        if reverse:
            x, y = x * math.cos(yaw) + y * math.sin(yaw), x * math.sin(yaw) - y * math.cos(yaw)
        for form in range(_FORMS):
            if (reverse and not _TURNED_ROUND[form]) or not _solve(form, x, y, yaw, turns):
                continue
            count, cost, sense = _PARTS[form], 0.0, before
            for k in range(count):
                length = flip * radius * turns[count - 1 - k if reverse else k]
                if abs(length) > _ROUNDING * radius:
                    cost += length if length > 0.0 else -length * backwards
                    now = 1.0 if length > 0.0 else -1.0
                    if sense != 0.0 and now != sense:
                        cost += change
                    sense = now
            if cost < best - _ROUNDING:
                best = cost
                for k in range(MOST_PARTS):
                    at = count - 1 - k if reverse else k
                    parts[k, 0] = flip * radius * turns[at] if k < count else 0.0
                    parts[k, 1] = mirror * _STEERING[form, at] / radius if k < count else 0.0
    return best
