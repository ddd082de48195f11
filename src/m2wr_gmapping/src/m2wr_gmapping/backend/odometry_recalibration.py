# SPDX-License-Identifier: BSD-3-Clause
"""Correction of past steps of the path once the offset of the centre of rotation is known.

Odometry may report a point beside the axle. A robot that turns in front of a long wall cannot observe how far this
point moves along the wall. The offset is estimated later, so the first steps of the path are corrected then. The other
biases of odometry change with the ground and are not corrected here.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple

import numpy as np

from m2wr_gmapping.backend import odometry_recalibration_kernels as kernels
from m2wr_gmapping.frontend import track_layout as tl

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray

FIRST_STEPS = 256
CHECK_EVERY, CHECK_SHARE = 8, 8     # a check is due after that many steps plus this fraction of the path
MIN_SHIFT = 0.01                    # the maps are rebuilt if a node moves by more [m]


class Recalibration:
    """The steps to all processed scans, with what is needed to correct them.

    Parameters
    ----------
    ahead : (2,) float
        Forward direction of the base in the laser's frame.
    """

    def __init__(self, ahead: FloatArray) -> None:
        self._ahead = np.array(ahead, float)
        self._steps, self._count, self._looked_at = np.zeros((FIRST_STEPS, kernels.STEP_SIZE)), 0, 0

    def next_row(self) -> FloatArray:
        """Return the row (STEP_SIZE,) of the next step, to be written by the caller."""
        if self._count == len(self._steps):
            self._steps = np.concatenate([self._steps, np.zeros_like(self._steps)])
        self._count += 1
        return self._steps[self._count - 1]

    @property
    def due(self) -> bool:
        """Whether enough steps were added since the last check."""
        return self._count - self._looked_at >= CHECK_EVERY + self._count // CHECK_SHARE

    def correct(self, path: FloatArray, centre: float) -> Tuple[Optional[FloatArray], FloatArray]:
        """Return the corrections of the steps of a path, and the corrected path.

        Parameters
        ----------
        path : (K, 3) float64
            Poses at all processed scans, including the first.
        centre : float
            Offset of odometry's reference point ahead of the centre of rotation [m].

        Returns
        -------
        changes : (K, 3) float64, or None if no node moves by more than MIN_SHIFT
            To be composed with each step, in the axes of the pose that the step leads to.
        path : (K, 3) float64
        """
        self._looked_at = self._count
        changes, found = np.zeros_like(path), np.empty_like(path)
        if self._count:
            kernels.missing_corrections(self._steps, self._count, centre, self._ahead, changes[1:])
        kernels.corrected_path(path, changes, found)
        if not (np.abs(found - path)[:, :2] > MIN_SHIFT).any():
            return None, path
        self._steps[:self._count, kernels.APPLIED:] += changes[1:, :2]
        return changes, found

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored in a state file."""
        return dict(steps=self._steps[:self._count], _looked_at=self._looked_at)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore the attributes that ``compact`` returned."""
        steps, self._looked_at = stored["steps"], stored["_looked_at"]
        self._count = len(steps)
        self._steps = np.zeros((max(FIRST_STEPS, self._count), kernels.STEP_SIZE))
        self._steps[:self._count] = steps


assert (kernels.UNOBSERVED, kernels.ROTATION, kernels.CENTRE, kernels.APPLIED) == (
    tl.STEP_UNOBSERVED, tl.STEP_TURN, tl.STEP_CENTRE, tl.STEP_APPLIED)
