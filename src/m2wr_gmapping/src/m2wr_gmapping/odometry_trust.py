"""How far odometry is to be trusted: the user's noise, scaled by what the matches have found of it so far."""
import math

import numpy as np

LEAST = np.array([0.004, 0.004, 0.004])         # deviation of no step at all [m, m, rad]
LEAST_SHARE = np.array([0.005, 0.005, 0.005])   # and its share of the distance and of the turn
MEMORY = 10.0                                   # steps that the scale remembers
SURPRISE = 9.0                                  # a step counts for no more than that many times what was expected
LEAST_TOLD = 0.01           # a scan that says less is not heard
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

    def _parts(self, distance, turn):
        """Deviations (3,) by themselves, and what a heading that drifts adds to the one across [m]."""
        base = self._noise.deviations(np.array([distance, 0.0, turn])) + LEAST
        base += LEAST_SHARE * np.array([distance, distance, turn])
        own = base * self.scale[[0, 0, 1]]
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
        squared = np.square(own) + np.array([0.0, aside * aside, 0.0])
        told = np.maximum(1.0 - variance / squared, 0.0)    # what the scan says of each, from nothing to all
        ratio = np.minimum(np.square(error) / squared / np.maximum(told, 1e-3), SURPRISE)
        told[1] *= own[1] * own[1] / squared[1]             # the rest of what is across is the heading's
        for k, axes in enumerate(([0, 1], [2])):
            share = told[axes].sum()
            if share > LEAST_TOLD:
                excess = float((told[axes] * (ratio[axes] - 1.0)).sum()) / share
                self.scale[k] *= math.sqrt(1.0 + excess / MEMORY)
        np.clip(self.scale, NARROWEST, WIDEST, out=self.scale)
