# SPDX-License-Identifier: BSD-3-Clause
"""A battery, and a model of what a robot takes from it."""
from __future__ import annotations

import math
from dataclasses import dataclass

GRAVITY = 9.81              # m/s^2


@dataclass(frozen=True)
class EnergyModel:
    """Electrical power of a robot: its electronics, and the work of its wheels divided by their efficiency.

    Attributes
    ----------
    electronics : float
        Computer and lasers [W]; 8 W of it is a laser of 16 layers (data sheet of the Velodyne VLP-16).
    rolling : float
        Coefficient of rolling resistance; 0.05 is usual for tyres on firm soil (Wong, Theory of Ground Vehicles).
    efficiency : float
        Of motors and gears.
    mass : float
        Of the robot [kg].
    turning : float
        Torque that turns the robot on the spot [N m].
    """

    electronics: float = 12.0
    rolling: float = 0.05
    efficiency: float = 0.6
    mass: float = 6.2
    turning: float = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError("{} is {}; expected a finite number from 0 on".format(name, value))
        if not 0.0 < self.efficiency <= 1.0:
            raise ValueError("efficiency is {:g}; expected above 0, at most 1".format(self.efficiency))

    def power(self, speed: float, climb: float = 0.0, yaw_rate: float = 0.0) -> float:
        """Return the electrical power [W]; going down gives nothing back.

        Parameters
        ----------
        speed : float
            Along the way [m/s].
        climb : float
            Vertical velocity [m/s].
        yaw_rate : float
            [rad/s]
        """
        force = self.mass * GRAVITY * self.rolling
        work = force * abs(speed) + self.mass * GRAVITY * climb + self.turning * abs(yaw_rate)
        return self.electronics + max(0.0, work) / self.efficiency

    def for_way(self, length: float, speed: float) -> float:
        """Return the energy for level ground [J].

        Parameters
        ----------
        length : float
            [m]
        speed : float
            Mean speed, stops and turns included [m/s].
        """
        return self.power(speed) * length / speed


class Battery:
    """Energy in a battery.

    Parameters
    ----------
    capacity : float
        [J]

    Attributes
    ----------
    level : float
        Energy left [J].
    used, charged : float
        Energy taken and put back so far [J].

    Raises
    ------
    ValueError
        If the capacity is not a finite number above 0.
    """

    def __init__(self, capacity: float) -> None:
        if not (math.isfinite(capacity) and capacity > 0.0):
            raise ValueError("the capacity is {} J; expected a finite number above 0".format(capacity))
        self.capacity = self.level = capacity
        self.used = self.charged = 0.0

    @property
    def share(self) -> float:
        """What is left, from 0 to 1."""
        return self.level / self.capacity

    @property
    def flat(self) -> bool:
        """Whether nothing is left."""
        return self.level <= 0.0

    def take(self, energy: float) -> None:
        """Take energy [J], at most what is left."""
        energy = min(max(0.0, energy), self.level)
        self.level -= energy
        self.used += energy

    def charge(self, energy: float) -> None:
        """Put energy in [J], at most what there is room for."""
        energy = min(max(0.0, energy), self.capacity - self.level)
        self.level += energy
        self.charged += energy
