# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 7: weights by which a path with a wide distance from obstacles is the best one."""
from __future__ import annotations

from typing import Iterator, List, Mapping, Tuple

import numpy as np
import yaml

from m2wr_course.finding import Finding
from m2wr_navigation.best_path.candidates import Candidate, Task, candidates
from m2wr_navigation.best_path.settings import make_settings
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.best_path.track import ObstacleField
from m2wr_navigation.compare.planned import costmap_of
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_navigation.registry import UnknownPluginError
from m2wr_sim.api.loading import read_world
from m2wr_sim.errors import WorldError
from m2wr_sim.model.outlines import obstacle_outlines
from motion_plan.body import TURNING_RADIUS
from motion_plan.surroundings import axle_of

WORLD, START, GOAL = "world02", (0.0, 8.0, 0.0), (0.0, -4.0)
CLEARANCE = 0.5             # m that is asked for
LONGER = 1.2                # greatest length over the optimum
MOST = 1 << 16              # bytes of a file


def _read(path: str) -> Mapping[str, object]:
    """Return the parameters of a YAML file."""
    try:
        with open(path, encoding="utf-8") as stream:
            found = yaml.safe_load(stream.read(MOST))
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        raise WorldError("the weights cannot be read: %s" % " ".join(str(error).split())) from error
    if not isinstance(found, dict) or not isinstance(found.get("criteria"), dict):
        raise WorldError("criteria is missing; expected a file like config/best_path.yaml of m2wr_sim")
    return found


def _choose(given: Mapping[str, object]) -> Tuple[List[Candidate], List[str], float]:
    """Return the candidates on the true map, warnings about parameters, and the length of the optimum [m]."""
    obstacles = obstacle_outlines(read_world(WORLD))
    axle, goal = np.array([*axle_of(START), START[2]]), np.array(GOAL)
    true = costmap_of(obstacles, np.array([axle[:2], goal]), TURNING_RADIUS)
    survey = Survey(40.0, 0.5 * (axle[:2] + goal))
    survey.seed(np.where(true.costs == LETHAL, 100, 0).astype(np.int8), true.resolution, true.origin)
    try:
        settings, warnings = make_settings(given, "")
    except UnknownPluginError as error:
        raise WorldError(str(error)) from error
    task = Task(survey.inflated(), ObstacleField(survey.snapshot()), settings.scorer, settings.make, axle, goal)
    best = shortest_path(obstacles, TURNING_RADIUS, axle[:2], goal).length
    return candidates(task, settings.planners, False), warnings, best


def safe_path(path: str) -> Iterator[Finding]:
    """Exercise 7: weights with which the robot keeps its distance, without a long way round.

    Parameters
    ----------
    path : str
        YAML file with the parameters of ``best_path``.

    Yields
    ------
    Finding
    """
    found, warnings, optimum = _choose(_read(path))
    yield Finding(not warnings, "parameters that have no effect or a wrong value: %s" % ("; ".join(warnings) or "none"),
                  "compare the names with those in config/best_path.yaml")
    first = next((candidate for candidate in found if candidate.score is not None), None)
    amounts = {} if first is None or first.score is None else first.score.amounts
    name = "none" if first is None else first.name
    clearance, length = amounts.get("clearance", 0.0), amounts.get("length", float("inf"))
    yield Finding(clearance >= CLEARANCE, "the best path is %s, %.2f m from the nearest obstacle" % (name, clearance),
                  "at least %g m are asked for: which weight makes narrow paths bad, up to which distance?" % CLEARANCE)
    ratio = length / optimum
    yield Finding(ratio <= LONGER, "it is %.2f m long, %.2f times the shortest one" % (length, ratio),
                  "at most %g times is asked for: do not forget the weight of the length" % LONGER)
