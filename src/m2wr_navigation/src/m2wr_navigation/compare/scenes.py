# SPDX-License-Identifier: BSD-3-Clause
"""Worlds with a start and a goal: generated ones, and given ones; the same for a seed.

Generated are by turns rooms, with walls and doors, and places with boxes and pillars; or places with obstacles that
move. In each the robot can get from the start to the goal with a margin around the disc in which it turns.
"""
from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation.compare import plaza
from m2wr_navigation.compare.movers import least_start_distance, movers_of
from m2wr_navigation.optimum.shortest_path import NoShortestPathError, shortest_path
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT, point_distances

if TYPE_CHECKING:
    from m2wr_navigation.compare.movers import Mover
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline

Box = Tuple[float, float, float, float]             # centre x, y, length, width [m]
Ends = Tuple[Tuple[float, float, float], Tuple[float, float]]       # start [m, m, rad] and goal [m]

KINDS = ("rooms", "pillars")
SIDE = 12.0                 # m: of a generated world
DOOR, WALL, HEIGHT = 1.6, 0.15, 1.0     # m
MARGIN = 0.15               # m: free around the disc in which the robot turns
TRIES = 200
LEAST_SHARE = 0.5           # of the world's diagonal: start and goal are so far apart


@dataclass(frozen=True)
class Scene:
    """A world with a start and a goal.

    Attributes
    ----------
    name : str
    world : str
        As :func:`m2wr_sim.api.read_world` takes it.
    start : (3,) float
        Pose of the robot [m, m, rad].
    goal : (2,) float
        [m]
    """

    name: str
    world: str
    start: Tuple[float, float, float]
    goal: Tuple[float, float]


def generated(count: int, seed: int, radius: float, moving: int = 0) -> Iterator[Scene]:
    """Yield generated scenes.

    Parameters
    ----------
    count : int
    seed : int
    radius : float
        Of the disc in which the robot turns [m].
    moving : int, optional
        How many obstacles move in each.

    Raises
    ------
    ValueError
        If the robot is too large for these worlds.
    """
    for number in range(count):
        random = np.random.default_rng([seed, number])
        kind = "{} moving,".format(moving) if moving else KINDS[number % 2]
        for _ in range(TRIES):
            found = attempt(kind, random, radius, moving)
            if found is not None:
                text, ends = found
                yield Scene("{} {}".format(kind, number), text, *ends)
                break
        else:
            raise ValueError("no way for a robot with a radius of {:.2f} m in {} generated worlds".format(
                radius, TRIES))


def attempt(kind: str, random: np.random.Generator, radius: float,
            moving: int = 0) -> Optional[Tuple[str, Ends]]:
    """Return a world in SDF with its start and goal; None if no way was found.

    Parameters
    ----------
    kind : str
        Of KINDS; without a meaning where obstacles move.
    random : numpy.random.Generator
    radius : float
        Of the disc in which the robot turns [m].
    moving : int, optional
        How many obstacles move.
    """
    if moving:
        boxes, posts = _border(plaza.SIDE), plaza.pillars(random)
        obstacles = obstacle_outlines(read_world(world_text(boxes, posts)))
        found = _ends(obstacles, random, radius, 1)
        return (world_text(boxes, posts, plaza.actors(moving, random, obstacles, found[0][0])),
                found[0]) if found else None
    text = world_text(_rooms(random), []) if kind == "rooms" else world_text(*_pillars(random))
    ends = _ends(obstacle_outlines(read_world(text)), random, radius, 1)
    return (text, ends[0]) if ends else None


def given(world: str, seed: int, radius: float, height: float = ROBOT_HEIGHT) -> Scene:
    """Return a scene in a given world.

    Parameters
    ----------
    world : str
        As :func:`m2wr_sim.api.read_world` takes it.
    seed : int
    radius : float
        Of the disc in which the robot turns [m].
    height : float, optional
        Of the robot [m]: what is higher is no obstacle.

    Raises
    ------
    ValueError
        If no start and goal with a way between them were found.
    """
    read = read_world(world)
    found = _ends(obstacle_outlines(read, FLOOR, height), np.random.default_rng(seed), radius, TRIES,
                  movers_of(read, FLOOR, height))
    if not found:
        raise ValueError("world {}: no start and goal with a way between them, for a disc of {:.2f} m".format(
            world, radius + MARGIN))
    return Scene(os.path.splitext(os.path.basename(world))[0], world, *found[0])


def _ends(obstacles: Sequence[Outline], random: np.random.Generator, radius: float,
          tries: int, movers: Sequence[Mover] = ()) -> List[Ends]:
    """Return one pair of a start and a goal, or none."""
    corners = np.concatenate([outline.vertices for outline in obstacles] + [np.zeros((0, 2))])
    if not len(corners):
        corners = np.array([(-0.5 * SIDE, -0.5 * SIDE), (0.5 * SIDE, 0.5 * SIDE)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    least = LEAST_SHARE * float(np.hypot(*(high - low)))
    for _ in range(tries):
        points = random.uniform(low, high, (TRIES, 2))
        free = points[(_clearances(points, obstacles) > radius + MARGIN)
                      & (least_start_distance(movers, points) > plaza.FREE)]
        if len(free) < 2 or np.hypot(*(free[0] - free[1:]).T).max() < least:
            continue
        goal = free[1 + int(np.argmax(np.hypot(*(free[0] - free[1:]).T)))]
        try:
            shortest_path(obstacles, radius + 0.5 * MARGIN, free[0], goal)
        except NoShortestPathError:
            continue
        yaw = round(float(random.uniform(-math.pi, math.pi)), 3)
        (x, y), (to_x, to_y) = np.round(free[0], 3).tolist(), np.round(goal, 3).tolist()
        return [((x, y, yaw), (to_x, to_y))]
    return []


def _clearances(points: FloatArray, obstacles: Sequence[Outline]) -> FloatArray:
    return np.min([point_distances(points, outline) for outline in obstacles] + [np.full(len(points), np.inf)], axis=0)


def _border(side: float = SIDE) -> List[Box]:
    half = 0.5 * side
    return [(0.0, -half, side, WALL), (0.0, half, side, WALL), (-half, 0.0, WALL, side), (half, 0.0, WALL, side)]


def _rooms(random: np.random.Generator) -> List[Box]:
    """Return walls that divide a square twice along each axis, with doors."""
    walls, half = _border(), 0.5 * SIDE
    for axis in range(2):
        for place in (-SIDE / 6.0, SIDE / 6.0):
            across = place + random.uniform(-0.5, 0.5)
            begin = -half
            for door in np.sort(random.uniform(-half + 1.0, half - 1.0 - DOOR, 2)).tolist():
                if door > begin + 0.3:
                    middle, length = 0.5 * (begin + door), door - begin
                    walls.append((middle, across, length, WALL) if axis == 0 else (across, middle, WALL, length))
                begin = max(door + DOOR, begin)
            middle, length = 0.5 * (begin + half), half - begin
            walls.append((middle, across, length, WALL) if axis == 0 else (across, middle, WALL, length))
    return walls


def _pillars(random: np.random.Generator) -> Tuple[List[Box], List[Tuple[float, float, float]]]:
    """Return boxes and pillars (centre x, y, radius [m]) in a square with a border."""
    boxes, pillars, inside = _border(), [], 0.5 * SIDE - 0.5
    for _ in range(12):
        x, y, length, width = (*random.uniform(-inside, inside, 2), *random.uniform(0.3, 2.0, 2))
        boxes.append((float(x), float(y), float(length), float(width)))
        x, y, radius = (*random.uniform(-inside, inside, 2), random.uniform(0.1, 0.4))
        pillars.append((float(x), float(y), float(radius)))
    return boxes, pillars


def world_text(boxes: Sequence[Box], pillars: Sequence[Tuple[float, float, float]],
               actors: str = "") -> str:
    """Return a world in SDF.

    Parameters
    ----------
    boxes : sequence of (float, float, float, float)
        Centre x, y, length, width [m].
    pillars : sequence of (float, float, float)
        Centre x, y, radius [m].
    actors : str, optional
        In SDF.
    """
    shapes = [(x, y, "<box><size>{:.3f} {:.3f} {:g}</size></box>".format(length, width, HEIGHT))
              for x, y, length, width in boxes]
    shapes += [(x, y, "<cylinder><radius>{:.3f}</radius><length>{:g}</length></cylinder>".format(radius, HEIGHT))
               for x, y, radius in pillars]
    parts = ["<{0} name=\"{0}_{1}\"><pose>{2:.3f} {3:.3f} {4:g} 0 0 0</pose><geometry>{5}</geometry></{0}>".format(
        kind, k, x, y, 0.5 * HEIGHT, shape) for k, (x, y, shape) in enumerate(shapes)
        for kind in ("collision", "visual")]
    return ("<?xml version=\"1.0\"?><sdf version=\"1.6\"><world name=\"default\"><include><uri>model://sun</uri>"
            "</include><include><uri>model://ground_plane</uri></include><model name=\"obstacles\"><static>1</static>"
            "<link name=\"link\">{}</link></model>{}</world></sdf>".format("".join(parts), actors))
