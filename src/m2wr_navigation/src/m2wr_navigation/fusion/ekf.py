# SPDX-License-Identifier: BSD-3-Clause
"""The filter around the kernels: first measurement, order of stamps, plane motion."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_navigation.fusion import ekf_kernels as kernels

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray

LONGEST_STEP = 1e5          # s: a longer gap means another clock; it counts as GAP
GAP = 0.01                  # s
#: Process noise of one second, variances in the order of the state, as ekf_localization_node has it.
PROCESS_NOISE = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015)
INITIAL_VARIANCE = 1e-9
PLANE = np.array([2, 3, 4, 8, 9, 10, 14])       # z, roll, pitch, their rates and the acceleration upwards
PLANE_VARIANCE = 1e-6       # of their measurement as 0


class Measurement(NamedTuple):
    """Values of some members of the state.

    ``used`` (15,) bool, ``values`` (15,), ``covariance`` (15, 15), ``threshold``: largest Mahalanobis distance.
    """

    stamp: float
    used: BoolArray
    values: FloatArray
    covariance: FloatArray
    threshold: float = math.inf


class Ekf:
    """An extended Kalman filter with 15 states.

    Parameters
    ----------
    process_noise : (15, 15) float64, optional
        Of one second.
    initial : (15, 15) float64, optional
        Covariance before the first measurement.
    two_d_mode : bool
        The robot moves on a plane: height, roll, pitch and their rates are measured as 0 each time.

    Attributes
    ----------
    state : (15,) float64
        See :mod:`m2wr_navigation.fusion.ekf_kernels`.
    covariance : (15, 15) float64
    stamp : float or None
        Time of the last measurement [s]; None before the first.
    """

    def __init__(self, process_noise: Optional[FloatArray] = None, initial: Optional[FloatArray] = None,
                 two_d_mode: bool = False) -> None:
        self._noise = np.diag(PROCESS_NOISE) if process_noise is None else np.array(process_noise, dtype=float)
        self._initial = np.eye(kernels.SIZE) * INITIAL_VARIANCE if initial is None else np.array(initial, dtype=float)
        self._plane = two_d_mode
        self.reset()

    def reset(self) -> None:
        """Forget all measurements."""
        self.state = np.zeros(kernels.SIZE)
        self.covariance = self._initial.copy()
        self.stamp: Optional[float] = None

    def set_pose(self, stamp: float, pose: FloatArray, covariance: FloatArray) -> None:
        """Begin again at a pose, at rest.

        Parameters
        ----------
        stamp : float
            Its time [s].
        pose : (6,) float64
            x y z [m], roll pitch yaw [rad].
        covariance : (6, 6) float64
            Of the pose.
        """
        self.reset()
        self.state[:6] = pose
        self.covariance[:6, :6] = covariance
        self.stamp = stamp

    def add(self, measurement: Measurement) -> bool:
        """Predict to the stamp of a measurement, and correct by it; return whether it was used.

        Parameters
        ----------
        measurement : Measurement
            Values that are not finite are left out.

        Returns
        -------
        bool
        """
        used = np.array(measurement.used, dtype=bool) & np.isfinite(measurement.values)
        values, covariance = np.where(used, measurement.values, 0.0), np.array(measurement.covariance, dtype=float)
        if self._plane:
            used[PLANE], values[PLANE] = True, 0.0
            covariance[PLANE, :], covariance[:, PLANE] = 0.0, 0.0
            covariance[PLANE, PLANE] = PLANE_VARIANCE
        members = np.flatnonzero(used)
        part = covariance[np.ix_(members, members)]
        if not len(members) or not np.isfinite(part).all():
            return False
        if self.stamp is None:
            self.state[members] = values[members]
            self.covariance[np.ix_(members, members)] = part
            np.fill_diagonal(self.covariance, np.maximum(np.abs(np.diag(self.covariance)), kernels.SMALLEST))
            self.stamp = measurement.stamp
            return True
        step = measurement.stamp - self.stamp
        if step > 0.0:
            kernels.predict(self.state, self.covariance, self._noise, step if step < LONGEST_STEP else GAP)
            self.stamp = measurement.stamp
        return bool(kernels.correct(self.state, self.covariance, members, values[members], part,
                                    measurement.threshold))

    def predicted(self, now: float) -> Tuple[FloatArray, FloatArray]:
        """Return state and covariance at a later time; the filter stays at its last measurement.

        Parameters
        ----------
        now : float
            Time [s].

        Returns
        -------
        (15,) float64, (15, 15) float64
        """
        state, covariance = self.state.copy(), self.covariance.copy()
        if self.stamp is not None and 0.0 < now - self.stamp < LONGEST_STEP:
            kernels.predict(state, covariance, self._noise, now - self.stamp)
        return state, covariance
