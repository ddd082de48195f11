# SPDX-License-Identifier: BSD-3-Clause
"""Ways that are narrower than the footprint of a costmap.

A robot that is longer than wide turns in a disc, and fits through places that are narrower. A costmap with this disc as
its footprint keeps it where it can turn; a least clearance opens the narrow places where there is no other way.
"""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL
from m2wr_navigation.localization.field_kernels import distance_transform

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap


def with_narrow_ways(costmap: Costmap, clearance: float) -> Costmap:
    """Return a costmap in which inscribed cells farther from lethal ones than the clearance have the cost below.

    Parameters
    ----------
    costmap : Costmap
        Not changed.
    clearance : float
        [m]
    """
    away = np.empty(costmap.shape, np.float32)
    distance_transform(costmap.costs == LETHAL, clearance / costmap.resolution + 2.0, away)
    opened = (costmap.costs == INSCRIBED) & (away * costmap.resolution > clearance)
    return replace(costmap, costs=np.where(opened, np.uint8(INSCRIBED - 1), costmap.costs))
