# SPDX-License-Identifier: BSD-3-Clause
"""Records that the library returns; they do not change while the simulation continues."""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Dict, Optional, Tuple

from m2wr_sim.geometry import Quaternion, Vector, yaw_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Odometry:
    """Motion of a robot as measured by its drive, as in nav_msgs/Odometry.

    Attributes
    ----------
    time : float
        Simulated time of the measurement [s].
    position, orientation : (3,) and (4,) tuples
        Of the robot's frame in the odometry frame [m]; quaternion x, y, z, w.
    linear_x, linear_y, angular_z : float
        In the robot's frame [m/s, rad/s], positive forward, to the left, counter-clockwise.
    """

    time: float
    position: Vector
    orientation: Quaternion
    linear_x: float
    linear_y: float
    angular_z: float

    @property
    def pose(self) -> Tuple[float, float, float]:
        """Planar pose: x, y [m], yaw [rad]."""
        return (self.position[0], self.position[1], yaw_of(self.orientation))


@dataclass(frozen=True)
class Picture:
    """One picture of a camera.

    Attributes
    ----------
    time : float
        Simulated time of the picture [s].
    colour : (height, width, 3) uint8
        Red, green, blue.
    depth : (height, width) float32
        Distance along the optical axis [m]; inf where nothing is seen.
    focal : float
        Focal length [px]; the optical axis is at pixel (width - 1) / 2, (height - 1) / 2.
    """

    time: float
    colour: NDArray[np.uint8] = field(repr=False)
    depth: NDArray[np.float32] = field(repr=False)
    focal: float


@dataclass(frozen=True)
class Scan:
    """One scan of a laser.

    Attributes
    ----------
    time : float
        Simulated time of the measurement [s].
    ranges, intensities : (beams,) float32
        Range [m], +inf for no hit, and laser_retro of the shape that was hit, in the order of ``angles``.
    angles : (beams of a row,) float64
        Direction of each beam in the laser's frame [rad].
    angle_min, angle_max, angle_increment, range_min, range_max : float
        As in sensor_msgs/LaserScan [rad, m].
    """

    time: float
    ranges: NDArray[np.float32] = field(repr=False)
    intensities: NDArray[np.float32] = field(repr=False)
    angles: NDArray[np.float64] = field(repr=False)
    angle_min: float
    angle_max: float
    angle_increment: float
    range_min: float
    range_max: float


@dataclass(frozen=True)
class Contact:
    """The beginning of a contact other than standing on the ground.

    Attributes
    ----------
    time : float
        Simulated time [s].
    first, second : str
        The two collisions: ``model::link::collision``.
    position : (3,) tuple
        In the world [m].
    depth : float
        Penetration depth [m].
    """

    time: float
    first: str
    second: str
    position: Vector
    depth: float

    def concerns(self, model: str) -> bool:
        """Return whether one of the two collisions belongs to ``model``."""
        return model in (self.first.split("::")[0], self.second.split("::")[0])


@dataclass(frozen=True)
class Observation:
    """State and measurements of one robot after a step.

    Attributes
    ----------
    position, orientation : (3,) and (4,) tuples
        The true pose of the model's frame in the world [m]; quaternion x, y, z, w.
    odometry : Odometry or None
        The newest; None before the drive's first tick, and for a robot without one.
    scan : Scan or None
        The newest of the robot's first laser; None before the first.
    contacts : tuple of Contact
        Contacts that began since the previous step.
    """

    position: Vector
    orientation: Quaternion
    odometry: Optional[Odometry]
    scan: Optional[Scan]
    contacts: Tuple[Contact, ...]

    @cached_property
    def pose(self) -> Tuple[float, float, float]:
        """Planar pose in the world: x, y [m], yaw [rad]."""
        return (self.position[0], self.position[1], yaw_of(self.orientation))


@dataclass(frozen=True)
class StepResult:
    """Result of a step or a reset.

    With a single robot its observation can be read directly: ``result.pose``, ``result.scan`` and so on; with several
    robots ``result["name"].pose``.

    Attributes
    ----------
    time : float
        Simulated time [s].
    robots : dict of str to Observation
        By name, in the order of spawning.
    """

    time: float
    robots: Dict[str, Observation]

    def __getitem__(self, name: str) -> Observation:
        return self.robots[name]

    def _only(self) -> Observation:
        if len(self.robots) != 1:
            raise AttributeError("the simulation has %d robots (%s); name one: result[NAME].pose"
                                 % (len(self.robots), ", ".join(self.robots) or "none"))
        return next(iter(self.robots.values()))

    @property
    def pose(self) -> Tuple[float, float, float]:
        """Planar pose of the only robot in the world: x, y [m], yaw [rad]."""
        return self._only().pose

    @property
    def position(self) -> Vector:
        """Position of the only robot in the world [m]."""
        return self._only().position

    @property
    def orientation(self) -> Quaternion:
        """Orientation of the only robot in the world, quaternion x, y, z, w."""
        return self._only().orientation

    @property
    def odometry(self) -> Optional[Odometry]:
        """Newest odometry of the only robot."""
        return self._only().odometry

    @property
    def scan(self) -> Optional[Scan]:
        """Newest scan of the only robot."""
        return self._only().scan

    @property
    def contacts(self) -> Tuple[Contact, ...]:
        """Contacts of the only robot that began since the previous step."""
        return self._only().contacts
