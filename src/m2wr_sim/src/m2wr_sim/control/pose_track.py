# SPDX-License-Identifier: BSD-3-Clause
"""Poses along way points in time, interpolated as Gazebo's PoseAnimation does, and scripts of them.

Positions: a cardinal spline (ignition::math::Spline), Catmull-Rom for a tension of 0. Its tangents are per way point,
not per second, so the speed may jump where the times between way points differ. Orientations: slerp, or squad
(Shoemake 1987) between way points that differ in roll, pitch and yaw (ignition::math::RotationSpline).
"""
from __future__ import annotations

import bisect
import math
from typing import TYPE_CHECKING, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.geometry import Pose, Quaternion, Vector, conjugate, multiply, rpy_from_quaternion

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAME = 1e-3                 # m, and of a quaternion: ignition::math takes vectors so near for equal
SLERP_BELOW = 0.16          # rad of roll, pitch or yaw: RotationSpline::Interpolate
_LEAST_SINE = 1e-3          # ignition::math::Quaternion


class Tables(NamedTuple):
    """A script as arrays, see :mod:`m2wr_sim.control.track_kernels`."""

    tracks: NDArray[np.float64]
    points: NDArray[np.float64]
    span: Tuple[float, float]


class Motion(NamedTuple):
    """A pose, and the velocities with which a model is at the next one in time; world frame, SI units."""

    pose: Pose
    linear: Vector
    angular: Vector


def slerp(share: float, one: Sequence[float], two: Sequence[float], shortest: bool = True) -> Quaternion:
    """Return an orientation between two others.

    Parameters
    ----------
    share : float
        0 for the first one, 1 for the second one.
    one, two : (4,) sequences of float
        Unit quaternions x y z w.
    shortest : bool, optional
        Whether to rotate by at most pi.
    """
    if one == two:                  # most obstacles that move do not turn
        x, y, z, w = one
        return x, y, z, w
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
    return (x / norm, y / norm, z / norm, w / norm) if norm > 0.0 else (0.0, 0.0, 0.0, 1.0)


def rotation_rate(one: Sequence[float], two: Sequence[float], duration: float) -> Vector:
    """Return the constant angular velocity [rad/s] from one orientation to another, on the shorter way.

    Parameters
    ----------
    one, two : (4,) sequences of float
        Unit quaternions x y z w.
    duration : float
        [s]
    """
    if one == two:
        return 0.0, 0.0, 0.0
    x, y, z, w = multiply(two, conjugate(one))
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-12:
        return 0.0, 0.0, 0.0
    factor = 2.0 * math.atan2(math.copysign(sine, w), abs(w)) / (sine * duration)
    return factor * x, factor * y, factor * z


def _log(quaternion: Sequence[float]) -> Quaternion:
    x, y, z, w = quaternion
    if abs(w) < 1.0:
        angle = math.acos(w)
        if abs(math.sin(angle)) >= _LEAST_SINE:
            scale = angle / math.sin(angle)
            return scale * x, scale * y, scale * z, 0.0
    return x, y, z, 0.0


def _exp(quaternion: Sequence[float]) -> Quaternion:
    x, y, z, _ = quaternion
    angle = math.sqrt(x * x + y * y + z * z)
    scale = math.sin(angle) / angle if abs(math.sin(angle)) >= _LEAST_SINE else 1.0
    return scale * x, scale * y, scale * z, math.cos(angle)


def _same(one: Sequence[float], two: Sequence[float]) -> bool:
    return all(abs(a - b) <= SAME for a, b in zip(one, two))


class PoseTrack:
    """Way points in time.

    Parameters
    ----------
    times : (N,) sequence of float
        Ascending [s]. The first one counts as 0, as in Gazebo.
    poses : (N,) sequence of pose
        At these times, in world; unit quaternions.
    tension : float or None, optional
        Of the spline: 0 Catmull-Rom, 1 a stop at each way point. None: straight lines at constant speed.

    Raises
    ------
    ValueError
        Without way points, or if times do not ascend or are not finite.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[Pose],
                 tension: Optional[float] = 0.0) -> None:
        self._times = [0.0] + [float(time) for time in times[1:]]
        if not times or len(times) != len(poses) or not all(
                0.0 <= a < b < math.inf for a, b in zip(self._times, self._times[1:])):
            raise ValueError("times {}; expected one for each of {} poses, ascending".format(list(times), len(poses)))
        self._points = [pose[0] for pose in poses]
        self._turns = [pose[1] for pose in poses]
        self._is_straight = tension is None
        self._tangents = self._position_tangents(1.0 - (tension or 0.0))
        self._controls = self._turn_controls()
        eulers = [rpy_from_quaternion(turn) for turn in self._turns]
        self._simple = [any(abs(a - b) < SLERP_BELOW for a, b in zip(*pair)) for pair in zip(eulers, eulers[1:])]

    @property
    def length(self) -> float:
        """Time of the last way point [s]."""
        return self._times[-1]

    @property
    def ends(self) -> Tuple[Pose, Pose]:
        """The first and the last pose."""
        return (self._points[0], self._turns[0]), (self._points[-1], self._turns[-1])

    def table(self) -> NDArray[np.float64]:
        """Return the rows of ``points`` of :mod:`m2wr_sim.control.track_kernels`, of the last way point, too."""
        return np.column_stack((self._times, self._points, self._tangents, self._turns, self._controls,
                                self._simple + [True])).astype(np.float64)

    @property
    def is_straight(self) -> bool:
        """Whether it has straight lines at constant speed."""
        return self._is_straight

    def _position_tangents(self, factor: float) -> List[Vector]:
        points, last = self._points, len(self._points) - 1
        is_closed = last > 0 and _same(points[0], points[-1])
        tangents: List[Vector] = []
        for k in range(last + 1):
            before, after = points[max(k - 1, 0)], points[min(k + 1, last)]
            if is_closed and k in (0, last):
                before, after = points[last - 1], points[1]
            x, y, z = (0.5 * factor * (b - a) for a, b in zip(before, after))
            tangents.append((x, y, z))
        return tangents

    def _turn_controls(self) -> List[Quaternion]:
        """Return the inner control point of squad at each way point."""
        turns, last = self._turns, len(self._turns) - 1
        is_closed = last > 0 and _same(turns[0], turns[-1])
        controls: List[Quaternion] = []
        for k, turn in enumerate(turns):
            before, after = turns[max(k - 1, 0)], turns[min(k + 1, last)]
            if is_closed and k in (0, last):
                before, after = turns[last - 1], turns[1]
            back = conjugate(turn)
            both = [-0.25 * (a + b) for a, b in zip(_log(multiply(back, after)), _log(multiply(back, before)))]
            controls.append(multiply(turn, _exp(both)))
        return controls

    def at(self, time: float) -> Pose:
        """Return the pose at a time [s]: before the first and after the last way point that of this one."""
        times = self._times
        if time <= 0.0 or len(times) == 1:
            return self._points[0], self._turns[0]
        if time >= times[-1]:
            return self._points[-1], self._turns[-1]
        k = bisect.bisect_right(times, time) - 1
        t = (time - times[k]) / (times[k + 1] - times[k])
        if t < 1e-6:                    # ignition::math::equal
            return self._points[k], self._turns[k]
        square, cube = t * t, t * t * t
        first, second = 2.0 * cube - 3.0 * square + 1.0, 3.0 * square - 2.0 * cube
        leave, arrive = cube - 2.0 * square + t, cube - square
        if self._is_straight:
            first, second, leave, arrive = 1.0 - t, t, 0.0, 0.0
        (ax, ay, az), (bx, by, bz) = self._points[k], self._points[k + 1]
        (ux, uy, uz), (vx, vy, vz) = self._tangents[k], self._tangents[k + 1]
        position = (first * ax + second * bx + leave * ux + arrive * vx,
                    first * ay + second * by + leave * uy + arrive * vy,
                    first * az + second * bz + leave * uz + arrive * vz)
        turn = slerp(t, self._turns[k], self._turns[k + 1])
        if not (self._simple[k] or self._is_straight):
            inner = slerp(t, self._controls[k], self._controls[k + 1], False)
            turn = slerp(2.0 * t * (1.0 - t), turn, inner, False)
        return position, turn


class PoseScript:
    """Tracks one after the other, once or again and again.

    Parameters
    ----------
    tracks : sequence of PoseTrack
    loop : bool
    delay : float
        Wait before each cycle [s].

    Raises
    ------
    ValueError
        Without tracks, or for a delay that is negative or not finite.
    """

    def __init__(self, tracks: Sequence[PoseTrack], loop: bool = True, delay: float = 0.0) -> None:
        if not tracks or not 0.0 <= delay < math.inf:
            raise ValueError("{} tracks, delay {} s; expected a track and a delay of at least 0".format(
                len(tracks), delay))
        self._tracks, self._delay = list(tracks), delay
        self._begins = [sum(track.length for track in tracks[:k]) for k in range(len(tracks))]
        self.length = self._begins[-1] + tracks[-1].length
        self.loop = loop and self.length > 0.0

    @property
    def delay(self) -> float:
        """Wait before each cycle [s]."""
        return self._delay

    @property
    def end(self) -> float:
        """Time after which nothing moves any more [s]; infinite for a loop."""
        return math.inf if self.loop else self._delay + self.length

    def tables(self) -> Tables:
        """Return the arrays from which compiled code computes what :meth:`motion` returns."""
        points = [track.table() for track in self._tracks]
        first = np.cumsum([0] + [len(part) for part in points])
        tracks = [(first[k], len(points[k]), track.is_straight, self._begins[k],
                   self._continues(k, (k + 1) % len(self._tracks))) for k, track in enumerate(self._tracks)]
        return Tables(np.array(tracks, np.float64), np.concatenate(points), (self._delay, self.length))

    def _place(self, time: float) -> Tuple[int, float]:
        """Return the track at a time, and the time on it."""
        if self.loop and time > 0.0:
            time %= self._delay + self.length
        time = min(max(time - self._delay, 0.0), self.length)
        k = bisect.bisect_left(self._begins, time) - 1 if time > 0.0 else 0
        return k, time - self._begins[k]

    def at(self, time: float) -> Pose:
        """Return the pose at a time since the start [s]."""
        k, local = self._place(time)
        return self._tracks[k].at(local)

    def motion(self, time: float, duration: float) -> Motion:
        """Return the pose at a time, and the velocities that lead to that at ``time + duration``.

        A jump between two tracks, or from the end to the begin, has no part in the velocities.

        Parameters
        ----------
        time : float
            Since the start [s].
        duration : float
            [s]
        """
        k, local = self._place(time)
        next_k, next_local = self._place(time + duration)
        pose = self._tracks[k].at(local)
        if next_k == k and next_local >= local or self._continues(k, next_k):
            following = self._tracks[next_k].at(next_local)
        else:
            following = self._tracks[k].at(local + duration)
        (x, y, z), (to_x, to_y, to_z) = pose[0], following[0]
        return Motion(pose, ((to_x - x) / duration, (to_y - y) / duration, (to_z - z) / duration),
                      rotation_rate(pose[1], following[1], duration))

    def _continues(self, one: int, two: int) -> bool:
        """Return whether a track begins where another ends."""
        end, begin = self._tracks[one].ends[1], self._tracks[two].ends[0]
        return two == (one + 1) % len(self._tracks) and _same(end[0], begin[0]) and _same(end[1], begin[1])
