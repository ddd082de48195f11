"""What the matches find of odometry: how far it is to be trusted, and what it errs by all the time."""
import math

import numpy as np

LEAST = 0.004, 0.004, 0.004         # deviation of no step at all [m, m, rad]
LEAST_SHARE = 0.005, 0.005, 0.005   # and its share of the distance and of the turn
MEMORY = 10.0                                   # steps that the scale remembers
FIRST_MEMORY = 1.0                              # the parameters count for as much as that many steps
SURPRISE = 9.0                                  # a step counts for no more than that many times what was expected
LEAST_TOLD = 0.01           # a scan that says less is not heard
BIAS_VARIANCES = np.square([0.03, 0.03, 0.03])      # what wheels may err by: scale of ways, of turns, turn a metre
BIAS_CHANGES = np.array([1.0, 0.0, 1.0]) / 300.0    # share of it by which they may change in a metre
TOGETHER = 4.0              # the errors of matches that follow each other are alike: as if there were that many fewer
LEAST_TAUGHT = 0.1         # a scan that says less teaches nothing about the bias
FAR_OFF = 4.0               # deviations beyond which an error is none of odometry's usual ones
NARROWEST, WIDEST = 0.1, 30.0    # of the scale


class OdometryTrust:
    """Deviations of odometry over a stretch of way.

    Wheels are better or worse than the parameters say.  A match whose scan fixes the pose tells by how much: the scale
    of the deviations follows the expectation of the squared error, given scan and odometry together (the step of an EM
    algorithm).  Where the scan says nothing, as along a corridor, nothing is learnt.

    Parameters
    ----------
    noise : MotionNoise

    Attributes
    ----------
    scale : (2,) float64
        Of translation and of heading.
    """

    def __init__(self, noise):
        self._noise = noise
        self.scale = np.ones(2)
        self._heard = [0.0, 0.0]        # steps that have told of each

    def _parts(self, distance, turn):
        """Deviations (3,) by themselves, and what a heading that drifts adds to the one across [m]."""
        way, turns = self.scale.tolist()
        noise = self._noise.deviations((distance, 0.0, turn)).tolist()
        own = np.array([(part + least + share * size) * scale for part, least, share, size, scale in zip(
            noise, LEAST, LEAST_SHARE, (distance, distance, turn), (way, way, turns))])
        return own, 0.5 * distance * own[2]

    def deviations(self, distance, turn):
        """Return the deviations (3,) along, across [m] and of the heading [rad] after a way [m] with turns [rad]."""
        own, aside = self._parts(distance, turn)
        own[1] = np.hypot(own[1], aside)
        return own

    def learn(self, error, variance, distance, turn):
        """Take in one stretch.

        Parameters
        ----------
        error : (3,) float64
            Pose found, from where odometry had it.
        variance : (3,) float64
            Of the pose found.
        distance, turn : float
            Way since the start of the stretch [m], [rad].
        """
        own, aside = self._parts(distance, turn)
        squared = np.square(own)
        across = squared[1]
        squared[1] += aside * aside
        told = np.maximum(1.0 - variance / squared, 0.0).tolist()   # what the scan says of each, from nothing to all
        excess = [min(part * part / whole / max(heard, 1e-3), SURPRISE) - 1.0
                  for part, whole, heard in zip(error.tolist(), squared.tolist(), told)]
        told[1] *= float(across) / float(squared[1])            # the rest of what is across is the heading's
        for k, axes in enumerate(((0, 1), (2,))):
            share = sum(told[axis] for axis in axes)
            if share > LEAST_TOLD:
                mean = sum(told[axis] * excess[axis] for axis in axes) / share
                self._heard[k] += min(share, 1.0)
                memory = min(FIRST_MEMORY + self._heard[k], MEMORY)
                scale = float(self.scale[k]) * math.sqrt(1.0 + min(share, 1.0) * mean / memory)
                self.scale[k] = min(max(scale, NARROWEST), WIDEST)


class OdometryBias:
    """What odometry errs by all the time: the scale of its way and of its turns, and the turn it has straight ahead.

    Wheels of other diameters than is thought, at another distance, or of two sizes make an error that adds up instead
    of averaging out, and a match that is held to odometry follows it a little each time. The three are followed by a
    Kalman filter whose measurements are the errors found by the matches; where a scan says nothing, nothing is learnt.

    Parameters
    ----------
    ahead : (2,) float
        Forward direction of the base in the laser's frame.

    Attributes
    ----------
    bias : (3,) float64
        Scale of ways, scale of turns, turn a metre [rad/m]; what a step of odometry lacks.
    """

    def __init__(self, ahead):
        self._ahead = float(ahead[0]), float(ahead[1])
        self.bias = np.zeros(3)
        self._covariance = np.diag(BIAS_VARIANCES)

    def forward(self, step):
        """Return how far a step (3,) leads forwards [m]."""
        return step[0] * self._ahead[0] + step[1] * self._ahead[1]

    def corrected(self, step):
        """Return a step (3,) of odometry without the error that it is known to have."""
        way, turns, drift = self.bias.tolist()
        return np.array([step[0] * (1.0 + way), step[1] * (1.0 + way),
                         step[2] * (1.0 + turns) + drift * self.forward(step)])

    def learn(self, error, variance, told, forward, turn):
        """Take in one stretch.

        Parameters
        ----------
        error : (3,) float64
            Where the scan alone has the pose, from where odometry, corrected, had it; in the laser's axes, as all here.
        variance : (3,) float64
            Of odometry over the stretch, without what is always the same.
        told : (3,) float64
            How much of each the scan has told, from nothing to all.
        forward, turn : float
            Way [m] and turn [rad] by odometry, with their signs.
        """
        grown = self._covariance.diagonal() + BIAS_VARIANCES * BIAS_CHANGES * abs(forward)
        np.fill_diagonal(self._covariance, np.minimum(grown, BIAS_VARIANCES))
        x, y = self._ahead              # a laser may look aside or backwards
        xx, yy = x * x, y * y
        along = x * error[0] + y * error[1], xx * variance[0] + yy * variance[1], xx * told[0] + yy * told[1]
        for (seen, own, heard), row in ((along, (forward, 0.0, 0.0)),
                                        ((error[2], variance[2], told[2]), (0.0, turn, forward))):
            if heard < LEAST_TAUGHT:
                continue
            row = np.array(row)
            gain = self._covariance @ row
            expected = float(row @ gain) + TOGETHER * own / heard
            if seen * seen > FAR_OFF * FAR_OFF * expected:
                continue
            self.bias = self.bias + gain * (seen / expected)
            self._covariance = self._covariance - np.outer(gain, gain) / expected
