# SPDX-License-Identifier: BSD-3-Clause
"""Worlds to explore: given ones, a house, and generated buildings; each with a start and its true map."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, Iterator, Sequence, Tuple

import numpy as np

from m2wr_campaign.worlds.generators import GENERATORS, generate
from m2wr_exploration.study.truth import passable_from, reachable_area
from m2wr_navigation.accuracy.scenes import house
from m2wr_navigation.compare.planned import costmap_of
from m2wr_navigation.costmap.cost_layout import INSCRIBED
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT
from motion_plan.body import TURNING_RADIUS

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import BoolArray
    from m2wr_sim.model.types import World

#: Generators of buildings, with values that differ from their defaults.
BUILDINGS: Tuple[Tuple[str, Dict[str, float]], ...] = (("office", {}), ("rooms", {}), ("maze", {"cells": 4}))
#: Larger ones, for several robots: two that turn have room beside each other.
LARGE: Tuple[Tuple[str, Dict[str, float]], ...] = (
    ("office", {"rooms": 9, "room": 5.0, "corridor": 3.0, "door": 1.6}),
    ("maze", {"cells": 12, "width": 2.4, "opened": 0.2}))
ROOM = TURNING_RADIUS + 0.05  # m: the disc in which the robot turns, and a cell: obstacles on a grid are larger
DRAWS = 1000                # random places, by which the largest area is found
STARTS = {"world01": (0.0, 8.0, 0.0), "world02": (0.0, 8.0, 0.0), "world03": (0.0, 8.0, 0.0),
          "unreachable": (0.0, 8.0, 0.0), "house": (0.0, 0.0, 0.0)}


@dataclass(frozen=True)
class Place:
    """A world to explore.

    Attributes
    ----------
    name : str
    world : World
    start : (3,) float
        [m, m, rad]
    truth : Costmap
        Of the true world.
    wanted : (H, W) bool
        Its free cells within ROOM of where the robot can turn.
    """

    name: str
    world: World
    start: Tuple[float, float, float]
    truth: Costmap
    wanted: BoolArray


def whole_map(world: World, *places: Sequence[float]) -> Costmap:
    """Return the true map of a world.

    Parameters
    ----------
    world : World
    *places : (N,) float
        Points x, y [m] that have to be on it, besides all obstacles; more numbers are ignored.

    Raises
    ------
    ValueError
        If the world is too large.
    """
    ends = np.array([point[:2] for point in places], float).reshape(-1, 2)
    return costmap_of(obstacle_outlines(world, FLOOR, ROBOT_HEIGHT), ends, ROOM)


def place(name: str, world: World, start: Tuple[float, float, float]) -> Place:
    """Return a world with its truth.

    Parameters
    ----------
    name : str
    world : World
    start : (3,) float
        [m, m, rad]

    Raises
    ------
    ValueError
        If the robot cannot be at its start, or the world is too large.
    """
    truth = whole_map(world, start)
    return Place(name, world, start, truth, reachable_area(truth, np.array(start[:2]), ROOM))


def random_start(world: World, seed: int) -> Tuple[float, float, float]:
    """Return a random place between the obstacles of a world, in the largest area that hangs together [m, m, rad].

    Parameters
    ----------
    world : World
    seed : int

    Raises
    ------
    ValueError
        If the robot has room nowhere, or the world is too large.
    """
    outlines = obstacle_outlines(world, FLOOR, ROBOT_HEIGHT)
    if not outlines:
        return 0.0, 0.0, 0.0
    truth = whole_map(world)
    corners = truth.cells(np.concatenate([outline.vertices for outline in outlines]))
    between = np.zeros(truth.shape, bool)
    between[tuple(slice(low, high + 1) for low, high in zip(corners.min(axis=0), corners.max(axis=0)))] = True
    free = between & (truth.costs < INSCRIBED)
    generator, best = np.random.default_rng(seed), np.zeros((0, 2), np.int64)
    for cell in generator.permutation(np.argwhere(free))[:DRAWS]:
        if free[tuple(cell)]:               # not in an area that was drawn before
            area = np.argwhere(passable_from(truth, (int(cell[0]), int(cell[1]))) & free)
            best = area if len(area) > len(best) else best
            free[area[:, 0], area[:, 1]] = False
    if not len(best):
        raise ValueError("the world has no place where a disc of {:.2f} m is free between obstacles".format(ROOM))
    x, y = truth.centre(*best[generator.integers(len(best))])
    return x, y, float(generator.uniform(-np.pi, np.pi))


def named(name: str, seed: int) -> Place:
    """Return a world by its name or file; the start is random where none is known.

    Parameters
    ----------
    name : str
        ``house``, or as :func:`m2wr_sim.api.read_world` takes it.
    seed : int

    Raises
    ------
    ValueError, SimError
        If there is no such world, or no place to start.
    """
    text = house() if name == "house" else name
    world = read_world(text)
    return place(name, world, STARTS.get(name) or random_start(world, seed))


def buildings(count: int, seed: int, kinds: Sequence[Tuple[str, Dict[str, float]]] = BUILDINGS) -> Iterator[Place]:
    """Yield generated buildings, by turns of each kind.

    Parameters
    ----------
    count : int
    seed : int
    kinds : sequence of (str, dict)
        Names of generators, and their values.
    """
    for number in range(count):
        kind, values = kinds[number % len(kinds)]
        all_values = {name: parameter.default for name, parameter in GENERATORS[kind].parameters.items()}
        text, ends = generate(kind, dict(all_values, **values), seed, number, ROOM)
        yield place("{} {}".format(kind, number), read_world(text), ends[0])
