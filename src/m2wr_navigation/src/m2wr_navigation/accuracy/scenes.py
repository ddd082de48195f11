# SPDX-License-Identifier: BSD-3-Clause
"""Worlds for drives to random goals: those of the simulator, an arena with pillars, a house; their true maps."""
from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Dict, Tuple

import numpy as np

from m2wr_navigation.compare.planned import MARGIN, RESOLUTION, costmap_of
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_navigation.localization.localization_map import LocalizationMap
from m2wr_navigation.planners.wave_kernels import connected
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, Int8Array
    from m2wr_sim.model.types import World

HALF_OF_A_WALL = 0.08       # m
LASER_HEIGHT, SLICE = 0.15, 0.005           # m: of m2wr above the floor; half of the height that counts
#: Free space around the world [m]: whole cells and a half. The outermost walls, and those that are whole cells away
#: from them, have their faces at centres of cells, from where amcl measures. On the border of two cells rounding
#: decides which one is occupied, for all of these walls alike, and the map is half a cell away from the world.
FRAME = MARGIN + 0.5 * RESOLUTION
GAP = 0.3                   # m: half of the widest gap in the walls around a world that does not lead outside
_WORLD = """<?xml version="1.0"?>
<sdf version="1.6"><world name="default">
  <include><uri>model://ground_plane</uri></include>
  <physics type="ode"><max_step_size>0.001</max_step_size></physics>
  <model name="walls"><static>1</static><link name="link">%s</link></model>
</world></sdf>"""
_BOX = """<collision name="box_%d"><pose>%.4f %.4f 0.5 0 0 %.6f</pose>
  <geometry><box><size>%.4f %.4f 1</size></box></geometry></collision>"""
_PILLAR = """<collision name="pillar_%d"><pose>%.4f %.4f 0.5 0 0 0</pose>
  <geometry><cylinder><radius>%.3f</radius><length>1</length></cylinder></geometry></collision>"""
Segment = Tuple[float, float, float, float]

#: Walls of a house of 14 x 10 m, x0, y0, x1, y1 [m]: six rooms with doors of 1.4 m, a corridor, furniture.
HOUSE: Tuple[Segment, ...] = (
    (-7.0, -5.0, 7.0, -5.0), (-7.0, 5.0, 7.0, 5.0), (-7.0, -5.0, -7.0, 5.0), (7.0, -5.0, 7.0, 5.0),
    (-7.0, 1.0, -5.2, 1.0), (-3.8, 1.0, 0.7, 1.0), (2.1, 1.0, 7.0, 1.0),
    (-7.0, -1.0, -3.0, -1.0), (-1.6, -1.0, 3.5, -1.0), (4.9, -1.0, 7.0, -1.0),
    (-2.0, 1.0, -2.0, 5.0), (3.0, 1.0, 3.0, 2.4), (3.0, 3.8, 3.0, 5.0),
    (-0.5, -5.0, -0.5, -1.0), (3.0, -5.0, 3.0, -3.6), (3.0, -2.2, 3.0, -1.0),
    (-6.0, 3.6, -4.6, 3.6), (-6.0, 3.2, -4.6, 3.2), (5.2, -3.8, 5.2, -3.0))


def _box(number: int, segment: Segment) -> str:
    x0, y0, x1, y1 = segment
    length = float(np.hypot(x1 - x0, y1 - y0)) + 2.0 * HALF_OF_A_WALL
    return _BOX % (number, 0.5 * (x0 + x1), 0.5 * (y0 + y1), float(np.arctan2(y1 - y0, x1 - x0)), length,
                   2.0 * HALF_OF_A_WALL)


def house() -> str:
    """Return the text of the house's world."""
    return _WORLD % "".join(_box(number, segment) for number, segment in enumerate(HOUSE))


def pillars(apart: float = 2.2, radius: float = 0.3, side: float = 4.6) -> str:
    """Return the text of an arena like TurtleBot3's world, twice its size for m2wr: nine pillars in a hexagon.

    Parameters
    ----------
    apart : float
        Distance between pillars [m].
    radius : float
        Of a pillar [m].
    side : float
        Of the hexagon [m].
    """
    angles = np.arange(7) * np.pi / 3.0
    corners = side * np.stack([np.cos(angles), np.sin(angles)], -1)
    parts = [_box(number, (*corners[number], *corners[number + 1])) for number in range(6)]
    # one pillar stands off the grid: otherwise half a turn leads to the same view
    places = [(apart * x, apart * y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    places[7] = (places[7][0] + 0.5, places[7][1])
    parts += [_PILLAR % (number, x, y, radius) for number, (x, y) in enumerate(places)]
    return _WORLD % "".join(parts)


@dataclass(frozen=True)
class Scene:
    """A world with its true map.

    Attributes
    ----------
    name : str
    world : World
    cells : (H, W) int8
        As in an OccupancyGrid: what the robot can be in is free, the rest of the free cells unknown.
    origin : (2,) float64
        Of the corner of cell (0, 0) [m].
    """

    name: str
    world: World
    cells: Int8Array
    origin: FloatArray

    @cached_property
    def map(self) -> LocalizationMap:
        """The map as amcl has it; its distance fields are made once for all drives."""
        return LocalizationMap(self.cells, RESOLUTION, (self.origin[0], self.origin[1], 0.0))

    @cached_property
    def _places(self) -> Dict[Tuple[float, float], FloatArray]:
        return {}

    def free_places(self, room: float, passage: float) -> FloatArray:
        """Return :func:`free_places` of this map; they are computed once.

        Parameters
        ----------
        room, passage : float
            [m]
        """
        if (room, passage) not in self._places:
            self._places[room, passage] = free_places(self.cells, self.origin, room, passage)
        return self._places[room, passage]


NAMES = ("world01", "world02", "world03", "pillars", "house")


def scene(name: str, height: float = LASER_HEIGHT) -> Scene:
    """Return a scene.

    Parameters
    ----------
    name : str
        One of NAMES, or a world as :func:`m2wr_sim.api.read_world` takes it.
    height : float
        Of the laser above the floor [m]; by default that of m2wr.
    """
    text = {"pillars": pillars(), "house": house()}.get(name)
    if text is not None:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, name + ".world")
            with open(path, "w", encoding="utf-8") as stream:
                stream.write(text)
            world = read_world(path)
    else:
        world = read_world(name)
    outlines = obstacle_outlines(world, height - SLICE, height + SLICE)
    truth = costmap_of(outlines, np.zeros((1, 2)), HALF_OF_A_WALL, FRAME)
    occupied = truth.costs == LETHAL
    cells = np.where(occupied, 100, 0).astype(np.int8)
    cells[~occupied & _is_around(occupied)] = -1
    return Scene(name, world, cells, truth.origin)


def _distance(found: BoolArray) -> Float32Array:
    """Return the distance of each cell from the nearest one that was found [m]."""
    away = np.empty(found.shape, np.float32)
    distance_transform(found, float(sum(found.shape)), away)
    return away * np.float32(RESOLUTION)


def _is_around(occupied: BoolArray) -> BoolArray:
    """Return which cells are nearer to the space around the world than to that inside; gaps of walls are closed."""
    costs = np.where(_distance(occupied) <= GAP, LETHAL, 0).astype(np.uint8)
    around, _ = connected(costs, np.where(np.arange(256) == LETHAL, np.inf, 1.0).astype(np.float32), (0, 0))
    inside = (costs == 0) & (around == 0)
    return _distance(around == 1) < _distance(inside) if inside.any() else np.zeros_like(occupied)


def free_places(cells: Int8Array, origin: FloatArray, room: float, passage: float) -> FloatArray:
    """Return the centres (N, 2) of free cells among which a robot can drive: those of the largest connected part.

    Parameters
    ----------
    cells : (H, W) int8
    origin : (2,) float64
        [m]
    room : float
        Least distance from everything that is not free [m].
    passage : float
        The same on the way between them [m]; not greater.
    """
    away = _distance(cells != 0)
    costs = np.where(away > passage, 0, LETHAL).astype(np.uint8)
    table = np.where(np.arange(256) == LETHAL, np.inf, 1.0).astype(np.float32)
    left, largest = away > room, np.zeros(cells.shape, bool)
    while left.any():
        row, column = np.argwhere(left)[0]
        part = connected(costs, table, (int(row), int(column)))[0] == 1
        found = left & part
        if np.count_nonzero(found) > np.count_nonzero(largest):
            largest = found
        left &= ~part
    rows, columns = np.nonzero(largest)
    return np.stack([columns + 0.5, rows + 0.5], -1) * RESOLUTION + origin
