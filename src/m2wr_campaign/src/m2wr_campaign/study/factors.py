# SPDX-License-Identifier: BSD-3-Clause
"""Records of a study: its factors with their values, and one run of it."""
from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple, Union

if TYPE_CHECKING:
    from m2wr_campaign.study.programs import Program
    from m2wr_navigation.compare.drive import Robot
    from m2wr_sim.model.types import World

    Values = Tuple[Tuple[str, Any], ...]        # names and values, sorted

KEY_DIGITS = 16


def key_of(*parts: object) -> str:
    """Return the key of what JSON can hold: the same in every process and on every machine."""
    told = json.dumps(parts, sort_keys=True, allow_nan=False)
    return hashlib.sha256(told.encode()).hexdigest()[:KEY_DIGITS]


@dataclass(frozen=True)
class StudyWorld:
    """A world with a start and a goal.

    Attributes
    ----------
    key : str
        Of its content.
    label : str
    kind : str
        ``file``, or the name of the generator.
    parameters : tuple of (str, object)
        Of the generator.
    number : int
        Of the world among those with the same parameters.
    text : str
        SDF.
    world : World or str
        What :func:`m2wr_sim.api.read_world` takes without any file.
    start : (3,) float
        Pose of the robot [m, m, rad].
    goal : (2,) float
        [m]
    recipe : str
        Of a generated world: what it was made from.
    """

    key: str
    label: str
    kind: str
    parameters: Values
    number: int
    text: str
    world: Union[World, str]
    start: Tuple[float, float, float]
    goal: Tuple[float, float]
    recipe: str = ""


@dataclass(frozen=True)
class StudyRobot:
    """A robot.

    Attributes
    ----------
    key : str
        Of its description and limits.
    label : str
    robot : Robot
    """

    key: str
    label: str
    robot: Robot


@dataclass(frozen=True)
class StudyMethod:
    """A planner or method with parameters.

    Attributes
    ----------
    name : str
        As in ``m2wr_navigation.compare.comparison.NAMES``.
    parameters : tuple of (str, object)
        Those that differ from the defaults.
    program : Program, optional
        A ROS program under test; None: a planner or method of this workspace.
    """

    name: str
    parameters: Values = ()
    program: Optional[Program] = None

    @property
    def label(self) -> str:
        """Name and parameters."""
        return _label(self.name, self.parameters)


def _label(name: str, parameters: Values) -> str:
    return " ".join([name] + ["{}={}".format(key, _short(value)) for key, value in parameters])


def _short(value: object) -> str:
    return "{:g}".format(value) if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class StudyFault:
    """A fault with parameters.

    Attributes
    ----------
    name : str
        As in ``m2wr_campaign.faults.registry.FAULTS``.
    parameters : tuple of (str, object)
        Those that differ from the defaults.
    """

    name: str = "none"
    parameters: Values = ()

    @property
    def label(self) -> str:
        """Name and parameters, as they are stored; empty without a fault."""
        return "" if self == StudyFault() else _label(self.name, self.parameters)


@dataclass(frozen=True)
class RunTask:
    """One run, with all that a worker needs for it.

    Attributes
    ----------
    number : int
        In the order of the study, from 0.
    world : StudyWorld
    robot : StudyRobot
    method : StudyMethod
    noise : float
        Standard deviation of the laser's readings [m]; negative: as the robot's description has it.
    repeat : int
        From 0.
    study_seed : int
    limit : float
        Greatest simulated time [s].
    time_limit : float
        Greatest wall time [s].
    fault : StudyFault, optional
        Of sensors or drive.
    patience : float, optional
        Simulated time in which a robot that moves less than 1 m is stuck [s].
    """

    number: int
    world: StudyWorld
    robot: StudyRobot
    method: StudyMethod
    noise: float
    repeat: int
    study_seed: int
    limit: float
    time_limit: float
    fault: StudyFault = StudyFault()
    patience: float = math.inf

    @property
    def key(self) -> str:
        """What makes it the same run."""
        program = self.method.program
        return key_of(self.study_seed, self.world.key, self.robot.key, self.method.name, list(self.method.parameters),
                      self.noise, self.repeat, self.limit,
                      *([] if program is None else [program.digest, os.path.relpath(program.path, program.folder)]),
                      *([self.fault.label] if self.fault.label else []),
                      *(["patience", self.patience] if math.isfinite(self.patience) else []))

    @property
    def seed(self) -> int:
        """Of all its noise: of the study's seed, world, robot, noise and repeat, so that it depends on no worker.

        All methods and faults have the same: their runs are pairs, whose difference has less noise than that of other
        runs.
        """
        return int(key_of(self.study_seed, self.world.key, self.robot.key, self.noise, self.repeat)[:7], 16)

    def factors(self) -> Dict[str, Any]:
        """Return the values of all factors, as they are stored."""
        return {"world": self.world.key, "robot": self.robot.label, "method": self.method.name,
                "parameters": json.dumps(dict(self.method.parameters), sort_keys=True),
                "noise": self.noise if self.noise >= 0.0 else None, "repeat": self.repeat, "seed": self.seed,
                "fault": self.fault.label}
