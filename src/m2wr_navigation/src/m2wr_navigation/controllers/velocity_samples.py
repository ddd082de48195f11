# SPDX-License-Identifier: BSD-3-Clause
"""Velocity samples within the limits of a robot, and the memory of oscillations."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

AT_REST = 0.01              # m/s: slower samples turn on the spot
ROUNDING = 1e-4            # of velocities at their limits


def along_axis(low: float, high: float, count: int) -> FloatArray:
    """Return samples of one axis: evenly from ``low`` to ``high``, and 0 if it lies between.

    Parameters
    ----------
    low, high : float
    count : int
        Without the 0; at least 2 are made, or 1 if the ends are equal.
    """
    if high - low < 1e-9:
        return np.array([high])
    values = np.linspace(low, high, max(2, count))
    if low < 0.0 < high and not (np.abs(values) < 1e-9).any():
        values = np.sort(np.append(values, 0.0))
    return values


def window(values: Mapping[str, Any], velocity: FloatArray, period: float) -> FloatArray:
    """Return least and greatest velocity (3, 2) of each axis that the robot can reach.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of DWAPlannerROS.
    velocity : (3,) float64
        Present one [m/s, m/s, rad/s].
    period : float
        Time to accelerate [s].

    Notes
    -----
    A robot that rests may begin to turn with ``min_vel_theta``, also if it could not accelerate to it within the
    period: slower turns are not obeyed by bases with such a limit.
    """
    limits = np.array([(values["min_vel_x"], values["max_vel_x"]), (values["min_vel_y"], values["max_vel_y"]),
                       (-values["max_vel_theta"], values["max_vel_theta"])])
    reach = period * np.array([values["acc_lim_x"], values["acc_lim_y"], values["acc_lim_theta"]])
    slowest = min(values["min_vel_theta"], values["max_vel_theta"])
    found = np.stack([velocity - reach, velocity + reach], -1)
    if abs(velocity[2]) < slowest:
        found[2] = min(found[2, 0], -slowest), max(found[2, 1], slowest)
    clipped = np.clip(found, limits[:, :1], limits[:, 1:])
    return np.asarray(clipped, float)


def make_samples(values: Mapping[str, Any], velocity: FloatArray, period: float) -> FloatArray:
    """Return velocities (N, 3) that the robot can reach and that its limits allow; N may be 0.

    Parameters
    ----------
    values, velocity, period
        As for :func:`window`.
    """
    ends = window(values, velocity, period)
    axes = [along_axis(low, high, count) for (low, high), count in zip(ends, (
        values["vx_samples"], values["vy_samples"], values["vth_samples"]))]
    samples = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    speed, rate = np.hypot(samples[:, 0], samples[:, 1]), np.abs(samples[:, 2])
    slow_turn = rate < values["min_vel_theta"] - ROUNDING
    # turns on the spot have a least rate also where min_vel_trans is 0
    refused = ((speed < values["min_vel_trans"] - ROUNDING) | (speed < AT_REST)) & slow_turn
    if values["max_vel_trans"] > 0.0:
        refused |= speed > values["max_vel_trans"] + ROUNDING
    return np.ascontiguousarray(samples[~refused])


class Oscillation:
    """Bars the direction from which the robot has just turned back, until it has moved on.

    Attributes
    ----------
    barred : (3, 2) float64
        For x, y and theta: 1 if negative, and if positive velocities are barred.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.barred: FloatArray = np.zeros((3, 2))
        self._sign = [0, 0, 0]
        self._since: FloatArray = np.zeros(3)

    def look(self, pose: FloatArray, distance: float, angle: float) -> None:
        """Lift the bars if the robot has moved on since they were set.

        Parameters
        ----------
        pose : (3,) float64
        distance, angle : float
            ``oscillation_reset_dist`` [m] and ``oscillation_reset_angle`` [rad].
        """
        if self.barred.any():
            away = pose - self._since
            turn = abs(math.remainder(away[2], 2.0 * math.pi))
            if math.hypot(away[0], away[1]) > distance or turn > angle:
                self.reset()

    def note(self, velocity: FloatArray, pose: FloatArray, slow: float) -> None:
        """Take note of a command.

        Parameters
        ----------
        velocity : (3,) float64
        pose : (3,) float64
            Of the robot.
        slow : float
            ``min_vel_trans``: only below it are y and theta looked at [m/s].
        """
        for axis in range(3):
            if axis and abs(velocity[0]) > slow:
                break
            sign = int(np.sign(velocity[axis]))
            if sign and self._sign[axis] == -sign:
                self.barred[axis] = (1.0, 0.0) if sign > 0 else (0.0, 1.0)
                self._since = np.array(pose, float)
            self._sign[axis] = sign or self._sign[axis]
