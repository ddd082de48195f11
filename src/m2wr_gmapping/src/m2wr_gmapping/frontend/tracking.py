# SPDX-License-Identifier: BSD-3-Clause
"""Where the robot is between two processed scans: odometry, matches in the best map, and what to believe of both."""
import numpy as np

from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import odometry_kernels as ok
from m2wr_gmapping.frontend import track_layout as tl
from m2wr_gmapping.frontend import tracking_kernels as tk


def new_track(noise, ahead=(1.0, 0.0)):
    """Return the ``track`` of ``tracking_kernels`` before the first scan.

    Parameters
    ----------
    noise : MotionNoise
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
    """The pose seen from the last processed scan.

    Every match weighs the scan against odometry as it has led on from the last processed scan, not from the last match:
    many matches in one map, each with a little freedom, would wander off where the scan does not hold them.

    Parameters
    ----------
    matcher : FastMatcher
    noise : MotionNoise
    dense : bool
        Whether all scans are matched, so that a slip of the wheels can be looked at twice.
    recalibration : Recalibration
        Where the steps of the path are kept.
    ahead : (2,) float
        Forward direction of the base in the laser's frame.
    """

    def __init__(self, matcher, noise, dense, recalibration, ahead=(1.0, 0.0)):
        self._matcher, self._dense = matcher, dense
        self._track, self._ask = new_track(noise, ahead), np.zeros((tl.ASK_ROWS, 3))
        self.recalibration = recalibration

    def restart(self):
        """The newest scan was processed: all is seen from there."""
        self._track[:tl.SINCE_PROCESSED] = 0.0

    def relax_prior(self):
        """Let the next match correct the pose by some cells."""
        self._track[tl.SLACK] = tl.SLIP_LEFT

    def advance(self, before, now):
        """Take in that odometry went from ``before`` to ``now`` (3,); see ``tracking_kernels.advance``."""
        return tk.advance(self._track, before, now)

    @property
    def rel(self):
        """Pose (3,) by the newest match and odometry since then, seen from the last processed scan."""
        return self._track[tl.REL].copy()

    @property
    def scale(self):
        """Scales (2, 2) of odometry's deviations against the user's noise: of way and heading, by way and by turn."""
        return self._track[tl.SCALE:tl.SCALE + 2, :2].copy()

    @property
    def bias(self):
        """What a step of odometry lacks (3,): scale of ways, scale of turns, turn a metre [rad/m]."""
        return self._track[tl.BIAS].copy()

    @property
    def account(self):
        """Bias information of the newest processed scan (6, 3): rows ``BIAS_INFORMATION`` to ``TRAVELLED``."""
        return self._track[tl.BIAS_INFORMATION:].copy()

    @property
    def centre(self):
        """How far odometry's centre lies ahead of the robot's centre of turning [m]."""
        return float(self._track[tl.CENTRE, 0])

    @property
    def undecided(self):
        """Whether scan and odometry contradict each other and it is not known yet which is right."""
        return bool(self._track[tl.SLIP, 2])

    @property
    def unexplained(self):
        """Whether odometry does not lead from the last processed scan to where the newest one was found."""
        return tk.unexplained(self._track)

    def predict_particles(self, anchors, starts, predictions):
        """Lead all particles on; see ``tracking_kernels.lead``, of which it returns ``known`` (3, 3)."""
        known = np.empty((3, 3))
        tk.predict_all(self._track, anchors, starts, predictions, known)
        return known

    def match(self, maps, particle, anchor, reading):
        """Match a scan in one particle's map; return False where it has nothing to match.

        Parameters
        ----------
        anchor : (3,) float64
            That particle's pose at the last processed scan.
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

    def learn(self, maps, particle, anchor, prediction, reading, row):
        """Take in the match of a processed scan by one particle.

        Parameters
        ----------
        maps, particle : TileMaps, int
            Whose map it was matched in.
        anchor, prediction : (3,) float64
            That particle's pose at the processed scan before, and where odometry leads from there.
        reading : ScanReading
        row : (13,) float64
            Result of the match.
        """
        track, inverse = self._track, np.empty(3)
        tk.update_from_step(track, anchor, row, self.recalibration.next_row())
        if ok.is_bias_observable(track, row, inverse):
            free = self._matcher.match_one(maps, particle, reading, row[:3], prediction, inverse)
            ok.update_bias_unconstrained(track, anchor, free, inverse)


assert (mk.COST, mk.INFORMATION) == (tl.COST, tl.INFORMATION)
