# SPDX-License-Identifier: BSD-3-Clause
"""What a sensor saw: points from scans and clouds, and how long they count."""
from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Deque, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from m2wr_navigation.parameters import Parameter, flag, text

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

MOST_BEAMS = 1000000
MOST_POINTS = 5000000
MOST_KEPT = 1000            # observations of a source, with a persistence
SILENCE = 0.4               # s after which a regular sensor is late: with a cycle of 0.1 s the robot stops within 0.5 s
_PERIODS = 2.0              # of the sensor, likewise; a laser of 5 Hz stops the robot as early as a faster one
UNUSABLE = 0.5              # s after which messages that cannot be used are a fault: a transform may come later
FIRST = 3.0                 # s, likewise, while its period is not known
_MEAN_OF = 10               # messages whose period is averaged
_REGULAR = 3                # periods after which a sensor is known to send regularly
_INFINITY_MARGIN = 1e-4     # m: below range_max, of a beam without return with inf_is_valid (obstacle_layer.cpp)

#: Parameters of one observation source, below the layer's namespace.
SOURCE_PARAMETERS: Dict[str, Parameter] = {
    "topic": text("", "topic of the sensor; default: the name of the source"),
    "sensor_frame": text("", "frame of the sensor; default: that of the message"),
    "data_type": text("PointCloud", "LaserScan, PointCloud or PointCloud2"),
    "observation_persistence": Parameter(0.0, "s", 0.0, 1e6, "how long an observation counts; 0: until the next one"),
    "expected_update_rate": Parameter(0.0, "s", 0.0, 1e6, "longest time between two messages; 0: any"),
    "min_obstacle_height": Parameter(0.0, "m", -1e6, 1e6, "lower points are ignored"),
    "max_obstacle_height": Parameter(2.0, "m", -1e6, 1e6, "higher points are ignored"),
    "obstacle_range": Parameter(2.5, "m", 0.0, 1e6, "farther points are no obstacles"),
    "raytrace_range": Parameter(3.0, "m", 0.0, 1e6, "cells are cleared up to this distance"),
    "inf_is_valid": flag(False, "whether beams of infinite range are points just below range_max"),
    "clear_no_return": flag(True, "whether LaserScan beams without return clear cells up to raytrace_range"),
    "clearing": flag(False, "whether the sensor clears cells"),
    "marking": flag(True, "whether the sensor marks obstacles"),
}


class ObservationError(ValueError):
    """A message of a sensor cannot be used; the message says why."""


@dataclass(frozen=True)
class Observation:
    """Points of one message, in the frame of the costmap.

    Attributes
    ----------
    stamp : float
        [s]
    sensor : (3,) float64
        Position of the sensor [m].
    points : (N, 3) float64
        Where something was seen [m].
    free_ends : (M, 3) float64
        Ends of rays on which nothing was seen [m].
    """

    stamp: float
    sensor: FloatArray
    points: FloatArray
    free_ends: FloatArray


class Source:
    """Buffers the observations of one sensor.

    Parameters
    ----------
    name : str
    values : mapping of str to object
        Value of every one of :data:`SOURCE_PARAMETERS`.
    """

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        self.name = name
        self.values: Dict[str, Any] = dict(values)
        self.arrived = -math.inf
        self._period, self._count = 0.0, 0      # mean time between two messages [s]
        self._refused_since, self._refusal = math.inf, ""
        self._is_used = False                   # whether any message could be used
        self._kept: Deque[Observation] = deque(maxlen=MOST_KEPT)

    @property
    def topic(self) -> str:
        """Topic of the sensor."""
        return str(self.values["topic"]) or self.name

    def add(self, observation: Observation, now: float) -> None:
        """Take an observation.

        Parameters
        ----------
        observation : Observation
        now : float
            [s]
        """
        self.keep(observation)
        self.heard(now)

    def keep(self, observation: Observation) -> None:
        """Take an observation of a message that :meth:`heard` already knows.

        Parameters
        ----------
        observation : Observation
        """
        self._refused_since, self._is_used = math.inf, True
        if self.values["observation_persistence"] <= 0.0:
            self._kept.clear()
        self._kept.append(observation)

    def refuse(self, now: float, reason: str) -> None:
        """Take note that a message cannot be used, or not yet.

        Parameters
        ----------
        now : float
            [s]
        reason : str
        """
        self._refused_since, self._refusal = min(self._refused_since, now), reason

    def heard(self, now: float) -> None:
        """Take note that a message has arrived.

        Parameters
        ----------
        now : float
            [s]
        """
        since = now - self.arrived
        if 0.0 < since < math.inf:
            self._count += 1
            self._period += (since - self._period) / min(self._count, _MEAN_OF)
        self.arrived = now

    def current(self, now: float) -> List[Observation]:
        """Return the observations that count now; older ones are dropped."""
        persistence = self.values["observation_persistence"]
        newest = self._kept[-1].stamp if self._kept else 0.0
        while persistence > 0.0 and self._kept and self._kept[0].stamp < max(now, newest) - persistence:
            self._kept.popleft()
        return list(self._kept)

    def clear(self) -> None:
        """Forget all observations."""
        self._kept.clear()

    @property
    def limit(self) -> float:
        """Longest time between two messages [s].

        ``expected_update_rate``, or for a sensor that has sent regularly two of its periods, at least 0.4 s. With
        fewer messages it is 3 s at least; a single cloud may be all that there is, a single scan is not. A source of
        events has no limit.
        """
        expected: float = self.values["expected_update_rate"]
        if expected > 0.0:
            return expected
        if self._tells_events:
            return math.inf
        if self._count == 0 and (self.values["data_type"] != "LaserScan" or self.arrived == -math.inf):
            return math.inf
        return max(SILENCE if self._count >= _REGULAR else FIRST, _PERIODS * self._period)

    @property
    def _tells_events(self) -> bool:
        """Whether the source says only what is there, such as a bumper: with nothing to say it is silent."""
        return self.values["data_type"] != "LaserScan" and not self.values["clearing"]

    def silence(self, now: float) -> float:
        """Return for how long the sensor has been silent [s]; 0 if it is not late."""
        since = now - self.arrived
        return since if since > self.limit else 0.0

    def fault(self, now: float) -> str:
        """Return why the sensor cannot be relied upon: it is silent, has never sent, or sends what cannot be used.

        Parameters
        ----------
        now : float
            [s]
        """
        since, silence = now - self._refused_since, self.silence(now)
        if since > UNUSABLE:
            return "no message on topic {} of source {} could be used for {:.1f} s: {}".format(
                self.topic, self.name, since, self._refusal)
        if not self._is_used and not (self._tells_events and not self._refusal and math.isinf(self.limit)):
            return "topic {} of source {} has sent nothing{}; without such a sensor, take {} out of " \
                "observation_sources".format(self.topic, self.name, " that could be used" if self._refusal else " yet",
                                             self.name)
        return "" if silence <= 0.0 else "topic {} of source {} has been silent for {:.1f} s; expected a message " \
            "every {:.2g} s".format(self.topic, self.name, min(silence, 1e6), self.limit)


def scan_points(ranges: Sequence[float], angle_min: float, increment: float, limits: Tuple[float, float],
                values: Mapping[str, Any]) -> Tuple[FloatArray, FloatArray]:
    """Return the end points of a scan in the sensor's frame.

    Parameters
    ----------
    ranges : (B,) sequence of float
        [m]
    angle_min, increment : float
        [rad]
    limits : (float, float)
        range_min and range_max of the message [m].
    values : mapping of str to object
        Of the source.

    Returns
    -------
    points : (N, 3) float64
        Of beams with range_min <= range < range_max.
    free_ends : (M, 3) float64
        Of beams without return, at ``raytrace_range`` or range_max, whichever is less.

    Raises
    ------
    ObservationError
        If the scan's geometry is not finite, or it has too many beams.
    """
    count, (nearest, farthest) = len(ranges), limits
    if count > MOST_BEAMS:
        raise ObservationError("it has {} beams; expected at most {}".format(count, MOST_BEAMS))
    if not (math.isfinite(angle_min) and math.isfinite(increment) and farthest > 0.0 and nearest == nearest):
        raise ObservationError("angle_min {}, angle_increment {}, range_min {}, range_max {}; expected finite angles "
                               "and a positive range".format(angle_min, increment, nearest, farthest))
    distances = np.array(ranges, float)
    angles = angle_min + increment * np.arange(count)
    no_return = (distances == math.inf) | (distances >= farthest)
    if values["inf_is_valid"]:
        distances = np.where(distances == math.inf, farthest - _INFINITY_MARGIN, distances)
        no_return &= distances >= farthest
    seen = (distances >= nearest) & (distances < farthest)
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], -1)
    points = directions[seen] * distances[seen, None]
    reach = min(values["raytrace_range"], farthest)
    free = directions[no_return] * reach if values["clear_no_return"] else np.zeros((0, 3))
    return points, free


def cloud_points(data: bytes, shape: Tuple[int, int], steps: Tuple[int, int], offsets: Tuple[int, int, int],
                 big_endian: bool) -> FloatArray:
    """Return the finite points (N, 3) of a PointCloud2 whose x, y, z are 32-bit floats [m].

    Parameters
    ----------
    data : bytes
    shape : (height, width)
    steps : (row_step, point_step)
        [bytes]
    offsets : (int, int, int)
        Of x, y, z in a point [bytes].
    big_endian : bool

    Raises
    ------
    ObservationError
        If sizes and data do not fit.
    """
    (height, width), (row_step, point_step) = shape, steps
    if height * width == 0:
        return np.zeros((0, 3))
    if height * width > MOST_POINTS:
        raise ObservationError("it has {} x {} points; expected at most {}".format(height, width, MOST_POINTS))
    if point_step < max(offsets) + 4 or min(offsets) < 0 or row_step < width * point_step \
            or len(data) < (height - 1) * row_step + width * point_step:
        raise ObservationError("{} x {} points of {} bytes, rows of {}, x y z at {} and {} bytes of data do not fit"
                               .format(height, width, point_step, row_step, offsets, len(data)))
    kind = np.dtype({"names": ["x", "y", "z"], "formats": [">f4" if big_endian else "<f4"] * 3,
                     "offsets": list(offsets), "itemsize": point_step})
    rows: Any = np.ndarray((height, width), kind, data, 0, (row_step, point_step))
    points = np.stack([rows[name].astype(np.float64).ravel() for name in "xyz"], -1)
    return points[np.isfinite(points).all(-1)]


def transformed(points: FloatArray, translation: Sequence[float], quaternion: Sequence[float]) -> FloatArray:
    """Return points (N, 3) in another frame.

    Parameters
    ----------
    points : (N, 3) float64
        [m]
    translation : (3,) float
        Of the points' frame in the other [m].
    quaternion : (4,) float
        Its rotation: x, y, z, w, normalised.
    """
    x, y, z, w = quaternion
    rotation = np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)]])
    return points @ rotation.T + np.asarray(translation, float)


def listed_points(points: Sequence[Tuple[float, float, float]]) -> FloatArray:
    """Return the finite points (N, 3) of a PointCloud [m].

    Parameters
    ----------
    points : sequence of (float, float, float)

    Raises
    ------
    ObservationError
        If there are too many.
    """
    if len(points) > MOST_POINTS:
        raise ObservationError("it has {} points; expected at most {}".format(len(points), MOST_POINTS))
    found = np.asarray(points, float).reshape(-1, 3)
    return found[np.isfinite(found).all(-1)]
