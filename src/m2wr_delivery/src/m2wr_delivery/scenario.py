# SPDX-License-Identifier: BSD-3-Clause
"""A field of rough ground with walls, places and parcels, all from a seed."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, Optional, Tuple

import numpy as np

from m2wr_campaign.terrain.relief import Grid, heights_of
from m2wr_delivery.navigator import Navigator
from m2wr_delivery.parcels import Parcel, Point
from m2wr_elevation.elevation_map import ElevationMap, MapSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

RELIEFS = {"fractal": 0.03, "craters": 0.3, "rubble": 0.03}    # m
PAD, BASE_PAD, BLEND = 0.9, 2.2, 0.8        # m: level ground about a place, and about the base; ring where it ends
NEAREST, APART = 4.0, 2.5   # m: from the base to a place, between two places
BERTH, CHARGER_REACH = 1.1, 1.8             # m from the base: places of robots; where the charger charges
WALL = (0.2, 0.6)           # m: thickness and height of walls
CLEAR = 1.4                 # m from the middle of a wall's line to places
PEN = 2.4                   # m, side of the square of walls around a place that is blocked
MOST_ROBOTS, MOST_PARCELS = 8, 20
_TRIES = 2000
NAMES = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@dataclass(frozen=True)
class Wall:
    """A straight wall: its middle and length [m], its direction [rad]."""

    x: float
    y: float
    yaw: float
    length: float

    def distance(self, place: Point) -> float:
        """Return the distance of a place from the line of the wall [m]."""
        along = (place[0] - self.x) * math.cos(self.yaw) + (place[1] - self.y) * math.sin(self.yaw)
        across = (place[1] - self.y) * math.cos(self.yaw) - (place[0] - self.x) * math.sin(self.yaw)
        return math.hypot(max(0.0, abs(along) - 0.5 * self.length), across)


@dataclass(frozen=True)
class Settings:
    """What a field has; a seed gives the rest.

    Attributes
    ----------
    robots, parcels : int
    blocked : int
        Places that are walled in; each is the drop-off of one parcel.
    walls : int
        In the way.
    size : float
        Of a side [m].
    capacity : float
        Of a battery [J]; small, so that robots have to charge within minutes.
    charger : float
        Its power for each robot [W].
    radio : float
        Range [m]; robots that the base hears are told where they are, as by a differential GPS.
    limit : float
        Of the run [s].
    roughness : float
        Factor of the heights in RELIEFS.
    """

    robots: int = 3
    parcels: int = 6
    blocked: int = 1
    walls: int = 6
    size: float = 20.0
    capacity: float = 6000.0
    charger: float = 100.0
    radio: float = 7.0
    limit: float = 900.0
    roughness: float = 1.0

    def __post_init__(self) -> None:
        for name, low, high in (("robots", 1, MOST_ROBOTS), ("parcels", 1, MOST_PARCELS), ("blocked", 0, 3),
                                ("walls", 0, 30), ("size", 14.0, 60.0), ("capacity", 100.0, 1e7),
                                ("charger", 1.0, 1e5), ("radio", 0.1, 1e4), ("limit", 1.0, 1e5),
                                ("roughness", 0.0, 5.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise ValueError("{} is {:g}; expected {:g} to {:g}".format(name, value, low, high))
        if self.blocked > self.parcels:
            raise ValueError("{} places are blocked; expected at most one for each of {} parcels".format(
                self.blocked, self.parcels))

    @property
    def map(self) -> MapSettings:
        """Of the robots' elevation maps: the field is inside all the time."""
        return MapSettings(size=self.size + 2.0, cell=0.08 if self.size <= 40.0 else 0.1, radius=0.3)


@dataclass(frozen=True)
class Scenario:
    """The field.

    Attributes
    ----------
    seed : int
    settings : Settings
    grid : Grid
    heights : (samples, samples) float64
        [m]
    walls : tuple of Wall
    places : dict of str to (float, float)
        Pick-up and drop-off points by name [m]; the base is at the origin.
    parcels : tuple of Parcel
    starts : dict of str to (float, float, float)
        Of the robots: x, y [m], heading [rad].
    solvable : dict of str to bool
        Whether a traversable way leads from the base to the pick-up and on to the drop-off of a parcel.
    """

    seed: int
    settings: Settings
    grid: Grid
    heights: Values
    walls: Tuple[Wall, ...]
    places: Dict[str, Point]
    parcels: Tuple[Parcel, ...]
    starts: Dict[str, Tuple[float, float, float]]
    solvable: Dict[str, bool]

    def height_at(self, place: Point) -> float:
        """Return the height of the ground at the nearest sample [m]."""
        column, row = ((0.5 * self.grid.size + value) / self.grid.cell for value in (place[0], -place[1]))
        last = self.grid.samples - 1
        return float(self.heights[min(max(round(row), 0), last), min(max(round(column), 0), last)])

    def name_of(self, place: Point) -> str:
        """Return the name of a place."""
        return next(name for name, at in self.places.items() if at == place)


def _spot(random: np.random.Generator, half: float, taken: Dict[str, Point]) -> Point:
    """Return a place away from the base, the border and others; the best of some if there is no room."""
    best, most = (0.0, 0.0), -math.inf
    for _ in range(_TRIES):
        x, y = (float(value) for value in random.uniform(-half, half, 2))
        room = min([math.hypot(x - other[0], y - other[1]) - APART for other in taken.values()]
                   + [math.hypot(x, y) - NEAREST])
        if room > most:
            best, most = (x, y), room
        if most >= 0.0:
            break
    return best


def _place_walls(random: np.random.Generator, settings: Settings, places: Dict[str, Point]) -> Tuple[Wall, ...]:
    walls = []
    for number in range(settings.blocked):      # the first places are walled in
        x, y = places[NAMES[number]]
        for turn in range(4):
            yaw = 0.5 * math.pi * turn
            walls.append(Wall(x - 0.5 * PEN * math.sin(yaw), y + 0.5 * PEN * math.cos(yaw), yaw, PEN + WALL[0]))
    half = 0.5 * settings.size - 2.0
    for _ in range(_TRIES):
        if len(walls) >= 4 * settings.blocked + settings.walls:
            break
        x, y = random.uniform(-half, half, 2)
        wall = Wall(float(x), float(y), float(random.uniform(0.0, math.pi)), float(random.uniform(1.5, 3.5)))
        if wall.distance((0.0, 0.0)) > BASE_PAD + 0.5 \
                and all(wall.distance(place) > CLEAR for place in places.values()):
            walls.append(wall)
    return tuple(walls)


def _level(grid: Grid, heights: Values, place: Point, radius: float) -> Values:
    """Return heights that are level about a place."""
    x, y = grid.places
    away = np.hypot(x - place[0], y - place[1])
    share = np.clip((away - radius) / BLEND, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    middle = float(heights[away <= radius].mean())
    return np.asarray(middle + (heights - middle) * share)


def starts_of(robots: int) -> Dict[str, Tuple[float, float, float]]:
    """Return names and start poses of robots, in a circle about the base: x, y [m], heading [rad]."""
    angles = [2.0 * math.pi * number / robots for number in range(robots)]
    return {"robot%d" % (number + 1): (BERTH * math.cos(angle), BERTH * math.sin(angle), angle)
            for number, angle in enumerate(angles)}


def true_map(settings: MapSettings, grid: Grid, heights: Values, walls: Tuple[Wall, ...]) -> ElevationMap:
    """Return the elevation map that a robot would have that has seen everything.

    Parameters
    ----------
    settings : MapSettings
    grid : Grid
    heights : (samples, samples) float64
        [m]
    walls : tuple of Wall
    """
    found = ElevationMap(settings)
    found.move(0.0, 0.0)
    side = found.height.shape[0]
    ticks = found.corner[0] + (np.arange(side) + 0.5) * settings.cell
    x, y = np.meshgrid(ticks, ticks)
    column = np.clip(np.round((x + 0.5 * grid.size) / grid.cell), 0, grid.samples - 1).astype(int)
    row = np.clip(np.round((0.5 * grid.size - y) / grid.cell), 0, grid.samples - 1).astype(int)
    found.height[:] = np.where(np.maximum(np.abs(x), np.abs(y)) <= 0.5 * grid.size, heights[row, column], np.nan)
    for wall in walls:
        along = (x - wall.x) * math.cos(wall.yaw) + (y - wall.y) * math.sin(wall.yaw)
        across = (y - wall.y) * math.cos(wall.yaw) - (x - wall.x) * math.sin(wall.yaw)
        found.height[(np.abs(along) <= 0.5 * wall.length) & (np.abs(across) <= 0.5 * WALL[0])] += WALL[1]
    return found


def make_scenario(seed: int, settings: Optional[Settings] = None) -> Scenario:
    """Return the field of a seed.

    Parameters
    ----------
    seed : int
        From 0 on; the same seed gives the same field.
    settings : Settings, optional

    Returns
    -------
    Scenario

    Raises
    ------
    ValueError
        If the seed is below 0.
    """
    if seed < 0:
        raise ValueError("the seed is {}; expected a number from 0 on".format(seed))
    settings = settings or Settings()
    random = np.random.default_rng([seed, 7])
    grid = Grid(257, settings.size)
    heights = heights_of(grid, {name: settings.roughness * high for name, high in RELIEFS.items()}, seed)
    half = 0.5 * settings.size - 1.8
    places: Dict[str, Point] = {}
    for number in range(min(len(NAMES), settings.parcels + 2 + settings.blocked)):
        places[NAMES[number]] = _spot(random, half, places)
    heights = _level(grid, heights, (0.0, 0.0), BASE_PAD)
    for place in places.values():
        heights = _level(grid, heights, place, PAD)
    walls, free, parcels = _place_walls(random, settings, places), list(places)[settings.blocked:], []
    for number in range(settings.parcels):
        start, end = (str(name) for name in random.choice(free, 2, replace=False))
        if number >= settings.parcels - settings.blocked:
            end = NAMES[settings.parcels - 1 - number]
        parcels.append(Parcel("parcel%d" % (number + 1), places[start], places[end]))
    navigator, reference = Navigator(settings.map, 0.5 * settings.size), true_map(settings.map, grid, heights, walls)
    navigator.see(reference.layers())
    solvable = {parcel.name: not navigator.plan((0.0, 0.0), parcel.pick_up).blocked
                and not navigator.plan(parcel.pick_up, parcel.drop_off).blocked for parcel in parcels}
    return Scenario(seed, settings, grid, heights, walls, places, tuple(parcels), starts_of(settings.robots), solvable)
