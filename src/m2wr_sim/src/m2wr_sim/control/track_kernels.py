# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates many scripts of poses at once: the formulas of :mod:`m2wr_sim.control.pose_track`, in their order.

Without numba the functions run as plain Python with the same results, but slowly.

Array layouts
-------------
``points`` (P, 16) float64
    Way points of all tracks: time since the begin of the track [s], position [m], tangent of the position, orientation
    x y z w, inner control point of squad, whether the orientation is a slerp up to the next way point.
``tracks`` (T, 5) float64
    First way point, number of way points, whether straight, begin in its script [s], whether the next track of the
    script begins where this one ends.
``spans`` (S, 2) float64
    Delay before each cycle, length of a cycle without it [s].
``scripts`` (S, 7) int64
    First track, number of tracks, whether it loops, begin, time of the next update, delay [ns], whether it has ended.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Tuple, TypeVar

import numpy as np

try:
    from numba import njit
except ImportError:
    njit = None

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]
    Turn = Tuple[float, float, float, float]

_Function = TypeVar("_Function", bound=Callable[..., Any])

POINT_COLUMNS, TRACK_COLUMNS, SPAN_COLUMNS, SCRIPT_COLUMNS, MOTION_COLUMNS = 16, 5, 2, 7, 13
P_TIME, P_POSITION, P_TANGENT, P_TURN, P_CONTROL, P_SIMPLE = 0, 1, 4, 7, 11, 15
T_FIRST, T_COUNT, T_STRAIGHT, T_BEGIN, T_CONTINUES = range(TRACK_COLUMNS)
S_FIRST, S_COUNT, S_LOOPS, S_BEGIN_NS, S_DUE_NS, S_DELAY_NS, S_ENDED = range(SCRIPT_COLUMNS)
STAYS, MOVES, INVALID = 0, 1, 2         # what an update does to a model
NEVER_NS = 1 << 62
_LEAST_SINE, _EQUAL, _LEAST_TURN = 1e-3, 1e-6, 1e-12        # as in pose_track


def _kernel(function: _Function) -> _Function:
    """Compile a function if numba is available; no operation is reordered or contracted."""
    if njit is None:
        return function
    return njit(cache=True, nogil=True, error_model="numpy")(function)


@_kernel
def _slerp(share: float, one: Turn, two: Turn, shortest: bool) -> Turn:
    if one[0] == two[0] and one[1] == two[1] and one[2] == two[2] and one[3] == two[3]:
        return one
    cosine = one[0] * two[0] + one[1] * two[1] + one[2] * two[2] + one[3] * two[3]
    sign = -1.0 if shortest and cosine < 0.0 else 1.0
    cosine *= sign
    if abs(cosine) < 1.0 - _LEAST_SINE:
        sine = math.sqrt(1.0 - cosine * cosine)
        angle = math.atan2(sine, cosine)
        first, second = math.sin((1.0 - share) * angle) / sine, sign * math.sin(share * angle) / sine
    else:
        first, second = 1.0 - share, sign * share
    x, y = first * one[0] + second * two[0], first * one[1] + second * two[1]
    z, w = first * one[2] + second * two[2], first * one[3] + second * two[3]
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if norm > 0.0:
        return x / norm, y / norm, z / norm, w / norm
    return 0.0, 0.0, 0.0, 1.0


@_kernel
def _four(points: Values, row: int, column: int) -> Turn:
    return points[row, column], points[row, column + 1], points[row, column + 2], points[row, column + 3]


@_kernel
def _store(pose: Values, points: Values, row: int) -> None:
    for axis in range(3):
        pose[axis] = points[row, P_POSITION + axis]
    for axis in range(4):
        pose[3 + axis] = points[row, P_TURN + axis]


@_kernel
def _pose_at(points: Values, track: Values, time: float, pose: Values) -> None:
    """Write the pose on a track at a time on it, as PoseTrack.at."""
    first, count = int(track[T_FIRST]), int(track[T_COUNT])
    last = first + count - 1
    if time <= 0.0 or count == 1:
        _store(pose, points, first)
        return
    if time >= points[last, P_TIME]:
        _store(pose, points, last)
        return
    k, above = first, last              # the last way point that is not later
    while above - k > 1:
        middle = (k + above) // 2
        if points[middle, P_TIME] <= time:
            k = middle
        else:
            above = middle
    t = (time - points[k, P_TIME]) / (points[k + 1, P_TIME] - points[k, P_TIME])
    if t < _EQUAL:
        _store(pose, points, k)
        return
    is_straight = track[T_STRAIGHT] != 0.0
    square, cube = t * t, t * t * t
    one, two = 2.0 * cube - 3.0 * square + 1.0, 3.0 * square - 2.0 * cube
    leave, arrive = cube - 2.0 * square + t, cube - square
    if is_straight:
        one, two, leave, arrive = 1.0 - t, t, 0.0, 0.0
    for axis in range(3):
        at, tangent = P_POSITION + axis, P_TANGENT + axis
        pose[axis] = (one * points[k, at] + two * points[k + 1, at] + leave * points[k, tangent]
                      + arrive * points[k + 1, tangent])
    turn = _slerp(t, _four(points, k, P_TURN), _four(points, k + 1, P_TURN), True)
    if not (points[k, P_SIMPLE] != 0.0 or is_straight):
        inner = _slerp(t, _four(points, k, P_CONTROL), _four(points, k + 1, P_CONTROL), False)
        turn = _slerp(2.0 * t * (1.0 - t), turn, inner, False)
    pose[3], pose[4], pose[5], pose[6] = turn


@_kernel
def _place(tracks: Values, script: NDArray[np.int64], span: Values, time: float) -> Tuple[int, float]:
    """Return the track at a time since the start, counted in its script, and the time on it."""
    if script[S_LOOPS] != 0 and time > 0.0:
        time %= span[0] + span[1]
    time = min(max(time - span[0], 0.0), span[1])
    first, k, above = script[S_FIRST], 0, script[S_COUNT]       # the last track that begins before that time
    while above - k > 1:
        middle = (k + above) // 2
        if tracks[first + middle, T_BEGIN] < time:
            k = middle
        else:
            above = middle
    return k, time - tracks[first + k, T_BEGIN]


@_kernel
def _rotation_rate(one: Values, two: Values, duration: float) -> Tuple[float, float, float]:
    if one[0] == two[0] and one[1] == two[1] and one[2] == two[2] and one[3] == two[3]:
        return 0.0, 0.0, 0.0
    ax, ay, az, aw = -one[0], -one[1], -one[2], one[3]
    bx, by, bz, bw = two[0], two[1], two[2], two[3]
    x, y = bw * ax + bx * aw + by * az - bz * ay, bw * ay - bx * az + by * aw + bz * ax
    z, w = bw * az + bx * ay - by * ax + bz * aw, bw * aw - bx * ax - by * ay - bz * az
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < _LEAST_TURN:
        return 0.0, 0.0, 0.0
    factor = 2.0 * math.atan2(math.copysign(sine, w), abs(w)) / (sine * duration)
    return factor * x, factor * y, factor * z


@_kernel
def _motion(points: Values, tracks: Values, script: NDArray[np.int64], span: Values, time: float, duration: float,
            following: Values, motion: Values) -> None:
    """Write the pose at a time, and the velocities that lead to that at ``time + duration``, as PoseScript.motion."""
    first, count = script[S_FIRST], script[S_COUNT]
    k, local = _place(tracks, script, span, time)
    next_k, next_local = _place(tracks, script, span, time + duration)
    _pose_at(points, tracks[first + k], local, motion[:7])
    continues = next_k == (k + 1) % count and tracks[first + k, T_CONTINUES] != 0.0
    if (next_k == k and next_local >= local) or continues:
        _pose_at(points, tracks[first + next_k], next_local, following)
    else:
        _pose_at(points, tracks[first + k], local + duration, following)
    for axis in range(3):
        motion[7 + axis] = (following[axis] - motion[axis]) / duration
    motion[10], motion[11], motion[12] = _rotation_rate(motion[3:7], following[3:], duration)


@_kernel
def _finish(motion: Values, ended: bool, fastest: float) -> bool:
    """Set the velocities to 0 at the end and in a jump; return whether all numbers are finite."""
    greatest = 0.0
    for column in range(MOTION_COLUMNS):
        if not math.isfinite(motion[column]):
            return False
        if column >= 7:
            greatest = max(greatest, abs(motion[column]))
    if ended or greatest > fastest:
        motion[7:] = 0.0
    return True


@_kernel
def advance(scripts: NDArray[np.int64], spans: Values, tracks: Values, points: Values, now_ns: int, step_ns: int,
            next_ns: int, fastest: float, motions: Values, effects: NDArray[np.int64]) -> Tuple[int, int]:
    """Compute the motions of all scripts that are due.

    Parameters
    ----------
    scripts : (S, SCRIPT_COLUMNS) int64
        Time of the next update and end are written.
    spans : (S, SPAN_COLUMNS) float64
    tracks : (T, TRACK_COLUMNS) float64
    points : (P, POINT_COLUMNS) float64
    now_ns : int
        Time at the end of the step [ns].
    step_ns : int
        Step size [ns].
    next_ns : int
        Time of the next update [ns].
    fastest : float
        What moves faster jumps: it gets no velocity [m/s, rad/s].
    motions : (S, MOTION_COLUMNS) float64
        Written where ``effects`` is not STAYS: position, orientation x y z w before the step, linear and angular
        velocity up to the next update.
    effects : (S,) int64
        Written: STAYS, MOVES, or INVALID where a number is not finite; that script has ended.

    Returns
    -------
    due_ns : int
        The least time of a next update [ns], NEVER_NS if all scripts have ended.
    invalid : int
        How many scripts are INVALID.
    """
    due_ns, invalid, following = NEVER_NS, 0, np.empty(7)
    for row in range(scripts.shape[0]):
        script, span = scripts[row], spans[row]
        effects[row] = STAYS
        if script[S_ENDED] == 0 and script[S_DUE_NS] <= now_ns:
            script[S_DUE_NS] = next_ns
            time = (now_ns - step_ns - script[S_BEGIN_NS]) * 1e-9       # where it is before this step
            if time < span[0] - step_ns * 1e-9:                         # its own place, until the script begins
                late_ns = now_ns - script[S_BEGIN_NS] - script[S_DELAY_NS]
                script[S_DUE_NS] = max(next_ns, now_ns - late_ns // step_ns * step_ns)
            else:
                _motion(points, tracks, script, span, time, (next_ns - now_ns) * 1e-9, following, motions[row])
                ended = script[S_LOOPS] == 0 and time >= span[0] + span[1]
                effects[row] = MOVES
                if not _finish(motions[row], ended, fastest):
                    effects[row], ended = INVALID, True
                    invalid += 1
                script[S_ENDED] = ended
        if script[S_ENDED] == 0:
            due_ns = min(due_ns, script[S_DUE_NS])
    return due_ns, invalid
