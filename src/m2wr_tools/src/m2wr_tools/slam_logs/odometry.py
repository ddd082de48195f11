# SPDX-License-Identifier: BSD-3-Clause
"""Odometry from the rotation of two wheels, with the errors of real encoders and calibrations."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_maps.se2 import compose, inverse

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_tools.slam_logs.drive import Drive

RADIUS, SEPARATION = 0.1, 0.4       # of m2wr's wheels [m]
BURST = 3                   # records for which a wheel slips
BURST_SHARE = 0.5           # greatest share of its distance that a slipping wheel reports too much or too little


@dataclass(frozen=True)
class OdometryErrors:
    """What is wrong with odometry.

    Attributes
    ----------
    radius : (float, float)
        Relative error of the radius of the left and the right wheel.
    separation : float
        Relative error of the distance between the wheels.
    noise : float
        Standard deviation of the distance of one wheel [m], per square root of a metre.
    ticks : int
        Steps of the encoder in one revolution; 0: exact.
    bursts : float
        How often one wheel slips, per metre.
    centre : (float, float)
        Where odometry believes the middle of the axle, in the base frame [m].
    """

    radius: Tuple[float, float] = (0.0, 0.0)
    separation: float = 0.0
    noise: float = 0.0
    ticks: int = 0
    bursts: float = 0.0
    centre: Tuple[float, float] = (0.0, 0.0)


def integrate(drive: Drive, errors: OdometryErrors, rng: np.random.Generator) -> FloatArray:
    """Return the poses (K, 3) of odometry [m, m, rad], from (0, 0, 0).

    Each step is an arc: the heading in its middle counts, as in Borenstein and Feng, Measurement and correction of
    systematic odometry errors in mobile robots, IEEE Transactions on Robotics and Automation 12, 1996.

    Parameters
    ----------
    drive : Drive
    errors : OdometryErrors
    rng : numpy.random.Generator
        For the noise and the slip.
    """
    wheels = drive.wheels
    if errors.ticks:
        step = 2.0 * math.pi / errors.ticks
        wheels = np.floor(wheels / step) * step
    travelled = np.diff(wheels, axis=0) * RADIUS * (1.0 + np.array(errors.radius))
    travelled += rng.normal(0.0, 1.0, travelled.shape) * errors.noise * np.sqrt(np.abs(travelled))
    if errors.bursts:
        travelled *= 1.0 + _bursts(travelled, errors.bursts, rng)
    for begin, end in drive.pushed + drive.carried:
        travelled[begin:end] = 0.0
    turned = (travelled[:, 1] - travelled[:, 0]) / (SEPARATION * (1.0 + errors.separation))
    yaw = np.concatenate([[0.0], np.cumsum(turned)])
    middle = yaw[:-1] + 0.5 * turned
    forward = travelled.mean(axis=1)
    steps = np.column_stack([forward * np.cos(middle), forward * np.sin(middle)])
    poses = np.column_stack([np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]), yaw])
    centre = np.array([*errors.centre, 0.0])
    return compose(compose(centre, poses), inverse(centre))


def _bursts(travelled: FloatArray, rate: float, rng: np.random.Generator) -> FloatArray:
    """Return the relative errors (K, 2) of two wheels that now and then slip for a moment, one at a time.

    Parameters
    ----------
    travelled : (K, 2) float64
        [m]
    rate : float
        How often a wheel slips [1/m].
    rng : numpy.random.Generator
    """
    found = np.zeros(travelled.shape)
    starts = np.flatnonzero(rng.random(len(travelled)) < rate * np.abs(travelled).mean(axis=1))
    wheels, shares = rng.integers(0, 2, len(starts)), rng.uniform(-BURST_SHARE, BURST_SHARE, len(starts))
    for start, wheel, share in zip(starts, wheels, shares):
        found[start:start + BURST, wheel] = share
    return found
