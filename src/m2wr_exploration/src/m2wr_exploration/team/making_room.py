# SPDX-License-Identifier: BSD-3-Clause
"""Where a robot that has nothing to do waits: not where its teammates drive."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_exploration import frontier_kernels
from m2wr_exploration.frontiers import NEAR, distances
from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_navigation.parameters import read
from m2wr_navigation.planners.navfn import Navfn

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray

#: m: between the centre of a robot that waits and a path: two half widths of 0.25 m, CLEARANCE of right_of_way, 0.1 m,
#: and 0.1 m by which robots leave their paths.
ROOM = 0.7
DETOUR = ROOM + 0.1     # m: radius of the disc around a robot that waits, through which paths cost more
COST = 127              # of a cell in this disc: navfn's path through it counts three times its length
_PLANNER = read(Navfn.PARAMETERS, {}, "")[0]     # as move_base plans by default


def paths(costmap: Costmap, robot: FloatArray, ways: Sequence[Tuple[FloatArray, FloatArray]]) -> List[FloatArray]:
    """Return the paths (N, 2) of teammates, as they would plan them with this robot where it is [m].

    Parameters
    ----------
    costmap : Costmap
    robot : (2,) float64
        Where this robot is [m].
    ways : sequence of (place, goal)
        (2,) float64 each: of teammates that drive [m]; those that find no path have none.
    """
    costs = costmap.costs.copy()
    around = disc(costmap, robot, DETOUR)
    costs[around] = np.where(costs[around] < COST, COST, costs[around])
    known = Costmap(costs, costmap.resolution, costmap.origin, costmap.frame)
    planner = Navfn(_PLANNER)
    plans = [planner.plan(known, np.append(place, 0.0), np.append(goal, 0.0), NEAR) for place, goal in ways]
    return [plan.poses[:, :2] for plan in plans if len(plan.poses)]


def place_to_wait(costmap: Costmap, robot: FloatArray, driven: Sequence[FloatArray], present: FloatArray,
                  kept: Optional[FloatArray] = None) -> Optional[FloatArray]:
    """Return where a robot can wait that is in the way of a teammate; None: it is not in the way, or has no choice.

    Parameters
    ----------
    costmap : Costmap
        Inscribed, lethal and unknown cells are not crossed.
    robot : (2,) float64
        [m]
    driven : sequence of (N, 2) float64
        Paths of teammates [m].
    present : (M, 2) float64
        Where teammates are [m]; the robot does not pass near to them.
    kept : (2,) float64, optional
        Place to which it drives already [m]; it is kept as long as no path leads near to it.
    """
    taken = np.concatenate([np.asarray(path, float).reshape(-1, 2) for path in driven] or [np.zeros((0, 2))])
    if not len(taken) or np.hypot(*(taken - robot).T).min() >= ROOM:
        return None
    costs = costmap.costs.copy()
    for place in present:
        around = disc(costmap, place, min(ROOM, 0.9 * float(np.hypot(*(place - robot)))))
        costs[around] = np.where(costs[around] < INSCRIBED, LETHAL, costs[around])
    cell = costmap.cell(*robot)
    start = (-1, -1) if cell is None else frontier_kernels.nearest_passable(
        costs, cell[0], cell[1], INSCRIBED - 1, int(math.ceil(NEAR / costmap.resolution)))
    if start[0] < 0:
        return None
    way = distances(Costmap(costs, costmap.resolution, costmap.origin, costmap.frame), start)
    marks = np.zeros(costmap.shape, bool)
    cells = costmap.cells(np.concatenate([taken, present]))
    cells = cells[costmap.inside(cells)]
    marks[cells[:, 0], cells[:, 1]] = True
    away = np.empty(costmap.shape, np.float32)
    distance_transform(marks, ROOM / costmap.resolution + 3.0, away)
    clear = np.isfinite(way) & (away * costmap.resolution >= ROOM + costmap.resolution)
    if kept is not None:
        at = costmap.cell(*kept)
        if at is not None and clear[at]:
            return kept
    if not clear.any():
        return None
    row, column = np.unravel_index(int(np.argmin(np.where(clear, way, np.inf))), way.shape)
    return np.array(costmap.centre(int(row), int(column)))


def disc(costmap: Costmap, centre: FloatArray, radius: float) -> Any:
    """Return an index of the cells of a costmap in a disc.

    Parameters
    ----------
    costmap : Costmap
    centre : (2,) float64
        [m]
    radius : float
        [m]
    """
    low, high = (np.clip(np.floor((np.asarray(centre, float) + sign * radius - costmap.origin) / costmap.resolution),
                         0, [costmap.columns - 1, costmap.rows - 1]).astype(int) for sign in (-1.0, 1.0))
    columns, rows = np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)
    x = costmap.origin[0] + (columns + 0.5) * costmap.resolution - centre[0]
    y = costmap.origin[1] + (rows + 0.5) * costmap.resolution - centre[1]
    inside: BoolArray = y[:, None] ** 2 + x[None, :] ** 2 <= radius ** 2
    found = np.argwhere(inside)
    return rows[found[:, 0]], columns[found[:, 1]]
