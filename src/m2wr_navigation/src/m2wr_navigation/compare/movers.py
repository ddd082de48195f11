# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles that move along way points: which ones a world has, their paths, and their distance from a robot."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, List, Sequence, Tuple

import numpy as np

from m2wr_sim.control.pose_track import PoseScript, PoseTrack
from m2wr_sim.geometry import compose, yaw_of
from m2wr_sim.model.outlines import outlines_of
from m2wr_view.outlines import Outline, least_clearance

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_sim.api import Contact, Sim
    from m2wr_sim.model.types import Model, World

NEAR = 3.0                  # m from the robot's origin: the distance of farther ones is not measured
APART = 0.2                 # s between two points of a drawn path
LONGEST = 600.0             # s of a drawn path
MEETING = 1.0               # s: who was apart for longer meets again


@dataclass(frozen=True)
class Mover:
    """An obstacle that moves.

    Attributes
    ----------
    name : str
        Of its model.
    outlines : tuple of Outline
        In the plane of its model frame.
    path : (N, 2) float64
        Where its model frame moves in one cycle [m]; the first point is where it begins.
    """

    name: str
    outlines: Tuple[Outline, ...]
    path: FloatArray


def movers_of(world: World, low: float, high: float) -> List[Mover]:
    """Return the actors of a world that move.

    Parameters
    ----------
    world : World
    low, high : float
        Heights of a robot [m]: what of an actor is lower or higher does not count.
    """
    return [Mover(model.name, tuple(_outlines(model, low, high)), _path(model)) for model in world.models
            if model.script is not None and model.script.trajectories and model.script.auto_start]


def _planar(outline: Outline, x: float, y: float, yaw: float) -> Outline:
    """Return an outline of a frame in the frame around it, where the former is at a place with a heading."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turned = outline.vertices @ np.array([(cosine, sine), (-sine, cosine)])
    return Outline(turned + (x, y), outline.radius, outline.name)


def _outlines(model: Model, low: float, high: float) -> List[Outline]:
    (x, y, _), orientation = model.pose
    yaw = yaw_of(orientation)
    found = []
    for link in model.links:
        for collision in link.collisions:
            pose = compose(model.pose, compose(link.pose, collision.pose))
            for outline in outlines_of(collision.geometry, pose, low, high, model.name):
                shifted = Outline(outline.vertices - (x, y), outline.radius, outline.name)
                found.append(_planar(shifted, 0.0, 0.0, -yaw))
    return found


def _path(model: Model) -> FloatArray:
    assert model.script is not None
    script = PoseScript([PoseTrack(part.times, part.poses, part.tension) for part in model.script.trajectories])
    times = np.arange(0.0, min(script.length, LONGEST) + APART, APART)
    return np.array([script.at(min(time, script.length))[0][:2] for time in times.tolist()])


class Watch:
    """Measures how near moving obstacles come to a robot in a simulation, and who closed the gap where they meet.

    Parameters
    ----------
    movers : sequence of Mover
    footprint : sequence of Outline
        Of the robot, in its frame.

    Attributes
    ----------
    least : float
        Least distance so far [m]; infinite if none came near.
    met : int
        Meetings: contacts with an obstacle that moves, of which those in less than MEETING count once.
    struck : int
        Of the meetings, those in which the obstacle approached the robot at least as fast as the robot approached it.
        What moves reacts to nothing, so a robot that stands, or that flees too slowly, cannot avoid them.
    """

    def __init__(self, movers: Sequence[Mover], footprint: Sequence[Outline]) -> None:
        self._movers, self._footprint, self.least, self.met, self.struck = movers, footprint, math.inf, 0, 0
        self._last: Dict[str, float] = {}                       # time of the last contact with a mover [s]
        self._places: Dict[str, Tuple[float, float]] = {}       # of movers, at the look before
        self._pose: FloatArray = np.zeros(3)                    # of the robot, then
        self._twist: FloatArray = np.zeros(3)                   # of the robot until then [m/s, m/s, rad/s]
        self._time = math.nan

    def look(self, sim: Sim, pose: Tuple[float, float, float], contacts: Sequence[Contact] = ()) -> None:
        """Measure now.

        Parameters
        ----------
        sim : Sim
        pose : (float, float, float)
            Of the robot [m, m, rad].
        contacts : sequence of Contact, optional
            Of the robot, that have begun since the look before.
        """
        if not self._movers:
            return
        near: List[Outline] = []
        places: Dict[str, Tuple[float, float]] = {}
        for mover in self._movers:
            model = sim.simulator.models[mover.name]
            (x, y, _), orientation = model.pose(sim.simulator.engine)
            places[mover.name] = x, y
            if math.hypot(x - pose[0], y - pose[1]) < NEAR:
                yaw = yaw_of(orientation)
                near += [_planar(outline, x, y, yaw) for outline in mover.outlines]
        if near:
            self.least = min(self.least, least_clearance(np.array([pose]), near, self._footprint).distance)
        passed = sim.time - self._time
        for contact in contacts:
            for name in {contact.first.split("::")[0], contact.second.split("::")[0]} & places.keys():
                if sim.time - self._last.get(name, -math.inf) > MEETING:
                    self.met += 1
                    self.struck += passed > 0.0 and self._is_struck(contact, name, places[name], passed)
                self._last[name] = sim.time
        if passed > 0.0:        # no: it is the first look
            moved = np.subtract(pose, self._pose)
            self._twist = np.append(moved[:2], math.remainder(moved[2], 2.0 * math.pi)) / passed
        self._places, self._pose, self._time = places, np.array(pose, float), sim.time

    def _is_struck(self, contact: Contact, name: str, place: Tuple[float, float], passed: float) -> bool:
        """Return whether a mover closed the gap at least as fast as the robot, by the velocities before they met."""
        point = np.array(contact.position[:2])
        towards = np.subtract(place, point)
        towards /= max(float(np.hypot(*towards)), 1e-9)
        arm = point - self._pose[:2]
        robot = self._twist[:2] + self._twist[2] * np.array([-arm[1], arm[0]])
        mover = np.subtract(place, self._places.get(name, place)) / passed
        return float(-mover @ towards) >= float(robot @ towards)


def least_start_distance(movers: Sequence[Mover], points: FloatArray) -> FloatArray:
    """Return how far points (N, 2) are from where the movers begin (N,) [m]; infinite without movers.

    Parameters
    ----------
    movers : sequence of Mover
    points : (N, 2) float64
        [m]
    """
    gaps = [np.hypot(*(points - mover.path[0]).T) for mover in movers]
    return np.min(gaps + [np.full(len(points), np.inf)], axis=0)
