# SPDX-License-Identifier: BSD-3-Clause
"""Records that the library returns; they do not change while the simulation continues."""
from dataclasses import dataclass, field
from typing import Any, Dict, Optional, Tuple

from m2wr_sim.geometry import yaw_of


@dataclass(frozen=True)
class Odometry:
    """What a robot's drive says of its motion, as in nav_msgs/Odometry.

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
    position: Tuple[float, float, float]
    orientation: Tuple[float, float, float, float]
    linear_x: float
    linear_y: float
    angular_z: float

    @property
    def pose(self):
        """Planar pose: x, y [m], yaw [rad]."""
        return (self.position[0], self.position[1], yaw_of(self.orientation))


@dataclass(frozen=True)
class Scan:
    """One scan of a laser.

    Attributes
    ----------
    time : float
        Simulated time of the measurement [s].
    ranges, intensities : (beams,) float32
        [m], +inf where nothing was hit, in the order of ``angles``; laser_retro of what was hit.
    angles : (beams of a row,) float64
        Direction of each beam in the laser's frame [rad].
    angle_min, angle_max, angle_increment, range_min, range_max : float
        As in sensor_msgs/LaserScan [rad, m].
    """

    time: float
    ranges: Any = field(repr=False)
    intensities: Any = field(repr=False)
    angles: Any = field(repr=False)
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
        Where, in the world [m].
    depth : float
        How deep the two overlapped [m].
    """

    time: float
    first: str
    second: str
    position: Tuple[float, float, float]
    depth: float

    def concerns(self, model):
        """Tell whether one of the two belongs to ``model``."""
        return model in (self.first.split("::")[0], self.second.split("::")[0])


@dataclass(frozen=True)
class Observation:
    """What is known of one robot after a step.

    Attributes
    ----------
    position, orientation : (3,) and (4,) tuples
        The true pose of the model's frame in the world [m]; quaternion x, y, z, w.
    odometry : Odometry or None
        The newest; None before the drive's first tick, and for a robot without one.
    scan : Scan or None
        The newest of the robot's first laser; None before the first.
    contacts : tuple of Contact
        What has begun since the step before.
    """

    position: Tuple[float, float, float]
    orientation: Tuple[float, float, float, float]
    odometry: Optional[Odometry]
    scan: Optional[Scan]
    contacts: Tuple[Contact, ...]

    @property
    def pose(self):
        """Planar pose in the world: x, y [m], yaw [rad]."""
        return (self.position[0], self.position[1], yaw_of(self.orientation))


@dataclass(frozen=True)
class StepResult:
    """What a step or a reset ends with.

    With a single robot its observation can be read straight from here: ``result.pose``, ``result.scan`` and so on;
    with several ``result["name"].pose``.

    Attributes
    ----------
    time : float
        Simulated time [s].
    robots : dict of str to Observation
        By name, in the order of spawning.
    """

    time: float
    robots: Dict[str, Observation]

    def __getitem__(self, name):
        return self.robots[name]

    def _only(self):
        if len(self.robots) != 1:
            raise AttributeError("the simulation has %d robots (%s); name one: result[NAME].pose"
                                 % (len(self.robots), ", ".join(self.robots) or "none"))
        return next(iter(self.robots.values()))

    pose = property(lambda self: self._only().pose, doc="Of the only robot, as the following.")
    position = property(lambda self: self._only().position)
    orientation = property(lambda self: self._only().orientation)
    odometry = property(lambda self: self._only().odometry)
    scan = property(lambda self: self._only().scan)
    contacts = property(lambda self: self._only().contacts)
