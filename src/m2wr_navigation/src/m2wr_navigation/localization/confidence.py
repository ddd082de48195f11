# SPDX-License-Identifier: BSD-3-Clause
"""Whether a pose can be trusted, and why not."""
from __future__ import annotations

import math

BAD_SHARE = 0.5             # of the beams that fit the map, below which the pose is doubtful
BAD_WEIGHT = 0.5            # of the particles that agree on the pose, likewise
_HELP = "Set the pose in rviz, or call global_localization and drive on"


def doubt(share: float, weight: float) -> str:
    """Return a sentence why the pose may be wrong; empty: it can be trusted.

    Parameters
    ----------
    share : float
        Of the beams with a return that end near obstacles of the map; NaN: there were none.
    weight : float
        Share of the particles' weight that agrees on the pose.
    """
    if weight < BAD_WEIGHT:
        return "the robot may be in several places: only {:.0f} % of the particles agree on the likeliest one. Drive " \
            "on until the scans tell them apart, or set the pose in rviz".format(100.0 * weight)
    if math.isfinite(share) and share < BAD_SHARE:
        return "only {:.0f} % of the beams fit the map: the pose may be wrong, or the map is old. {}".format(
            100.0 * share, _HELP)
    return ""
