# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles that move, from successive scans: where they are, and their velocities.

The points of a scan are put in groups. A group that is no wall is followed by a Kalman filter with constant velocity
(Bar-Shalom, Li, Kirubarajan 2001, section 6.2). It moves if the filter says so and if it covers places that an earlier
scan saw free. What stands and comes in sight only now was never seen free, so a pillar behind a corner does not move.
What turns round stands for a moment, so what has moved counts as standing only after a while.
"""
from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Deque, List

import numpy as np

from m2wr_navigation.methods import moving_kernels

if TYPE_CHECKING:
    from m2wr_navigation.methods.scan_points import ScanPoints
    from m2wr_node.array_types import BoolArray, FloatArray

NOISE = 0.03                # m, standard deviation of the middle of a group: 0.01 of a reading, and odometry
SURE = 3.0 * NOISE          # m: a greater difference of places is no noise
GAP = 0.15                  # m between points of two groups: beams of 0.25 degrees on a wall at 10 degrees, 6 m away
LARGEST = 0.8               # m, radius: people, robots and carts are smaller, walls are wider
LOOK_BACK = 1.0             # s, age of the scan whose free space is compared: what moves at 0.1 m/s has left SURE
ACCELERATION = 0.07         # m^2/s^3, spectral density of the acceleration: 0.26 m/s after a second, half a stroll
SPEED_NOISE = 0.5           # m/s, standard deviation of the velocity of a new track: a stroll
MOST = 64                   # tracks; bounds the time of a cycle


@dataclass
class Track:
    """A group that is followed.

    Attributes
    ----------
    state : (4,) float64
        x, y [m], their velocities [m/s].
    radius : float
        [m]
    stamp, seen : float
        Time of the state, and of the last scan in which it was seen [s].
    variance : list of float
        Of a coordinate [m^2], with its velocity [m^2/s], of the velocity [m^2/s^2].
    moved : float
        Time when it was last seen to move [s].
    """

    state: FloatArray
    radius: float
    stamp: float
    seen: float
    variance: List[float] = field(default_factory=lambda: [NOISE ** 2, 0.0, SPEED_NOISE ** 2])
    moved: float = -math.inf

    def predict(self, stamp: float) -> None:
        """Go to a later time [s]."""
        dt, (a, b, c) = stamp - self.stamp, self.variance
        self.state[:2] += dt * self.state[2:]
        noise = ACCELERATION * dt
        self.variance = [a + 2.0 * dt * b + dt * dt * c + noise * dt * dt / 3.0, b + dt * c + 0.5 * noise * dt,
                         c + noise]
        self.stamp = stamp

    @property
    def gate(self) -> float:
        """How far the middle of its group can be from where it is expected [m]."""
        return self.radius + 3.0 * math.sqrt(self.variance[0] + NOISE ** 2)

    def correct(self, disc: FloatArray, points: FloatArray) -> bool:
        """Take a group, or its part of the group of several bodies.

        Parameters
        ----------
        disc : (8,) float64
            Row of :func:`moving_kernels.discs_around`.
        points : (N, 2) float64
            Of the group [m].

        Returns
        -------
        bool
            Whether a part of the group belongs to it.
        """
        if disc[2] > self.radius + SURE:        # no body grows so fast
            points = points[np.hypot(points[:, 0] - self.state[0], points[:, 1] - self.state[1]) < self.gate]
        elif disc[5] or disc[2] > self.radius:
            self.radius = float(disc[2])
        if not len(points):
            return False
        self._filter(*moving_kernels.circle_through(points, self.state[0], self.state[1], self.radius))
        self.seen = self.stamp
        return True

    def judge(self, share: float, slowest: float, memory: float) -> None:
        """Note whether it moves.

        Parameters
        ----------
        share : float
            Of its points, those on places that were free.
        slowest : float
            What is slower stands [m/s].
        memory : float
            For so long it is known that it moved [s].
        """
        is_fresh = 2.0 * self.radius * share > min(SURE, self.radius)
        if math.hypot(self.state[2], self.state[3]) > slowest and (is_fresh or self.stamp - self.moved < memory):
            self.moved = self.stamp

    def _filter(self, x: float, y: float) -> None:
        """Take a measured place [m]."""
        a, b, c = self.variance
        gain, rate = a / (a + NOISE ** 2), b / (a + NOISE ** 2)
        error = np.array([x, y]) - self.state[:2]
        self.state[:2] += gain * error
        self.state[2:] += rate * error
        self.variance = [(1.0 - gain) * a, (1.0 - gain) * b, c - rate * b]


class MovingObstacles:
    """Follows what moves.

    Parameters
    ----------
    horizon : float
        For so long a velocity is trusted: ahead, and of what is out of sight or stands for a moment [s].
    slowest : float
        What is slower stands [m/s].
    """

    def __init__(self, horizon: float, slowest: float) -> None:
        self._horizon, self._slowest = horizon, slowest
        self._tracks: List[Track] = []
        self._scans: Deque[ScanPoints] = deque(maxlen=200)

    def update(self, scan: ScanPoints) -> BoolArray:
        """Take a scan; return which of its points belong to obstacles that move.

        Parameters
        ----------
        scan : ScanPoints
            Later than those before; after a jump of time everything is forgotten.
        """
        if self._scans and not 0.0 <= scan.stamp - self._scans[-1].stamp <= self._horizon:
            self._tracks.clear()
            self._scans.clear()
        while len(self._scans) > 1 and scan.stamp - self._scans[1].stamp >= LOOK_BACK:
            self._scans.popleft()
        points, beams = scan.ends[scan.hits], scan.beams[scan.hits]
        fresh = np.zeros(len(points), np.bool_)
        if self._scans and scan.stamp - self._scans[0].stamp >= 0.5 * LOOK_BACK:
            old = self._scans[0]
            moving_kernels.mark_fresh(points, old.laser, old.ranges, old.angle_min, old.increment, SURE, fresh)
        self._scans.append(scan)
        groups = np.zeros(len(points), np.int64)
        discs = np.zeros((moving_kernels.groups_of(points, beams, GAP, groups), 8))
        moving_kernels.discs_around(points, beams, groups, fresh, scan.laser, scan.ranges, discs)
        self._follow(scan, discs[discs[:, 2] < LARGEST], points)
        found = np.zeros(len(scan.ends), np.bool_)
        for x, y, _, _, radius in self.moving.tolist():
            found |= np.hypot(scan.ends[:, 0] - x, scan.ends[:, 1] - y) < radius + SURE
        return found & scan.hits

    def _follow(self, scan: ScanPoints, discs: FloatArray, points: FloatArray) -> None:
        """Give each group to the track that expects it, begin new ones, and drop what is gone."""
        for track in self._tracks:
            track.predict(scan.stamp)
        free, alone = np.ones(len(discs), np.bool_), np.ones(len(discs), np.bool_)
        for track in sorted(self._tracks, key=lambda one: (-one.moved, -one.seen)):
            away = np.hypot(discs[:, 0] - track.state[0], discs[:, 1] - track.state[1])
            away -= np.maximum(discs[:, 2] - track.radius, 0.0)         # of a group of several bodies
            away[~alone] = math.inf
            best = int(np.argmin(away)) if len(away) else -1
            if best >= 0 and away[best] < track.gate:
                disc = discs[best]
                shared = disc[2] > track.radius + SURE
                if track.correct(disc, points[int(disc[6]):int(disc[7])]):
                    track.judge(float(disc[4]), self._slowest, self._horizon)
                    free[best], alone[best] = False, shared
        self._tracks = [track for track in self._tracks if self._stays(track, scan)]
        for disc in discs[free][:MOST - len(self._tracks)]:
            self._tracks.append(Track(np.array([disc[0], disc[1], 0.0, 0.0]), float(disc[2]), scan.stamp, scan.stamp))

    def _stays(self, track: Track, scan: ScanPoints) -> bool:
        """Return whether a track is kept: it is seen, or no beam passes through it and its velocity is trusted."""
        if track.seen == scan.stamp:
            return True
        beam = moving_kernels.beam_at(track.state[0], track.state[1], scan.laser, scan.angle_min, scan.increment,
                                      len(scan.ranges))
        away = math.hypot(track.state[0] - scan.laser[0], track.state[1] - scan.laser[1])
        seen_through = beam >= 0 and scan.ranges[beam] > away + track.radius
        return scan.stamp - track.seen < self._horizon and not seen_through

    @property
    def moving(self) -> FloatArray:
        """What moves (M, 5): x, y [m], velocity [m/s], radius [m], at the time of the last scan.

        The radius has the standard deviation of the place added, which grows while it is out of sight.
        """
        return np.array([[*track.state, track.radius + math.sqrt(track.variance[0])] for track in self._tracks
                         if track.stamp - track.moved < self._horizon]).reshape(-1, 5)
