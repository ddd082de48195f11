# SPDX-License-Identifier: BSD-3-Clause
"""Systematic errors of odometry, learnt while the robot is localized.

A Kalman filter whose state has the pose and three errors: of the scale of distances, of the scale of turns, and a curve
where odometry says straight on.

A. Martinelli, N. Tomatis, A. Tapus, R. Siegwart, Simultaneous Localization and Odometry Calibration for Mobile Robot,
IROS 2003, has the method; J. Borenstein, L. Feng, Measurement and Correction of Systematic Odometry Errors in Mobile
Robots, IEEE Trans. Robotics and Automation 12(6), 1996, has the errors: of the wheels' diameters and of the axle.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional

import numpy as np

from m2wr_maps.se2 import between, compose, wrap

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

# Values without another source are our own choice, for the reason given.
#: Deviation of the errors before anything is learnt [-, -, rad/m]. Tyres and axles are known to some per cent;
#: 0.02 rad/m is a difference of the wheels' diameters of 1 % for an axle of 0.5 m.
UNKNOWN = np.array([0.03, 0.03, 0.02])
LIMIT = 3.0             # deviations beyond which an error is not believed: then the map or the pose is wrong
#: Noise that is not systematic: along the way and across it [m/m^(1/2)], of the heading from the way [rad/m^(1/2)] and
#: in proportion to the turn [-]. As `accuracy` gives its odometry: 1 cm and 0.6 degrees after 1 m, 2 % of a turn.
ALONG, ACROSS, HEADING, TURN = 0.01, 0.005, 0.01, 0.02
#: How the errors change, by load and floor [-, -, rad/m per m^(1/2)]: by a fifth of UNKNOWN in 100 m.
CHANGE = 0.02 * UNKNOWN
START = np.array([0.05, 0.05, 0.02])        # deviation of the pose where a track begins: a cell of 5 cm [m, m, rad]
LEARN_WAY, LEARN_TURN = 0.5, 0.5            # m, rad: motion between two looks; nearer scans share errors of the map
GATE = 16.3             # squared Mahalanobis distance: 99.9 % of the chi-squared distribution with 3 degrees of freedom
LONGEST = 1.0           # m, rad: a longer step between two scans is a jump, not a motion


class OdometryCalibration:
    """Corrects odometry by what localization has found.

    Attributes
    ----------
    errors : (3,) float64
        A true distance over the measured one minus 1, likewise of turns, and turn over distance on a straight line
        [-, -, rad/m].
    pose : (3,) float64
        Sum of the corrected steps, in a frame that only this class knows [m, m, rad].
    """

    def __init__(self) -> None:
        self.errors = np.zeros(3)
        self.pose = np.zeros(3)
        self._raw: Optional[FloatArray] = None
        self._mean: Optional[FloatArray] = None     # of the pose on the map
        self._covariance = np.diag(np.concatenate([START, UNKNOWN]) ** 2)       # of pose and errors
        self._way = self._turn = 0.0                # since the last look

    def step(self, measured: FloatArray) -> FloatArray:
        """Take a pose of odometry; return the sum of the corrected steps.

        Parameters
        ----------
        measured : (3,) float64
            In the odometry's frame [m, m, rad].

        Returns
        -------
        (3,) float64
            As ``pose``.
        """
        raw = np.zeros(3) if self._raw is None else between(self._raw, measured)
        self._raw = np.array(measured, float)
        if np.abs(raw).max() > LONGEST:
            self.lose()
            self.pose = compose(self.pose, raw)
            return self.pose
        scale, turn, curve = self.errors
        way = math.hypot(raw[0], raw[1])
        turned = (1.0 + turn) * raw[2] + curve * raw[0]
        half = 0.5 * (turned - raw[2])              # the chord turns by half of what the arc does
        cos, sin = (1.0 + scale) * math.cos(half), (1.0 + scale) * math.sin(half)
        corrected = np.array([cos * raw[0] - sin * raw[1], sin * raw[0] + cos * raw[1], turned])
        self.pose = compose(self.pose, corrected)
        self._way, self._turn = self._way + way, self._turn + abs(raw[2])
        self._spread(raw, corrected, way)
        return self.pose

    def _spread(self, raw: FloatArray, corrected: FloatArray, way: float) -> None:
        """Move the track's mean by a step, and its covariance."""
        if self._mean is None:
            return
        heading = self._mean[2]
        self._mean = compose(self._mean, corrected)
        cos, sin = math.cos(heading), math.sin(heading)
        east, north = cos * corrected[0] - sin * corrected[1], sin * corrected[0] + cos * corrected[1]
        by = np.eye(6)
        by[0, 2], by[1, 2] = -north, east
        by[0, 3], by[1, 3] = east, north
        by[2, 4], by[2, 5] = raw[2], raw[0]
        by[:2, 4:] = 0.5 * np.outer([-north, east], by[2, 4:])
        noise = np.zeros((6, 6))
        along, across = ALONG ** 2 * way, ACROSS ** 2 * way
        noise[0, 0], noise[1, 1] = along * cos * cos + across * sin * sin, along * sin * sin + across * cos * cos
        noise[0, 1] = noise[1, 0] = (along - across) * cos * sin
        noise[2, 2] = HEADING ** 2 * way + (TURN * raw[2]) ** 2
        noise[3:, 3:] = np.diag(CHANGE ** 2 * way)
        self._covariance = by @ self._covariance @ by.T + noise

    @property
    def is_due(self) -> bool:
        """Whether the robot has moved enough since the last look."""
        return self._mean is None or self._way >= LEARN_WAY or self._turn >= LEARN_TURN

    @property
    def track(self) -> Optional[FloatArray]:
        """Where the robot is by odometry and earlier looks (3,) [m, m, rad]; None: not known."""
        return self._mean

    @property
    def covariance(self) -> FloatArray:
        """Of the track (3, 3) [m, m, rad]."""
        return self._covariance[:3, :3]

    def lose(self) -> None:
        """Forget where the robot is, but not the errors of its odometry."""
        self._mean = None

    def forget(self) -> None:
        """Forget the errors, too."""
        self.lose()
        self.errors = np.zeros(3)
        self._covariance = np.diag(np.concatenate([START, UNKNOWN]) ** 2)

    def begin(self, pose: FloatArray) -> None:
        """Begin a track.

        Parameters
        ----------
        pose : (3,) float64
            On the map [m, m, rad].
        """
        errors = self._covariance[3:, 3:]
        self._covariance = np.zeros((6, 6))
        self._covariance[:3, :3], self._covariance[3:, 3:] = np.diag(START ** 2), errors
        self._mean, self._way, self._turn = np.array(pose, float), 0.0, 0.0

    def look(self, pose: FloatArray, covariance: FloatArray) -> bool:
        """Learn from a scan that was fitted to the map around the track, with the track's covariance.

        Parameters
        ----------
        pose : (3,) float64
            The fitted one [m, m, rad].
        covariance : (3, 3) float64
            Of the fitted one: track and scan together.

        Returns
        -------
        bool
            Whether it agrees with the track; if not, the track is lost and nothing is learnt.
        """
        assert self._mean is not None
        prior = self._covariance[:3, :3]
        away = pose - self._mean
        away[2] = wrap(away[2])
        gain = np.linalg.solve(prior, self._covariance[:3]).T          # (6, 3): of the state from the pose
        if float(away @ np.linalg.solve(prior, away)) > GATE:
            self.lose()
            return False
        change = gain @ away
        self._mean = compose(np.zeros(3), self._mean + change[:3])
        self._covariance = self._covariance - gain @ (prior - covariance) @ gain.T
        self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self.errors = np.clip(self.errors + change[3:], -LIMIT * UNKNOWN, LIMIT * UNKNOWN)
        self._way = self._turn = 0.0
        return True
