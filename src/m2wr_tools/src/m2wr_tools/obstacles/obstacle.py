# SPDX-License-Identifier: BSD-3-Clause
"""Simple obstacles as SDF: boxes, cylinders, spheres and walls.

The origin of such a model is the middle of its underside; at height 0 it is on the floor.  The name of its only link
contains shape and size, so that a program can read them through Gazebo's services.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Optional, Protocol, Sequence, Tuple

from m2wr_sim.errors import ModelError

KINDS = {"box": ("length", "width", "height"), "cylinder": ("radius", "height"), "sphere": ("radius",)}
COLOURS = {"red": (0.80, 0.13, 0.13), "orange": (0.90, 0.62, 0.00), "yellow": (0.94, 0.89, 0.26),
           "green": (0.00, 0.62, 0.45), "blue": (0.00, 0.45, 0.70), "purple": (0.80, 0.47, 0.65),
           "brown": (0.55, 0.35, 0.17), "grey": (0.60, 0.60, 0.60), "black": (0.10, 0.10, 0.10),
           "white": (0.95, 0.95, 0.95)}
LARGEST = 1000.0            # m
SMALLEST = 1e-3             # m; tunnelling: thinner shapes pass through others in one step
HEAVIEST = 1e6              # kg
_LINK = "obstacle_"

_SDF = """<?xml version="1.0"?>
<sdf version="1.6">
  <model name="{name}">
    <static>{static}</static>
    <link name="{link}">
      <pose>0 0 {middle!r} 0 0 0</pose>
      <inertial>
        <mass>{mass!r}</mass>
        <inertia><ixx>{inertia[0]!r}</ixx><ixy>0</ixy><ixz>0</ixz><iyy>{inertia[1]!r}</iyy><iyz>0</iyz>\
<izz>{inertia[2]!r}</izz></inertia>
      </inertial>
      <collision name="collision">
        <geometry>{geometry}</geometry>
      </collision>
      <visual name="visual">
        <geometry>{geometry}</geometry>
        <material><ambient>{colour}</ambient><diffuse>{colour}</diffuse></material>
      </visual>
    </link>
  </model>
</sdf>
"""


@dataclass(frozen=True)
class Obstacle:
    """One body.

    Attributes
    ----------
    kind : str
        A key of ``KINDS``.
    size : tuple of float
        Dimensions listed in ``KINDS`` [m].
    mass : float or None
        [kg]; None: static.
    colour : (float, float, float)
        Red, green, blue, 0 to 1.

    Raises
    ------
    ModelError
        If there cannot be such a body.
    """

    kind: str
    size: Tuple[float, ...]
    mass: Optional[float] = None
    colour: Tuple[float, float, float] = COLOURS["orange"]

    def __post_init__(self) -> None:
        names = KINDS.get(self.kind)
        if names is None:
            raise ModelError("obstacle \"%s\" is not known; expected one of %s" % (self.kind, ", ".join(sorted(KINDS))))
        if len(self.size) != len(names):
            raise ModelError("size of a %s has %d numbers; expected %d: %s" % (
                self.kind, len(self.size), len(names), ", ".join(names)))
        for name, value in zip(names, self.size):
            if not SMALLEST <= value <= LARGEST:
                raise ModelError("%s of a %s is %g m; expected %g to %g m" % (
                    name, self.kind, value, SMALLEST, LARGEST))
        if self.mass is not None and not 0.0 < self.mass <= HEAVIEST:
            raise ModelError("mass of a %s is %g kg; expected more than 0, up to %g kg" % (
                self.kind, self.mass, HEAVIEST))

    @property
    def height(self) -> float:
        """Height of the top above the underside [m]."""
        return 2.0 * self.size[0] if self.kind == "sphere" else self.size[-1]

    @property
    def reach(self) -> float:
        """Radius of the circle around it, seen from above [m]."""
        return 0.5 * math.hypot(self.size[0], self.size[1]) if self.kind == "box" else self.size[0]

    @property
    def link(self) -> str:
        """Name of its link; :func:`read_link` gets shape and size from it."""
        return _LINK + "_".join([self.kind] + ["%.6g" % value for value in self.size])

    def sdf(self, name: str) -> str:
        """Return its description under a name that needs no escapes in XML."""
        mass = 1.0 if self.mass is None else self.mass
        return _SDF.format(name=name, static=str(self.mass is None).lower(), link=self.link, middle=0.5 * self.height,
                           mass=mass, inertia=self._inertia(mass), geometry=self._geometry(),
                           colour="%.3f %.3f %.3f 1" % self.colour)

    def _inertia(self, mass: float) -> Tuple[float, float, float]:
        """Return the principal moments of inertia of a body of uniform density [kg m^2]."""
        if self.kind == "box":
            x, y, z = (value * value for value in self.size)
            return mass * (y + z) / 12.0, mass * (x + z) / 12.0, mass * (x + y) / 12.0
        radius = self.size[0] ** 2
        if self.kind == "sphere":
            return (0.4 * mass * radius,) * 3
        across = mass * (3.0 * radius + self.size[1] ** 2) / 12.0
        return across, across, 0.5 * mass * radius

    def _geometry(self) -> str:
        if self.kind == "box":
            return "<box><size>%r %r %r</size></box>" % self.size
        if self.kind == "sphere":
            return "<sphere><radius>%r</radius></sphere>" % self.size
        return "<cylinder><radius>%r</radius><length>%r</length></cylinder>" % self.size


class RandomNumbers(Protocol):
    """The methods of ``numpy.random.Generator`` that are used here; numpy is not imported, to start quickly."""

    def integers(self, low: int) -> Any:
        """Return a whole number of at least 0 and less than ``low``."""

    def uniform(self, low: Sequence[float], high: Sequence[float]) -> Any:
        """Return numbers between ``low`` and ``high``.

        Parameters
        ----------
        low, high : sequence of float
            Limits.

        Returns
        -------
        array of float64
        """


def read_link(name: str) -> Optional[Tuple[str, Tuple[float, ...]]]:
    """Return ``(kind, size)`` of an obstacle from the name of its link; None if it is not a name of this module."""
    if not name.startswith(_LINK):
        return None
    kind, *numbers = name[len(_LINK):].split("_")
    try:
        found = Obstacle(kind, tuple(float(number) for number in numbers))
    except (ModelError, ValueError):
        return None
    return found.kind, found.size


def wall(start: Sequence[float], end: Sequence[float], thickness: float = 0.1,
         height: float = 0.6) -> Tuple[Tuple[float, float, float], Tuple[float, float], float]:
    """Return the size of the box that is a wall between two points, its middle and its heading.

    Parameters
    ----------
    start, end : (float, float)
        x, y of the two ends of its middle line [m].
    thickness, height : float
        [m]

    Returns
    -------
    (float, float, float), (float, float), float
        Size [m], x and y [m], heading [rad].
    """
    across, along = end[1] - start[1], end[0] - start[0]
    return ((math.hypot(along, across), thickness, height),
            (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])), math.atan2(across, along))


def read_colour(text: str) -> Tuple[float, float, float]:
    """Return (red, green, blue), 0 to 1, of a name of ``COLOURS`` or ``#rrggbb``; ModelError for anything else."""
    if text in COLOURS:
        return COLOURS[text]
    if len(text) == 7 and text[0] == "#":
        try:
            red, green, blue = (int(text[place:place + 2], 16) / 255.0 for place in (1, 3, 5))
            return red, green, blue
        except ValueError:
            pass        # reported below
    raise ModelError("colour \"%s\" is not known; expected #rrggbb or one of %s" % (text, ", ".join(sorted(COLOURS))))


def draw(generator: RandomNumbers) -> Obstacle:
    """Return a random obstacle of a size that a robot has to drive around; ``generator`` is numpy's."""
    kind = sorted(KINDS)[int(generator.integers(len(KINDS)))]
    width, depth, height = (round(float(value), 2) for value in generator.uniform((0.2, 0.2, 0.3), (0.6, 0.6, 0.8)))
    colour = sorted(COLOURS)[int(generator.integers(len(COLOURS)))]
    sizes = {"box": (width, depth, height), "cylinder": (round(0.5 * width, 2), height),
             "sphere": (round(0.1 + 0.25 * depth, 2),)}
    return Obstacle(kind, sizes[kind], colour=COLOURS[colour])
