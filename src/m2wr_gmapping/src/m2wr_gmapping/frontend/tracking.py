# SPDX-License-Identifier: BSD-3-Clause
"""Pose between two processed scans, from odometry and matches in the best map."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Dict, Optional, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend import tracking_kernels as tk
from m2wr_gmapping.frontend.matcher import DOUBTFUL, LARGE_SLIP, NO_SLIP, SLIP, UNEXPLAINED
from m2wr_maps.se2 import between

if TYPE_CHECKING:
    from m2wr_gmapping.filter.tile_maps import TileMaps
    from m2wr_gmapping.frontend.matcher import FastMatcher, Rival
    from m2wr_gmapping.frontend.occlusion import Conflict
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray


class Tracker:
    """Tracks the pose relative to the last processed scan, and calibrates odometry and the laser's mount.

    The prior of every match is odometry since the last processed scan, not since the last match. Otherwise many matches
    in one map, each with a little freedom, would drift along unobserved directions.

    Parameters
    ----------
    matcher : FastMatcher
    noise : (2, 2) float64
        Of odometry, by the user's parameters; see ``Noise``.
    dense : bool
        Whether all scans are matched, so that a slip of the wheels can be confirmed.
    mount : (3,) float64
        Pose of the centred laser in the base frame [m, m, rad].
    view : float
        Angle between the first and the last beam [rad].

    Attributes
    ----------
    track : frontend.track.Track
        Motion since the last processed scan.
    noise : frontend.track.Noise
        Noise of odometry.
    calibration : frontend.track.Calibration
        Systematic errors of odometry and of the laser's mount.
    turned : float
        Angle of a turn on the spot that odometry has not measured, since the last processed scan; 0 for none [rad].
    is_doubtful : bool
        Whether since the last processed scan laser and odometry contradicted each other.
    is_unexplained : bool
        Whether older scans contradict the newest one, and no pose that was tried explains it.
    agrees : bool
        Whether odometry and older scans agree on the newest matched scan: half of its beams fit, and enough of them to
        exclude that the robot was turned.
    """

    def __init__(self, matcher: FastMatcher, noise: FloatArray, dense: bool, mount: FloatArray, view: float) -> None:
        self._matcher, self._dense, self._view = matcher, dense, view
        self._track, self._noise, self._calibration = tr.new_track(), tr.new_noise(noise), tr.new_calibration(mount)
        self._name_parts()
        self.turned = 0.0
        self.is_doubtful = self.is_unexplained = False
        self.agrees = True
        self._share = 1.0           # score per beam of the last match, against the map with the last processed scan
        self._rival: Optional[Rival] = None
        self._waits = False         # for the next scan

    def _name_parts(self) -> None:
        self.track: tr.Track = tr.track_of.py_func(self._track)
        self.noise: tr.Noise = tr.noise_of.py_func(self._noise)
        self.calibration: tr.Calibration = tr.calibration_of.py_func(self._calibration)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore stored attributes."""
        self.__dict__.update(stored)
        self._name_parts()

    def restart(self) -> None:
        """Restart at the newest scan, which was processed."""
        self._track[:] = 0.0
        self.turned = 0.0
        self.is_doubtful = self.is_unexplained = False
        self._share = 1.0

    def relax_prior(self) -> None:
        """Allow the next match to correct the pose by some cells."""
        self.track.slack[:] = tk.SLIP_LEFT

    def advance(self, step: FloatArray) -> Tuple[float, float, bool]:
        """Propagate the pose by a step of odometry; see ``tracking_kernels.advance``.

        Parameters
        ----------
        step : (3,) float64
            Step of odometry [m, m, rad].

        Returns
        -------
        distance, turn : float
            Length [m] and rotation [rad] of the step.
        moved : bool
            Whether odometry has moved since the last match.
        """
        return tk.advance(self._track, self._calibration, step)

    @property
    def rel(self) -> FloatArray:
        """Pose (3,) by the newest match and odometry since then, relative to the last processed scan."""
        return self.track.matched.copy()

    @property
    def has_slipped(self) -> bool:
        """Whether a slip of odometry was confirmed since the last processed scan."""
        return bool(self.track.slack.any())

    @property
    def undecided(self) -> bool:
        """Whether scan and odometry contradict each other, and the next scan decides."""
        return self._waits or bool(self.track.slip[2])

    def predict_particles(self, anchors: FloatArray, starts: FloatArray, predictions: FloatArray) -> FloatArray:
        """Predict all particles.

        Parameters
        ----------
        anchors : (N, 3) float64
            Poses at the last processed scan, in ``map``.
        starts : (N, 3) float64
            Written; see ``tracking_kernels.predict_all``.
        predictions : (N, 3) float64
            Written; see ``tracking_kernels.predict_all``.

        Returns
        -------
        (3, 3) float64
            ``known`` of ``tracking_kernels.predict_all``.
        """
        known = np.empty((3, 3))
        tk.predict_all(self._track, self._noise, anchors, starts, predictions, known)
        return known

    def match(self, maps: TileMaps, particle: int, anchor: FloatArray, reading: ScanReading,
              conflict: Callable[[FloatArray], Conflict], still: float) -> bool:
        """Match a scan in the map of one particle.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        particle : int
            Index of the particle.
        anchor : (3,) float64
            Pose of the particle at the last processed scan, in ``map``.
        reading : ScanReading
            The scan.
        conflict : callable
            As of ``FastMatcher.track``.
        still : float
            Time in which the wheels were at rest since the last scan that ``agrees`` [s].

        Returns
        -------
        bool
            False if the scan has no beams to match.
        """
        track = self.track
        if not reading.beams.shape[1]:
            track.since_match[:] = 0.0
            self.agrees = self._waits = False
            self._rival = None
            return False
        share = self._expected_share(track.since_match)
        rival = None if self._rival is None else self._rival.moved(track.since_match)
        data = np.empty(tr.REQUEST_SIZE)
        long, ask = tk.expect(self._track, self._noise, anchor, data), tr.request_of.py_func(data)
        row, slip, self._rival = self._matcher.track(maps, particle, reading, ask, long, share, conflict, still,
                                                     rival)
        found = float(row[mk.SCORE]) / reading.beams.shape[1]
        # one more scan decides about a rival with half of the evidence that it needs
        self._waits = not self._waits and self._rival is not None and found < tuning.MATCHING.good_share \
            and self._rival.surplus > -0.5 * tuning.SLIPS.cost
        if found >= tuning.SLIPS.lost * share:
            share = found       # one that fits nothing does not tell how well the next should fit
        self._share = share
        if slip == LARGE_SLIP:
            self.turned = float(between(ask.expected, row[:3])[2])
        self.is_doubtful |= slip in (DOUBTFUL, UNEXPLAINED)
        self.is_unexplained = slip == UNEXPLAINED
        self.agrees = bool(row[mk.SCORE] >= max(tuning.SLIPS.lost * reading.beams.shape[1],
                                                tuning.MATCHING.good_share * tuning.SEARCH.fewest)
                           and slip == NO_SLIP)
        tk.accept_match(self._track, self._noise, anchor, row, slip in (SLIP, LARGE_SLIP),
                        slip != LARGE_SLIP and (long or not self._dense))
        if slip == LARGE_SLIP and not track.slip[2]:        # confirmed
            self._rival = None
        return True

    def _expected_share(self, step: FloatArray) -> float:
        """Return the score per beam that is expected after a step (3,) by odometry: a turn brings new areas into view.

        It is 0 unless the robot turns on the spot: one that drives through a door suddenly sees other walls.
        """
        if math.hypot(step[0], step[1]) > tuning.MATCHING.basin[0]:
            return 0.0
        turn = abs(float(step[2]))
        return self._share * (1.0 - turn / max(self._view, turn)) if turn else self._share

    def learn(self, maps: TileMaps, particle: int, anchor: FloatArray, prediction: FloatArray, reading: ScanReading,
              row: FloatArray, step: FloatArray) -> None:
        """Update the calibration and the noise of odometry by the match of a processed scan.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        particle : int
            The particle in whose map the scan was matched.
        anchor : (3,) float64
            Pose of the particle at the last processed scan, in ``map``.
        prediction : (3,) float64
            Its pose by odometry.
        reading : ScanReading
            The scan.
        row : (13,) float64
            Result row of ``match_kernels``.
        step : (RECORD_SIZE,) float64
            Data of a StepRecord; written.
        """
        track, noise, calibration, prior = self._track, self._noise, self._calibration, np.empty(3)
        tk.record_step(track, noise, calibration, row, step)
        if reading.beams.shape[1] and tk.weak_prior(track, noise, calibration, prior):
            free = self._matcher.match_one(maps, particle, reading.beams, row[:3], prediction, prior)
            tk.learn(track, noise, calibration, prediction, free, prior, step)
        tk.learn_noise(track, noise, anchor, row)
