# SPDX-License-Identifier: BSD-3-Clause
"""The robot that is driven to random goals."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Mapping, Union

from m2wr_navigation.accuracy.scenes import LASER_HEIGHT
from m2wr_navigation.methods.body import M2WR
from m2wr_navigation.robot_body import body_of, laser_height
from m2wr_sim.api import read_robot

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_sim.model.types import Model

ROOM = 0.25                 # m around the disc in which the robot turns, at starts and goals
PASSAGE = 0.05              # m around that disc on the way: one cell of the map


@dataclass(frozen=True)
class Driven:
    """A robot with a differential drive and a laser.

    Attributes
    ----------
    model : Model or str
        As :class:`m2wr_sim.api.Sim` takes it.
    body : RobotBody
    height : float
        Of the laser above the floor [m].
    """

    model: Union[Model, str]
    body: RobotBody
    height: float

    @property
    def room(self) -> float:
        """Least distance of starts and goals from obstacles [m]."""
        return self.body.turning_radius + ROOM

    @property
    def passage(self) -> float:
        """Least distance from obstacles on some way between them [m]."""
        return self.body.turning_radius + PASSAGE

    def parameters(self, given: Mapping[str, Any]) -> Dict[str, Any]:
        """Return parameters of move_base with the footprint of this robot.

        Parameters
        ----------
        given : mapping of str to object
        """
        return dict(given, footprint=self.body.hull.tolist())


#: The robot of m2wr_description.
M2WR_DRIVEN = Driven("m2wr", M2WR, LASER_HEIGHT)


def driven(robot: str) -> Driven:
    """Return a robot by its name or file.

    Parameters
    ----------
    robot : str
        As :func:`m2wr_sim.api.read_robot` takes it.

    Raises
    ------
    SimError
        If it cannot be read.
    ValueError
        If it has no laser, or no shape that collides.
    """
    if robot == M2WR_DRIVEN.model:
        return M2WR_DRIVEN
    model = read_robot(robot)
    return Driven(model, body_of(model), laser_height(model))
