# SPDX-License-Identifier: BSD-3-Clause
"""What is left out when scans come faster than they can be matched: looks on the way, never one to be processed."""
import numpy as np

from m2wr_gmapping.se2 import between

SOME, MANY = 0.1, 0.5       # shares of the queue that wait, from which on scans nearby, and all on the way, are passed
FEW = 3                     # scans may wait for their transforms without being a backlog
NEARBY = np.array([0.075, 0.075, 0.05])     # a match that begins so far away needs no search [m, m, rad]


def may_pass(mapper, odom_pose, stamp, waiting, limit):
    """Whether a scan may be passed over because others wait; the next one's odometry then leads on from the last taken.

    Parameters
    ----------
    mapper : Mapper
        That has taken a scan before.
    odom_pose : (3,) float
        Pose of the centred laser in ``odom``.
    stamp : float
        [s]
    waiting, limit : int
        Scans that wait, and that may wait.

    Returns
    -------
    bool
        False for what is to be processed, and with ``compatible``, where every scan moves the particles.
    """
    if waiting < max(SOME * limit, FEW) or mapper.config["compatible"]:
        return False
    if not (np.isfinite(odom_pose).all() and np.isfinite(stamp)):
        return False            # to be refused, which is told
    if mapper.due_at(odom_pose, stamp):
        return False
    return waiting >= max(MANY * limit, 2 * FEW) or bool((np.abs(between(mapper.odometry, odom_pose)) <= NEARBY).all())
