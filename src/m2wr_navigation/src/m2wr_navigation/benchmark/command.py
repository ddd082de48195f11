# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_navigation benchmark``: CPU times of costmaps, planners, controllers beside those of the C++ stack."""
from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Callable, Iterator, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.benchmark import grids, layers, localization
from m2wr_navigation.benchmark.reference import NAMES, NoReferenceError, reference_path
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint import circle
from m2wr_navigation.costmap.inflation_kernels import cost_table, inflate
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS, Observation, Source, scan_points
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_navigation.parameters import read
from m2wr_navigation.planners import wave_kernels
from m2wr_navigation.planners.navfn import FACTOR, NEUTRAL
from m2wr_navigation.planners.planner import cost_table as planner_table

if TYPE_CHECKING:
    from m2wr_navigation.planners.planner import Cell
    from m2wr_node.array_types import Uint8Array

LARGE = 4000                # cells along a side of the largest grid
REPEATED = 5                # times, of which the best counts
BEAMS = 720
SAMPLING_TIME = 1.0         # s of wall time for a planner that samples


@dataclass(frozen=True)
class Row:
    """One measurement.

    Attributes
    ----------
    task : str
    cpu_ms : float
        CPU time, user and system, of the best of several runs [ms].
    original_ms : float or None
        The same with the C++ functions, on one core at 2.6 GHz [ms].
    remark : str
    """

    task: str
    cpu_ms: float
    original_ms: Optional[float]
    remark: str = ""


def best_of(work: Callable[[], object], prepare: Callable[[], object] = lambda: None, count: int = REPEATED) -> float:
    """Return the least CPU time of some calls [ms].

    Parameters
    ----------
    work : callable
    prepare : callable
        Called before each, not measured.
    count : int
    """
    times = []
    for _ in range(count):
        prepare()
        begun = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - begun))
    return min(times)


_INFLATION = {(200, 6): 0.20, (200, 11): 0.37, (200, 20): 0.84, (LARGE, 6): 159.0, (LARGE, 11): 269.0,
              (LARGE, 20): 826.0}


def inflation_row(costs: Uint8Array, radius: int) -> Row:
    """Return the time of an inflation.

    Parameters
    ----------
    costs : (N, N) uint8
    radius : int
        [cells]
    """
    size, grid = len(costs), costs.copy()
    table = cost_table(radius, grids.RESOLUTION, grids.INSCRIBED_RADIUS, grids.SCALING)
    spent = best_of(lambda: inflate(grid, table, radius, 0, size, 0, size, False), lambda: np.copyto(grid, costs), 20)
    return Row("inflation, {0} x {0} cells, radius {1}".format(size, radius), spent, _INFLATION.get((size, radius)))


def cycle_row(seed: int) -> Row:
    """Return the time of a cycle of a local costmap: scan, rays, marks, inflation, snapshot."""
    costmap = LayeredCostmap("odom", (6.0, 6.0), grids.RESOLUTION, (0.0, 0.0), True, False)
    costmap.set_footprint(circle(0.2))
    for name in ("ObstacleLayer", "InflationLayer"):
        kind = registry.find(registry.LAYERS, name)
        costmap.add(kind(name, read(kind.PARAMETERS, {}, name)[0]))
    source = Source("scan", read(SOURCE_PARAMETERS, {"clearing": True}, "scan")[0])
    costmap.obstacle_layers()[0].sources["scan"] = source
    random, times = np.random.default_rng(seed), []
    for step in range(200):
        ranges = random.uniform(0.5, 4.0, BEAMS).tolist()
        place = np.array([3.0 + 0.01 * step, 3.0, 0.2])
        begun = time.process_time()
        points, free = scan_points(ranges, -3.1, 6.2 / BEAMS, (0.1, 10.0), source.values)
        source.add(Observation(0.05 * step, place, points + place, free + place), 0.05 * step)
        costmap.update(np.array([place[0], place[1], 0.0]), 0.05 * step)
        costmap.snapshot()
        times.append(1e3 * (time.process_time() - begun))
    return Row("local costmap 6 x 6 m, a cycle with {} beams".format(BEAMS), float(np.mean(times)), None, "mean")


def controller_row(seed: int, name: str, given: Mapping[str, object],
                   original_ms: Optional[float]) -> Row:
    """Return the time of a cycle of a controller: distances, samples, choice.

    Parameters
    ----------
    seed : int
    name : str
        Of the controller.
    given : mapping of str to object
        Parameters.
    original_ms : float or None
        Of the C++ functions for samples and grids of these sizes.
    """
    costmap, random = Costmap.filled((120, 120), grids.RESOLUTION, (-3.0, -3.0), 0, "odom"), np.random.default_rng(seed)
    for row, column in random.integers(2, 116, (12, 2)):
        if np.hypot(row - 60, column - 60) > 15.0:
            costmap.costs[row:row + 2, column:column + 2] = 254
    inflate(costmap.costs, cost_table(11, grids.RESOLUTION, 0.2, grids.SCALING), 11, 0, 120, 0, 120, False)
    kind = registry.find(registry.CONTROLLERS, name)
    controller = kind(read(kind.PARAMETERS, given, name)[0])
    footprint = np.array([[0.25, 0.2], [-0.25, 0.2], [-0.25, -0.2], [0.25, -0.2]])
    plan = np.column_stack([np.linspace(0.0, 2.5, 60), np.linspace(0.0, 1.0, 60), np.zeros(60)])
    situation = Situation(0.0, 0.1, np.zeros(3), np.array([0.4, 0.0, 0.0]), plan, costmap, footprint)
    spent = best_of(lambda: controller.compute(situation), count=20)
    return Row("{}, {} samples, local costmap 6 x 6 m".format(name, len(controller.reachable(situation))), spent,
               original_ms)


#: 820 samples with 17 poses on average; of the original, 6 ms for them and 0.6 ms for the distances.
_DWA = {"vx_samples": 20, "vth_samples": 40, "vy_samples": 1, "max_vel_y": 0.0, "min_vel_y": 0.0, "max_vel_x": 0.65,
        "max_vel_trans": 0.65, "sim_time": 1.0, "min_vel_trans": 0.0, "min_vel_theta": 0.0}
_POTENTIAL = {384: 4.3, 800: 21.0, LARGE: 1577.0}


def potential_row(costmap: Costmap, start: Cell) -> Row:
    """Return the time of a whole potential.

    Parameters
    ----------
    costmap : Costmap
        Square.
    start : (row, column)
    """
    table, none = planner_table(NEUTRAL, FACTOR, True), np.zeros((0, 0), np.uint8)
    potential = np.empty(costmap.shape, np.float32)
    spent = best_of(lambda: wave_kernels.wave(costmap.costs, table, start, (-1, -1), potential, none, True),
                    lambda: potential.fill(np.inf), 3)
    return Row("whole potential, {0} x {0} cells, blocks".format(costmap.rows), spent, _POTENTIAL.get(costmap.rows))


def plan_row(scene: str, costmap: Costmap, ends: Tuple[Cell, Cell], name: str) -> Row:
    """Return the time of one plan; the first one, which makes the memory, is not counted.

    Parameters
    ----------
    scene : str
        Name of the costmap.
    costmap : Costmap
    ends : (start, goal)
        Cells.
    name : str
        Of the planner.
    """
    kind = registry.find(registry.PLANNERS, name)
    planner = kind(read(kind.PARAMETERS, {}, name)[0])
    start, goal = (np.array([*costmap.centre(*cell), 0.0]) for cell in ends)
    plan = planner.plan(costmap, start, goal)
    spent = best_of(lambda: planner.plan(costmap, start, goal), count=3)
    return Row("one plan, {0} x {0} cells, {1}, {2}".format(costmap.rows, scene, name), spent, None,
               plan.reason or "{:.1f} m".format(plan.length))


def sampling_row(costmap: Costmap, ends: Tuple[Cell, Cell], name: str, seconds: float) -> Row:
    """Return the path that a planner finds in some time by samples, and that of OMPL.

    Parameters
    ----------
    costmap : Costmap
    ends : (start, goal)
        Cells.
    name : str
        Of the planner.
    seconds : float
        Wall time for each.
    """
    kind = registry.find(registry.PLANNERS, name)
    values = read(kind.PARAMETERS, {"planning_time": seconds, "iterations": 20000, "cost_factor": 0.0}, name)[0]
    start, goal = (np.array([*costmap.centre(*cell), 0.0]) for cell in ends)
    begun = time.process_time()
    plan = kind(values, time.perf_counter).plan(costmap, start, goal)
    spent = 1e3 * (time.process_time() - begun)
    try:
        theirs = reference_path(name, costmap, start[:2], goal[:2], seconds)
        told = "{:.2f} m".format(float(np.hypot(*np.diff(theirs, axis=0).T).sum())) if len(theirs) else "none"
    except NoReferenceError as error:
        told = str(error)
    return Row("{}, {:g} s or 20000 samples, {} x {} cells, blocks".format(name, seconds, costmap.rows, costmap.rows),
               spent, None, "{}; OMPL in {:g} s: {}".format(plan.reason or "{:.2f} m".format(plan.length), seconds,
                                                            told))


def rows_of(seed: int, large: bool) -> Iterator[Row]:
    """Yield all rows.

    Parameters
    ----------
    seed : int
        Of the grids.
    large : bool
        Whether the grids of 4000 x 4000 cells are among them.
    """
    for size in [200] + [LARGE] * large:
        costs = grids.blocks(size, np.random.default_rng(seed))
        for radius in (6, 11, 20):
            yield inflation_row(costs, radius)
    yield cycle_row(seed)
    for name in ("ObstacleLayer", "VoxelLayer"):
        for sight, count in layers.POINTS.items():
            yield Row("{}, 120 x 120 cells, {} of {} points".format(name, sight, count),
                      layers.layer_time(name, sight, seed), None, "mean")
    yield controller_row(seed, "DWAPlannerROS", _DWA, 6.6)
    yield controller_row(seed, "TrajectoryPlannerROS", {"holonomic_robot": False}, None)
    for (particles, beams), original in localization.ORIGINAL_MS.items():
        yield Row("amcl, likelihood field, {} particles x {} beams".format(particles, beams),
                  localization.field_time(particles, beams, seed), original)
    for size in [384, 800] + [LARGE] * large:
        for scene, (costmap, start, goal) in grids.scenes(size, seed).items():
            if scene == "blocks":
                yield potential_row(costmap, start)
            for name in ("NavfnROS", "AStar", "ThetaStar"):
                yield plan_row(scene, costmap, (start, goal), name)
    costmap, start, goal = grids.scenes(384, seed)["blocks"]
    for name in NAMES:
        yield sampling_row(costmap, (start, goal), name, SAMPLING_TIME)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="benchmark", description="CPU times of costmaps, planners, controllers, amcl "
                                     "beside those of the C++ navigation stack on one core at 2.6 GHz.")
    parser.add_argument("--quick", action="store_true", help="leave out the grids of 4000 x 4000 cells")
    parser.add_argument("--seed", type=int, default=0, help="seed of the grids (default 0)")
    parser.add_argument("--json", default="", metavar="FILE", help="also write the figures to this file")
    options = parser.parse_args(argv)
    compile_kernels()
    rows: List[Row] = []
    print("%-56s %10s %10s %6s" % ("task", "CPU ms", "C++ ms", "ratio"))
    for row in rows_of(options.seed, not options.quick):
        rows.append(row)
        original = ("", "") if row.original_ms is None else (
            "%.2f" % row.original_ms, "%.2f" % (row.cpu_ms / row.original_ms))
        print("%-56s %10.3f %10s %6s  %s" % (row.task, row.cpu_ms, *original, row.remark), flush=True)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as stream:
            json.dump([asdict(row) for row in rows], stream, indent=1)
    return 0
