# SPDX-License-Identifier: BSD-3-Clause
"""Pose between two processed scans, from odometry and matches in the best map."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import odometry_kernels as ok
from m2wr_gmapping.frontend import track_layout as tl
from m2wr_gmapping.frontend import tracking_kernels as tk

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray, Vector
    from m2wr_gmapping.filter.motion_model import MotionNoise
    from m2wr_gmapping.filter.tile_maps import TileMaps
    from m2wr_gmapping.frontend.matcher import FastMatcher
    from m2wr_gmapping.frontend.scan import ScanReading


def new_track(noise: MotionNoise, ahead: Vector = (1.0, 0.0)) -> FloatArray:
    """Return the ``track`` of ``track_layout`` before the first scan.

    Parameters
    ----------
    noise : MotionNoise
        Noise of odometry by the user's parameters.
    ahead : (2,) float
        Forward direction of the base in the laser's frame.
    """
    track = np.zeros((tl.TRACK_ROWS, 3))
    track[tl.DOUBT, 0] = tl.NO_DOUBT
    track[tl.SCALE:tl.SCALE + 2, :2] = 1.0
    track[tl.COVARIANCE:tl.COVARIANCE + 3] = np.diag(np.full(3, tl.BIAS_VARIANCE))
    track[tl.CENTRE, 1] = tl.CENTRE_VARIANCE
    track[tl.AHEAD, :2] = ahead
    track[tl.NOISE, :2] = noise.trans_trans, noise.trans_rot
    track[tl.NOISE_TURN, :2] = noise.rot_trans, noise.rot_rot
    return track


class Tracker:
    """Tracks the pose relative to the last processed scan.

    The prior of every match is odometry since the last processed scan, not since the last match. Otherwise many matches
    in one map, each with a little freedom, would drift along unobserved directions.

    Parameters
    ----------
    matcher : FastMatcher
    noise : MotionNoise
    dense : bool
        Whether all scans are matched, so that a slip of the wheels can be confirmed.
    recalibration : Recalibration
        Stores the steps of the path.
    ahead : (2,) float
        Forward direction of the base in the laser's frame.
    """

    def __init__(self, matcher: FastMatcher, noise: MotionNoise, dense: bool, recalibration: Any,
                 ahead: Vector = (1.0, 0.0)) -> None:
        self._matcher, self._dense = matcher, dense
        self._track, self._ask = new_track(noise, ahead), np.zeros((tl.ASK_ROWS, 3))
        self.recalibration = recalibration

    def restart(self) -> None:
        """Restart at the newest scan, which was processed."""
        self._track[:tl.SINCE_PROCESSED] = 0.0

    def relax_prior(self) -> None:
        """Allow the next match to correct the pose by some cells."""
        self._track[tl.SLACK] = tl.SLIP_LEFT

    def advance(self, before: FloatArray, now: FloatArray) -> Tuple[float, float, bool]:
        """Propagate the pose by a step of odometry; see ``tracking_kernels.advance``.

        Parameters
        ----------
        before : (3,) float64
            Poses of odometry before and after the step [m, m, rad].
        now : (3,) float64
            Poses of odometry before and after the step [m, m, rad].

        Returns
        -------
        distance, turn : float
            Length [m] and rotation [rad] of the step.
        moved : bool
            Whether odometry has moved since the last match.
        """
        return tk.advance(self._track, before, now)

    @property
    def rel(self) -> FloatArray:
        """Pose (3,) by the newest match and odometry since then, relative to the last processed scan."""
        return self._track[tl.REL].copy()

    @property
    def scale(self) -> FloatArray:
        """Scales (2, 2) of odometry's noise: rows translation and heading, columns by distance and by rotation."""
        return self._track[tl.SCALE:tl.SCALE + 2, :2].copy()

    @property
    def bias(self) -> FloatArray:
        """Bias of odometry (3,): scale of distance, scale of rotation, rotation per metre [rad/m]."""
        return self._track[tl.BIAS].copy()

    @property
    def account(self) -> FloatArray:
        """Bias information of the newest processed scan (6, 3): rows ``BIAS_INFORMATION`` to ``TRAVELLED``."""
        return self._track[tl.BIAS_INFORMATION:].copy()

    @property
    def centre(self) -> float:
        """Offset of odometry's reference point ahead of the centre of rotation [m]."""
        return float(self._track[tl.CENTRE, 0])

    @property
    def undecided(self) -> bool:
        """Whether scan and odometry contradict each other, and a slip is not confirmed yet."""
        return bool(self._track[tl.SLIP, 2])

    @property
    def unexplained(self) -> bool:
        """Whether odometry since the last processed scan differs from the newest match."""
        return tk.unexplained(self._track)

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
        tk.predict_all(self._track, anchors, starts, predictions, known)
        return known

    def match(self, maps: TileMaps, particle: int, anchor: FloatArray, reading: ScanReading) -> bool:
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

        Returns
        -------
        bool
            False if the scan has no beams to match.
        """
        track, ask = self._track, self._ask
        beams = reading.beams.shape[1]
        if not beams:
            track[tl.SINCE] = 0.0
            return False
        long, good_share = tk.expect(track, anchor, ask)
        row, slipped = self._matcher.track(maps, particle, reading, ask, long, good_share)
        tk.accept_match(track, anchor, row, row[mk.SCORE] / beams, slipped, long or not self._dense)
        return True

    def learn(self, maps: TileMaps, particle: int, anchor: FloatArray, prediction: FloatArray, reading: ScanReading,
              row: FloatArray) -> None:
        """Update the calibration of odometry by the match of a processed scan.

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
        """
        track, inverse = self._track, np.empty(3)
        tk.update_from_step(track, anchor, row, self.recalibration.next_row())
        if ok.is_bias_observable(track, row, inverse):
            free = self._matcher.match_one(maps, particle, reading, row[:3], prediction, inverse)
            ok.update_bias_unconstrained(track, anchor, free, inverse)


assert (mk.COST, mk.INFORMATION) == (tl.COST, tl.INFORMATION)
