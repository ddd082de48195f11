"""Where the robot is between two processed scans: odometry, matches in the best map, and what to believe of both."""
import numpy as np

from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping.loop_graph import inverse_symmetric
from m2wr_gmapping.matcher import DEPENDENT, GOOD_SHARE, Expectation
from m2wr_gmapping.odometry_trust import LEAST_TAUGHT, OdometryBias, OdometryTrust
from m2wr_gmapping.se2 import between, compose, inverse

STILL = 0.005, 0.005, 0.005                 # a scan from so near the last matched one tells nothing new [m, m, rad]
LONG_STEP = 0.15, 0.15, 0.1                 # after such a step a plain match may be caught beside the right place
SLIP_FLOOR, SLIP_SHARE = np.array([0.2, 0.3]), 0.4      # how far a slip leads aside [m, rad]; growth with the step
SLIP_SEEN = np.array([0.15, 0.1])           # a slip is believed when it is still there that much later [m, rad]
SLIP_LOOKS = 20                             # or has been seen so often in a row
SLIP_AGREES = np.array([0.1, 0.1, 0.1])     # and is the same within this [m, m, rad]
SLIP_LEFT = np.square([0.05, 0.05, 0.03])   # variance that odometry has after a slip was found [m^2, m^2, rad^2]
ASK_AGAIN, WORSE_SHARE = np.array([0.15, 0.15]), 0.1    # way [m, rad], or fall of the score, after which to doubt anew
UNEXPLAINED = 0.05, 0.05, 0.02              # errors of odometry that move what is 2.5 m away by a cell [m, m, rad]


def _size(step):
    """Distance [m] and turn [rad] of a step (3,)."""
    x, y, turn = step.tolist()
    return np.array([np.hypot(x, y), abs(turn)])


def _variances(information, prior):
    """Variances (3,) of what a scan (6,), upper triangle, and a prior (3,) of variances tell together."""
    h = information.copy()
    h[[0, 3, 5]] += 1.0 / prior
    return inverse_symmetric(h).diagonal()


def _exceeds(step, limits):
    """Whether any part of a step (3,) is larger than its limit."""
    return any(abs(value) > limit for value, limit in zip(step.tolist(), limits))


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
    ahead : (2,) float
        Forward direction of the base in the laser's frame.

    Attributes
    ----------
    rel, expected : (3,) float64
        Pose by the newest match and odometry since then, and by odometry; seen from the last processed scan.
    undecided : bool
        Whether scan and odometry contradict each other and it is not known yet which is right.
    trust : OdometryTrust
    bias : OdometryBias
    """

    def __init__(self, matcher, noise, dense, ahead=(1.0, 0.0)):
        self._matcher, self._noise, self._dense = matcher, noise, dense
        self.trust = OdometryTrust(noise)
        self.bias = OdometryBias(ahead)
        self._answered = None           # score share of a doubt that was answered, way since then
        self.restart()

    def restart(self):
        """The newest scan was processed: all is seen from there."""
        self.rel, self._driven, self._since = np.zeros(3), np.zeros(3), np.zeros(3)
        self._slip = None
        self._expect_from(np.zeros(3), np.zeros(3))

    def loosen(self):
        """Let the next match correct the pose by some cells."""
        self._slack = SLIP_LEFT

    def _expect_from(self, rel, slack):
        """From here on odometry leads on from ``rel``, which is known with the variances ``slack``."""
        self.expected, self._slack = rel, slack
        self._way = np.zeros(2)         # distance [m] and turns [rad] since then
        self._signed = np.zeros(2)      # the same forwards and to the left, less what went back again

    def advance(self, step):
        """Take in a step (3,) of odometry."""
        right = self.bias.corrected(step)
        self.rel, self.expected = compose(self.rel, right), compose(self.expected, right)
        self._signed = self._signed + np.array([self.bias.forward(step), step[2]])
        self._driven, self._since = compose(self._driven, step), compose(self._since, step)
        self._way += _size(step)

    @property
    def moved(self):
        """Whether odometry has moved since the last match."""
        return _exceeds(self._since, STILL)

    @property
    def undecided(self):
        """Whether scan and odometry contradict each other and it is not known yet which is right."""
        return self._slip is not None

    @property
    def unexplained(self):
        """Whether odometry does not lead from the last processed scan to where the newest one was found."""
        return _exceeds(between(self._driven, self.rel), UNEXPLAINED)

    @property
    def variances(self):
        """Variances (3,) of ``expected`` along its axes."""
        return np.square(self.trust.deviations(*self._way)) + self._slack

    @property
    def spread(self):
        """Deviations (3,) to draw particles with: not more than the user's noise, less where odometry is better."""
        return np.minimum(np.sqrt(self.variances), self._noise.deviations(self.expected))

    def match(self, maps, particle, anchor, reading):
        """Match a scan in one particle's map; return False where it has nothing to match.

        Parameters
        ----------
        anchor : (3,) float64
            That particle's pose at the last processed scan.
        """
        step, self._since = self._since, np.zeros(3)
        beams = reading.beams.shape[1]
        if not beams:
            return False
        long = _exceeds(step, LONG_STEP)
        at_once = not self._dense or long
        expectation = Expectation(compose(anchor, self.expected), self.variances, SLIP_FLOOR + SLIP_SHARE * _size(step),
                                  long, self._good_share(step))
        row, slipped = self._matcher.track(maps, particle, reading, compose(anchor, self.rel), expectation)
        self.rel = between(anchor, row[:3])
        share = row[mk.SCORE] / beams
        if share < GOOD_SHARE and self._answered is None:
            self._answered = share, np.zeros(2)
        self._judge(slipped, at_once)
        return True

    def _good_share(self, step):
        """Return the share of the beams that a match must score not to be doubted.

        Where the robot sees what is new, many scans in a row score low; a doubt that was answered is not raised again
        at once.
        """
        if self._answered is None:
            return GOOD_SHARE
        share, way = self._answered
        way = way + _size(step)
        self._answered = None if (way > ASK_AGAIN).any() else (share, way)
        return GOOD_SHARE if self._answered is None else min(GOOD_SHARE, share - WORSE_SHARE)

    def _judge(self, slipped, at_once):
        """Believe in a slip that is seen over some way: a robot that rocks looks like one for a moment."""
        if not slipped:
            self._slip = None
            return
        # what takes odometry's poses to those found, the way when it was first seen, and how often it was
        if self._slip is None or (np.abs(between(compose(self._slip[0], self.expected), self.rel)) > SLIP_AGREES).any():
            self._slip = compose(self.rel, inverse(self.expected)), self._way.copy(), 0
        aside, way, looks = self._slip
        self._slip = aside, way, looks + 1
        if at_once or looks >= SLIP_LOOKS or (self._way - way > SLIP_SEEN).any():
            self._slip = None
            self.trust.learn(between(self.expected, self.rel), np.zeros(3), *self._way)
            self._expect_from(self.rel, SLIP_LEFT)

    def learn(self, found, information):
        """Take in how far odometry erred up to a processed scan.

        Parameters
        ----------
        found : (3,) float64
            Pose of its match, seen from the last processed scan.
        information : (6,) float64
            Upper triangle of the scan's information.
        """
        if self._slack.any():           # then it is not odometry's error alone
            return
        prior = self.variances
        error, variance = between(self.expected, found), _variances(information, prior)
        told = np.maximum(1.0 - variance / prior, 0.0)
        heard = np.maximum(1.0 - _variances(information / DEPENDENT, prior) / prior, 0.0)
        # a match is the mean of scan and odometry, weighted by what was told: alone the scan says that much more
        self.bias.learn(error / np.maximum(told, LEAST_TAUGHT), prior, heard, *self._signed)
        self.trust.learn(error, variance, *self._way)
