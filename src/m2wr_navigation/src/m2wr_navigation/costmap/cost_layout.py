# SPDX-License-Identifier: BSD-3-Clause
"""The values of a cell of a costmap, as costmap_2d defines them (``cost_values.h``)."""
from __future__ import annotations

NO_INFORMATION = 255        # nothing is known of the cell
LETHAL = 254                # an obstacle is in the cell
INSCRIBED = 253             # the robot's centre in this cell means contact, whatever its heading
FREE = 0                    # 1 to 252: the nearer to an obstacle, the greater
