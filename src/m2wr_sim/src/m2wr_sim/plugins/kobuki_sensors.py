# SPDX-License-Identifier: BSD-3-Clause
"""Cliff sensors, bumpers and wheel-drop sensors of the Kobuki base."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, List, Sequence, Set, Tuple

from m2wr_sim.geometry import compose
from m2wr_sim.kobuki_messages import BumperEvent, SensorState
from m2wr_sim.plugins.base import PluginContext
from m2wr_sim.sensors.laser import LaserSensor

#: Numbers of the sensors at the front, and their bits in SensorState: the same for cliffs and bumpers.
SIDES = (BumperEvent.LEFT, BumperEvent.CENTER, BumperEvent.RIGHT)
CLIFF_BITS = (SensorState.CLIFF_LEFT, SensorState.CLIFF_CENTRE, SensorState.CLIFF_RIGHT)
_LOWEST, _HIGHEST = 0.01, 0.13          # m above the model's frame: where a contact presses the bumper
_FRONT, _LAST = math.pi / 6.0, math.pi / 2.0    # rad from straight ahead: limits of the middle bumper and of the others


class CliffSensors:
    """Three rays that look at the floor.

    Parameters
    ----------
    ctx : PluginContext
    names : list of str
        Of ray sensors of the model: left, centre, right; the first ray of each is used.
    threshold : float
        Least range of a cliff [m].

    Raises
    ------
    PluginError
        If there is no such sensor.
    ValueError
        If the ranges or angles of a sensor are invalid.
    """

    def __init__(self, ctx: PluginContext, names: Sequence[str], threshold: float) -> None:
        self._ctx, self._threshold = ctx, threshold
        self._sensors: List[Tuple[LaserSensor, Any, int]] = []
        for name in names:
            sensor, link, _ = ctx.find_sensor(name, "ray")
            ray = replace(sensor.ray, samples=1, resolution=1.0, max_angle=sensor.ray.min_angle, vertical_samples=1)
            self._sensors.append((LaserSensor(ray, ctx.rng(name)), sensor.pose, link))
        self._cliff = [False] * len(names)

    def changes(self) -> List[Tuple[int, bool, int]]:
        """Measure; return what has changed: number of the sensor, whether there is a cliff, its converter's reading."""
        found = []
        self._ctx.refresh_scene()
        for index, (laser, pose, link) in enumerate(self._sensors):
            distance = float(laser.cast(self._ctx.scene, compose(self._ctx.physics.link_pose(link), pose))[0].min())
            cliff = distance >= self._threshold
            if cliff != self._cliff[index]:
                self._cliff[index] = cliff
                # Gazebo's plugin stores 76123 atan(0.995 / range) in 16 bits
                found.append((SIDES[index], cliff, int(76123.0 * math.atan2(0.995, distance)) & 0xffff))
        return found

    def bits(self) -> int:
        """Return the cliffs as in SensorState."""
        return sum(bit for bit, cliff in zip(CLIFF_BITS, self._cliff) if cliff)

    def reset(self) -> None:
        """Forget the cliffs."""
        self._cliff = [False] * len(self._sensors)


class Contacts:
    """Contacts of the bumper and the wheels; watched only between :meth:`read` and :meth:`sleep`.

    Parameters
    ----------
    ctx : PluginContext
    bumper : str
        Name of the contact sensor of the body.
    wheels : list of str
        Names of the contact sensors of the left and the right wheel.

    Raises
    ------
    PluginError
        If there is no such sensor.
    """

    def __init__(self, ctx: PluginContext, bumper: str, wheels: Sequence[str]) -> None:
        self._physics = ctx.physics
        self._bumper, *self._wheels = [set(ctx.find_sensor(name, "contact")[2]) for name in [bumper] + list(wheels)]
        self._watch: Any = None

    def read(self, height: float, heading: float) -> Tuple[Set[int], Set[int]]:
        """Return which bumpers were pressed since the last call, and which wheels had no contact (0 left, 1 right).

        Parameters
        ----------
        height : float
            Of the model in the world [m].
        heading : float
            Of the model in the world [rad].
        """
        if self._watch is None:
            self._watch = self._physics.watch_contacts(self._bumper.union(*self._wheels))
            return set(), set()
        pressed: Set[int] = set()
        rolling: Set[str] = set()
        for pair in self._watch.drain():
            rolling.update((pair[0].first, pair[0].second))
            if pair[0].first not in self._bumper:
                continue
            for report in pair:
                if _LOWEST <= report.position[2] - height <= _HIGHEST:
                    # the normal points from the contact into the robot
                    bearing = math.remainder(math.atan2(-report.normal[1], -report.normal[0]) - heading, math.tau)
                    if abs(bearing) <= _LAST:
                        pressed.add(SIDES[1] if abs(bearing) <= _FRONT else SIDES[0 if bearing > 0.0 else 2])
        return pressed, {number for number, wheel in enumerate(self._wheels) if rolling.isdisjoint(wheel)}

    def sleep(self) -> None:
        """Stop watching."""
        if self._watch is not None:
            self._physics.end_watch(self._watch)
            self._watch = None
