# SPDX-License-Identifier: BSD-3-Clause
"""Steps of the best particle's path, and how each depends on the calibration of odometry and of the laser's mount.

The calibration becomes better while the robot drives. Along directions that no scan observed, such as a long wall, the
first steps are as wrong as the first calibration was. They are corrected when more is known.
"""
from __future__ import annotations

from typing import Any, Dict, List, Tuple

import numpy as np

from m2wr_gmapping.frontend.calibration_kernels import changed_steps
from m2wr_gmapping.frontend.information_kernels import DEPENDENT, fused_covariance, scan_information
from m2wr_gmapping.frontend.track import CALIBRATION_CHANGE, CALIBRATION_PRIOR, RECORD_SIZE
from m2wr_gmapping.tuning import DRIFT
from m2wr_maps.linear_kernels import inverse
from m2wr_maps.se2 import between, compose
from m2wr_node.array_types import BoolArray, FloatArray

FIRST_STEPS = 256
CHECK_EVERY, CHECK_SHARE = 8, 8     # a check is due after that many steps plus this fraction of the path
#: Measured pose (3,) of a node from the one before, its information (3, 3), position variance [m^2], record.
Step = Tuple[FloatArray, FloatArray, float, FloatArray]
#: Node to which the robot may have turned in an unknown way; (3,) bool, after which right angles the place looks alike.
Doubt = Tuple[int, BoolArray]


class StepHistory:
    """Steps to all nodes of a path; node 0 has none.

    Attributes
    ----------
    count : int
        Number of nodes.
    doubtful : list of Doubt
        Steps on which the robot may have turned in an unknown way.
    """

    def __init__(self) -> None:
        self._records = np.zeros((FIRST_STEPS, RECORD_SIZE))
        self._information, self._variances = np.zeros((FIRST_STEPS, 3, 3)), np.zeros(FIRST_STEPS)
        self._measured = np.zeros((1, 3))           # pose of each node from the one before, [0] unused
        self.doubtful: List[Doubt] = []
        self.count, self._checked_at = 1, 0

    def next_record(self) -> FloatArray:
        """Add a node; return the data (RECORD_SIZE,) of its StepRecord, to be written by the caller."""
        if self.count == len(self._variances):
            for name in ("_records", "_information", "_variances"):
                rows = getattr(self, name)
                setattr(self, name, np.concatenate([rows, np.zeros_like(rows)]))
        self.count += 1
        return self._records[self.count - 1]

    def set_information(self, row: FloatArray, variances: FloatArray) -> None:
        """Set the information of the step to the newest node.

        Parameters
        ----------
        row : (13,) float64
            Result row of its match.
        variances : (3,) float64
            Variances of odometry [m^2, m^2, rad^2].
        """
        found = scan_information(row, 1.0 / DEPENDENT)
        covariance = fused_covariance(found, variances) + np.diag(np.square(DRIFT.step))
        self._variances[self.count - 1] = covariance[0, 0] + covariance[1, 1]
        self._information[self.count - 1] = inverse(covariance)

    @property
    def information(self) -> FloatArray:
        """Information (K, 3, 3) of the steps, in the axes of the pose that each leads to."""
        return self._information[:self.count]

    @property
    def variances(self) -> FloatArray:
        """Position variances (K,) of the steps [m^2]."""
        return self._variances[:self.count]

    def corrected(self, path: FloatArray) -> FloatArray:
        """Return the steps with the calibration that is known today.

        Parameters
        ----------
        path : (K, 3) float64
            Path of the best particle; new nodes are added to the history.

        Returns
        -------
        (K, 3) float64
            Pose of each node from the one before; the first is 0.
        """
        count, known = len(path), len(self._measured)
        if known < count:
            more = [between(path[k - 1], path[k]) for k in range(known, count)]
            self._measured = np.concatenate([self._measured, more])
        change = changed_steps(self._records[:count], CALIBRATION_PRIOR, CALIBRATION_CHANGE / DRIFT.calibration)
        return compose(self._measured[:count], change)

    def mark_doubtful(self, alike: BoolArray) -> None:
        """Tell that the robot may have turned in an unknown way on the step to the newest node.

        ``alike``, (3,) bool: after which right angles the place looks alike (``turned_path.looks_alike``).
        """
        self.doubtful.append((self.count - 1, alike))

    def step(self, node: int) -> Step:
        """Return the step to a node."""
        return (self._measured[node].copy(), self._information[node].copy(), float(self._variances[node]),
                self._records[node].copy())

    def replace_step(self, node: int, step: Step) -> None:
        """Replace the step to a node that :meth:`corrected` has seen.

        Parameters
        ----------
        node : int
        step : tuple
            As of :meth:`step`.
        """
        self._measured[node], self._information[node], self._variances[node], self._records[node] = step

    @property
    def due(self) -> bool:
        """Whether enough steps were added since the last ``checked``."""
        return self.count - self._checked_at >= CHECK_EVERY + self.count // CHECK_SHARE

    def checked(self) -> None:
        """Tell that the path was compared with the corrected steps."""
        self._checked_at = self.count

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored, without spare rows."""
        return dict(_records=self._records[:self.count], _information=self.information, _variances=self.variances,
                    _measured=self._measured, doubtful=self.doubtful, _checked_at=self._checked_at)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned."""
        self.__dict__.update(stored)
        self.count = len(self._variances)


def turned_step(step: FloatArray, turn: float) -> Step:
    """Return a step on which the robot was also turned on the spot, which was not measured.

    Parameters
    ----------
    step : (3,) float64
        As measured [m, m, rad].
    turn : float
        [rad]
    """
    carried = np.square(DRIFT.carried)
    return (compose(step, [0.0, 0.0, turn]), np.diag(1.0 / carried), float(carried[0] + carried[1]),
            np.zeros(RECORD_SIZE))


def path_of(start: FloatArray, steps: FloatArray) -> FloatArray:
    """Return the path (K, 3) of steps.

    Parameters
    ----------
    start : (3,) float64
        First pose of the path.
    steps : (K, 3) float64
        Pose of each node from the one before; the first is not used.
    """
    path = np.empty_like(steps)
    path[0] = start
    for k in range(1, len(steps)):
        path[k] = compose(path[k - 1], steps[k])
    return path
