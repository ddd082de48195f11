# SPDX-License-Identifier: BSD-3-Clause
"""A drive to a goal over rough ground, by the elevation map or as if the ground were flat."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, Tuple

import numpy as np

from m2wr_campaign.rough.drive import REACHED, SLIPPED, STUCK, TIPPED, heading_of, patched_world, tilt_of
from m2wr_campaign.terrain.relief import Grid, heights_of, patches_of
from m2wr_elevation.elevation_map import MapSettings
from m2wr_elevation.planning import SPEED, BackOff, cost_of, follow, route
from m2wr_elevation.study.mapping import PERIOD, MappingRobot, cell_of
from m2wr_sim.api import Sim

if TYPE_CHECKING:
    from numpy.typing import NDArray  # noqa: F401

# "back": by the elevation map, and backwards a while where it gets nowhere; "slip": also by what was learned of slip
PLANNERS = ("flat", "elevation", "back", "slip")
GOAL = (6.0, 0.0)           # m
CLOSE = 0.4                 # m from the goal: reached
TILT = math.radians(60.0)
PATIENCE, PROGRESS, LIMIT = 8.0, 0.1, 150.0     # s without moving by so many metres; s in all
_EVERY = 5                  # clouds between two plans
_STEP = 0.005               # s
_SETTINGS = MapSettings(size=16.0, cell=0.08)   # the goal is inside all the time


def to_goal(planner: str, reliefs: Dict[str, float], seed: int, size: float = 20.0,
            samples: int = 257, patches: Tuple[str, ...] = (), share: float = 0.0) -> Dict[str, object]:
    """Drive m2wr_rough to the goal; return the row of a table.

    Parameters
    ----------
    planner : str
        Of PLANNERS.
    reliefs : dict of str to float
        See :func:`m2wr_campaign.terrain.relief.heights_of`.
    seed : int
        Of the ground.
    size : float
        Of a side [m].
    samples : int
        Of a side, 2^n + 1.
    patches : tuple of str
        Of :data:`m2wr_campaign.terrain.relief.PATCHES`, on a share of the ground; the robot is not told of them.
    share : float
        0 to 1.

    Returns
    -------
    dict
        ``planner``, ``seed``, ``outcome``, ``time`` [s], ``length`` [m], ``tilt`` [rad], ``rms`` [m] of the map.

    Raises
    ------
    ValueError
        If there is no such planner.
    """
    if planner not in PLANNERS:
        raise ValueError('there is no planner "{}"; expected {}'.format(planner, " or ".join(PLANNERS)))
    grid = Grid(samples, size)
    heights = heights_of(grid, reliefs, seed)
    world = patched_world(grid, heights, patches_of(grid, patches, share, seed), patches)
    with Sim(world, "m2wr_rough", pose=(0.0, 0.0, 0.5, 0.0), step=_STEP) as sim:
        sim.step((0.0, 0.0), 1.0)
        robot = MappingRobot(sim, _SETTINGS, seed) if planner != "flat" else None
        row: Dict[str, object] = {"planner": planner, "seed": seed}
        row.update(_drive(sim, robot, planner == "slip", planner in ("back", "slip")))
        row["rms"] = robot.errors(grid, heights).rms if robot else math.nan
    return row


def _drive(sim: Sim, robot: "MappingRobot | None", by_slip: bool, backs_off: bool) -> Dict[str, object]:
    way = np.linspace((0.0, 0.0), GOAL, 61)
    began, moved, length, most = sim.time, sim.time, 0.0, 0.0
    anchor = before = np.asarray(sim.pose()[0])
    turned, recovery = _wheels(sim), BackOff()
    for number in range(int(LIMIT / PERIOD)):
        pose = sim.pose()
        here = np.asarray(pose[0])
        length, before, most = length + float(np.linalg.norm(here - before)), here, max(most, tilt_of(pose))
        known = here
        if robot is not None:
            robot.look()
            known = robot.reckoning.position
            if number % _EVERY == 0:
                way = _plan(robot, known, by_slip)
        outcome = ""
        if most > TILT:
            outcome = TIPPED
        elif math.hypot(GOAL[0] - here[0], GOAL[1] - here[1]) < CLOSE:
            outcome = REACHED
        elif np.linalg.norm(here - anchor) > PROGRESS:
            anchor, moved, turned = here, sim.time, _wheels(sim)
        elif sim.time - moved > PATIENCE:
            spun = abs(_wheels(sim) - turned) * sim.drive().wheel_radius
            outcome = SLIPPED if spun > 0.3 * SPEED * PATIENCE else STUCK
        if outcome:
            break
        yaw = heading_of(pose)
        backs = robot is not None and backs_off and recovery.due(sim.time, known[0], known[1], yaw, robot.slip.spins)
        sim.step((-SPEED, 0.0) if backs else follow(way, known[0], known[1], yaw), PERIOD)
    return {"outcome": outcome or STUCK, "time": sim.time - began, "length": length, "tilt": most}


def _wheels(sim: Sim) -> float:
    return float(np.mean(list(sim.joint_positions().values())))


def _plan(robot: MappingRobot, known: "NDArray[np.float64]", by_slip: bool) -> "NDArray[np.float64]":
    """Return the points (n, 2) of the way to the goal over what is known [m]."""
    layers, cell = robot.map.layers(), _SETTINGS.cell
    if by_slip:
        layers["slip"] = robot.slip.layer(robot.map, layers["slope"])
    cost = cost_of(layers, _SETTINGS)
    cells = route(cost, cell_of(robot.map, known[0], known[1]), cell_of(robot.map, *GOAL))
    return np.array(robot.map.corner) + (np.array([(column, row) for row, column in cells], float) + 0.5) * cell
