# SPDX-License-Identifier: BSD-3-Clause
"""Cluttered offices: rooms on both sides of a corridor, each with a door, desks, cabinets and chairs."""
from __future__ import annotations

import math
from typing import Any, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_campaign.worlds.parts import Disc, free_point
from m2wr_navigation.compare.scenes import MARGIN, WALL, Box, Ends, world_text
from m2wr_navigation.optimum.shortest_path import NoShortestPathError, shortest_path
from m2wr_navigation.parameters import Parameter
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines

PARAMETERS = {
    "rooms": Parameter(3, "", 1, 10, "rooms on each side of the corridor"),
    "room": Parameter(4.0, "m", 2.0, 10.0, "length and width of a room"),
    "corridor": Parameter(2.0, "m", 0.6, 6.0, "width of the corridor"),
    "door": Parameter(1.3, "m", 0.5, 2.0, "width of a door"),
    "clutter": Parameter(0.2, "", 0.0, 0.6, "share of the floor that furniture covers, as far as it finds a place"),
}
_DESK, _CABINET, _CHAIR = (1.4, 0.7), (1.0, 0.4), 0.25      # m: length and width, radius
_AISLE = 0.5                # m before a door that stays free
_PLACES = 60                # tries to place furniture in a room


def _walls(values: Mapping[str, Any], doors: List[Tuple[float, float]]) -> List[Box]:
    """Return the walls; ``doors``: the middle of each [m], first those above the corridor."""
    count, room, half, door = values["rooms"], values["room"], 0.5 * values["corridor"], values["door"]
    length, depth = count * room, half + room
    walls: List[Box] = [(0.5 * length, side * depth, length, WALL) for side in (-1.0, 1.0)]
    walls += [(x, 0.0, WALL, 2.0 * depth) for x in (0.0, length)]
    walls += [(i * room, side * (half + 0.5 * room), WALL, room) for side in (-1.0, 1.0) for i in range(1, count)]
    for number, (middle, y) in enumerate(doors):
        left = number % count * room
        for begin, end in ((left, middle - 0.5 * door), (middle + 0.5 * door, left + room)):
            walls.append((0.5 * (begin + end), y, end - begin, WALL))
    return walls


def furniture(room: Tuple[float, float, float, float], door: Tuple[float, float], width: float, share: float,
              random: np.random.Generator) -> Tuple[List[Box], List[Disc]]:
    """Return boxes and chairs that cover a share of a room's floor and leave its door free.

    Parameters
    ----------
    room : (4,) float
        Least x and y, length, width [m].
    door : (2,) float
        Its middle [m].
    width : float
        Of the door [m].
    share : float
        Less is covered if no place is found.
    random : numpy.random.Generator
    """
    boxes: List[Box] = []
    chairs: List[Disc] = []
    covered, keep = 0.0, 0.5 * width + _AISLE
    for _ in range(_PLACES):
        if covered >= share * room[2] * room[3]:
            break
        kind = int(random.integers(3))
        length, across = ((2.0 * _CHAIR, 2.0 * _CHAIR), _DESK, _CABINET)[kind]
        if random.random() < 0.5:
            length, across = across, length
        x = room[0] + 0.5 * length + float(random.random()) * (room[2] - length)
        y = room[1] + 0.5 * across + float(random.random()) * (room[3] - across)
        outside = math.hypot(max(0.0, abs(door[0] - x) - 0.5 * length), max(0.0, abs(door[1] - y) - 0.5 * across))
        overlaps = any(abs(x - a) < 0.5 * (length + c) and abs(y - b) < 0.5 * (across + d)
                       for a, b, c, d in boxes + [(a, b, 2.0 * r, 2.0 * r) for a, b, r in chairs])
        if outside < keep or overlaps:
            continue
        if kind == 0:
            chairs.append((x, y, _CHAIR))
        else:
            boxes.append((x, y, length, across))
        covered += length * across
    return boxes, chairs


def attempt(random: np.random.Generator, values: Mapping[str, Any], radius: float) -> Optional[Tuple[str, Ends]]:
    """Return a world in SDF with its start in the first room and its goal in the last one of the other side.

    None: there is no place for the robot in one of them, or no way.

    Parameters
    ----------
    random : numpy.random.Generator
    values : mapping of str to object
        Of PARAMETERS.
    radius : float
        Of the disc in which the robot turns [m].
    """
    count, room, half, door = values["rooms"], values["room"], 0.5 * values["corridor"], values["door"]
    least = 2.0 * radius + MARGIN
    if min(door, 2.0 * half - WALL) < least or door > room - 2.0 * WALL:
        return None
    rooms = [(i * room, half if side > 0 else -half - room, room, room) for side in (1, -1) for i in range(count)]
    slack = 0.5 * door + WALL
    doors = [(float(random.uniform(x + slack, x + room - slack)), half if y > 0.0 else -half) for x, y, _, _ in rooms]
    boxes, chairs = _walls(values, doors), []
    for place, middle in zip(rooms, doors):
        more, seats = furniture(place, middle, door, values["clutter"], random)
        boxes += more
        chairs += seats
    text = world_text(boxes, chairs)
    obstacles = obstacle_outlines(read_world(text))
    start = free_point(rooms[0], obstacles, radius + MARGIN, random)
    goal = free_point(rooms[-1], obstacles, radius + MARGIN, random)
    if start is None or goal is None:
        return None
    try:
        shortest_path(obstacles, radius + 0.5 * MARGIN, start, goal)
    except NoShortestPathError:
        return None
    return text, ((*start, round(float(random.uniform(-math.pi, math.pi)), 3)), goal)
