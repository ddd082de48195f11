# SPDX-License-Identifier: BSD-3-Clause
"""Skipping of intermediate scans that arrive faster than they can be matched; due scans are never skipped."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_maps.se2 import between

if TYPE_CHECKING:
    from m2wr_gmapping.mapper import Mapper
    from m2wr_node.array_types import FloatArray

SOME, MANY = 0.1, 0.5       # fill level of the queue from which close scans, and all intermediate scans, are skipped
FEW = 3                     # scans that may wait for transforms without being a backlog
NEARBY = np.array([0.075, 0.075, 0.05])     # a match with so small a step needs no search [m, m, rad]


def may_pass(mapper: Mapper, odom_pose: FloatArray, stamp: float, waiting: int, limit: int) -> bool:
    """Return whether a scan may be skipped because others wait; odometry then continues from the last used scan.

    Parameters
    ----------
    mapper : Mapper
        A mapper that has used a scan before.
    odom_pose : (3,) float
        Pose of the centred laser in ``odom``.
    stamp : float
        [s]
    waiting, limit : int
        Number of waiting scans, and its limit.

    Returns
    -------
    bool
        False for due scans, and with ``compatible``, where every scan moves the particles.
    """
    if waiting < max(SOME * limit, FEW) or mapper.config["compatible"]:
        return False
    if not (np.isfinite(odom_pose).all() and np.isfinite(stamp)):
        return False            # will be refused with a warning
    if mapper.due_at(odom_pose, stamp):
        return False
    return waiting >= max(MANY * limit, 2 * FEW) or bool((np.abs(between(mapper.odometry, odom_pose)) <= NEARBY).all())
