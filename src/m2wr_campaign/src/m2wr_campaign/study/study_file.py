# SPDX-License-Identifier: BSD-3-Clause
"""Reads a study from its file: factors with their values, checked before anything is computed."""
from __future__ import annotations

import itertools
import math
import os
from dataclasses import dataclass, replace
from typing import Any, Dict, List, Mapping, Optional, Tuple

from m2wr_campaign.faults.registry import FAULTS
from m2wr_campaign.study.factors import StudyFault, StudyMethod
from m2wr_campaign.study.fields import Fields, StudyError, load
from m2wr_campaign.study.programs import ProgramError, read_program
from m2wr_campaign.study.python_file import run_python
from m2wr_campaign.worlds.generators import GENERATORS
from m2wr_navigation import registry
from m2wr_navigation.compare.comparison import NAMES
from m2wr_navigation.parameters import Parameter, converted, expected_of

MOST_RUNS = 1_000_000
MOST_WORLDS = 10_000            # of one entry
FARTHEST = 1e4                  # m: of a start or goal
AS_DESCRIBED = -1.0             # noise of the robot's description


@dataclass(frozen=True)
class WorldEntry:
    """An entry of ``worlds``: one file, or generated ones with the same parameters.

    Attributes
    ----------
    kind : str
        ``file``, or the name of the generator.
    file : str
        Name or path of the world.
    start, goal : tuple of float, optional
        Of a file [m, m, rad] and [m]; None: drawn.
    parameters : dict of str to object
        Value of every parameter of the generator.
    count, first : int
        How many, and the number of the first.
    place : str
        In the study file, for messages.
    """

    kind: str
    file: str = ""
    start: Optional[Tuple[float, ...]] = None
    goal: Optional[Tuple[float, ...]] = None
    parameters: Optional[Dict[str, Any]] = None
    count: int = 1
    first: int = 0
    place: str = ""


@dataclass(frozen=True)
class RobotEntry:
    """An entry of ``robots``.

    Attributes
    ----------
    file : str
        As :func:`m2wr_sim.api.read_robot` takes it.
    max_vel_x, max_vel_theta : float
        Greatest speeds [m/s, rad/s].
    place : str
        In the study file, for messages.
    """

    file: str
    max_vel_x: float
    max_vel_theta: float
    place: str


@dataclass(frozen=True)
class Study:
    """A study as its file says it.

    Attributes
    ----------
    name : str
    file : str
        For messages.
    seed : int
    repeats : int
        Runs with the same values of all factors, with other noise.
    limit, time_limit : float
        Greatest simulated time and wall time of a run [s].
    worlds : tuple of WorldEntry
    robots : tuple of RobotEntry
    methods : tuple of StudyMethod
    noise : tuple of float
        Standard deviations of the laser's readings [m].
    faults : tuple of StudyFault
    patience : float
        Simulated time in which a robot that moves less than 1 m is stuck [s]; infinite: only methods give up.
    """

    name: str
    file: str
    seed: int
    repeats: int
    limit: float
    time_limit: float
    worlds: Tuple[WorldEntry, ...]
    robots: Tuple[RobotEntry, ...]
    methods: Tuple[StudyMethod, ...]
    noise: Tuple[float, ...]
    faults: Tuple[StudyFault, ...] = (StudyFault(),)
    patience: float = math.inf

    @property
    def count(self) -> int:
        """Number of runs."""
        return sum(entry.count for entry in self.worlds) * len(self.robots) * len(self.methods) * len(self.noise) \
            * len(self.faults) * self.repeats


def read_study(path: str, methods: Optional[Tuple[StudyMethod, ...]] = None) -> Study:
    """Read a study file.

    Parameters
    ----------
    path : str
        YAML, or a Python program (``.py``) that sets STUDY to the same mapping.
    methods : tuple of StudyMethod, optional
        Of an examination, whose file has none.

    Returns
    -------
    Study

    Raises
    ------
    StudyError
        In one sentence with file, key, what was read and what was expected.
    """
    fields = Fields(run_python(path), os.path.basename(path), "") if path.endswith(".py") else load(path)
    folder = os.path.dirname(os.path.abspath(path))
    noise = fields.entries("noise", [AS_DESCRIBED])
    if "noise" in fields:
        for value in noise:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1.0:
                raise StudyError(fields.problem("noise", value, "numbers from 0 to 1 m"))
    study = Study(
        fields.text("study"), fields.file, fields.whole("seed", 0, 2**31 - 1, 0), fields.whole("repeats", 1, 10_000, 1),
        fields.number("limit", 1.0, 1e5, 600.0, "s"), fields.number("time_limit", 1.0, 1e5, 900.0, "s"),
        tuple(entry for k, value in enumerate(fields.entries("worlds", expected="a list of worlds"))
              for entry in _worlds(fields.entry("worlds", k, value), folder)),
        tuple(_robot(fields, k, value, folder) for k, value in enumerate(fields.entries("robots", ["m2wr"]))),
        _methods(fields, folder) if methods is None else methods, tuple(map(float, noise)), _faults(fields),
        fields.number("patience", 1.0, 1e5, unit="s") if "patience" in fields else math.inf)
    fields.end()
    for method in study.methods:
        if method.program is not None and study.faults != (StudyFault(),):
            raise StudyError("{}: faults act on methods of this workspace, not on the program {}; expected studies of "
                             "their own".format(fields.file, method.label))
    if study.count > MOST_RUNS:
        raise StudyError("{}: {} runs; expected at most {}".format(fields.file, study.count, MOST_RUNS))
    return study


def _beside(name: str, folder: str) -> str:
    """Return the path of a file that is named from the folder of the study; other names as they are."""
    path = os.path.join(folder, name)
    return path if os.path.isfile(path) else name


def _worlds(fields: Fields, folder: str) -> List[WorldEntry]:
    if "generator" not in fields:
        entry = WorldEntry(
            "file", _beside(fields.text("file"), folder),
            fields.numbers("start", (2, 3), FARTHEST) if "start" in fields else None,
            fields.numbers("goal", (2,), FARTHEST) if "goal" in fields else None, place=fields.place)
        if (entry.start is None) != (entry.goal is None):
            missing = "goal" if entry.goal is None else "start"
            raise StudyError(fields.problem(missing, None, "both start and goal, or none"))
        fields.end()
        return [entry]
    kind = fields.text("generator", choices=sorted(GENERATORS))
    count, first = fields.whole("count", 1, MOST_WORLDS, 1), fields.whole("first", 0, 10**9, 0)
    levels = _levels(fields.below("parameters"), GENERATORS[kind].parameters)
    fields.end()
    return [WorldEntry(kind, parameters=values, count=count, first=first, place=fields.place) for values in
            ({name: dict(chosen).get(name, parameter.default)
              for name, parameter in GENERATORS[kind].parameters.items()} for chosen in levels)]


def _levels(fields: Fields, table: Mapping[str, Parameter]) -> List[Tuple[Tuple[str, Any], ...]]:
    """Return all combinations of the values that are given for parameters; one combination if there are none."""
    axes = []
    for name in sorted(fields.keys()):
        if name not in table:
            raise StudyError("{}: {}.{} is not known; known are {}".format(
                fields.file, fields.place, name, ", ".join(sorted(table)) or "no parameters"))
        values = fields.entries(name)
        if isinstance(table[name].default, list):
            raise StudyError(fields.problem(name, values, "no list of names: it cannot be a factor"))
        axes.append([(name, _converted(fields, name, value, table[name])) for value in values])
    return list(itertools.product(*axes))


def _converted(fields: Fields, name: str, value: object, parameter: Parameter) -> Any:
    found = converted(parameter, value)
    same = found is not None and (isinstance(found, str) or abs(float(found) - float(value)) <= 1e-9)  # type: ignore
    if not same:                # clipped and rounded values are errors here: a factor must be what it says
        raise StudyError(fields.problem(name, value, expected_of(parameter)))
    return found


def _robot(fields: Fields, index: int, value: object, folder: str) -> RobotEntry:
    inner = fields.entry("robots", index, {"file": value} if isinstance(value, str) else value)
    entry = RobotEntry(_beside(inner.text("file"), folder), inner.number("max_vel_x", 0.05, 5.0, 0.5, "m/s"),
                       inner.number("max_vel_theta", 0.1, 10.0, 1.0, "rad/s"), inner.place)
    inner.end()
    return entry


def _faults(fields: Fields) -> Tuple[StudyFault, ...]:
    found: List[StudyFault] = []
    for k, value in enumerate(fields.entries("faults", ["none"])):
        inner = fields.entry("faults", k, {"name": value} if isinstance(value, str) else value)
        name = inner.text("name", choices=list(FAULTS))
        found += [StudyFault(name, chosen) for chosen in _levels(inner.below("parameters"), FAULTS[name].PARAMETERS)]
        inner.end()
    for k, fault in enumerate(found):
        if fault in found[:k]:
            raise StudyError(fields.problem("faults", fault.label or fault.name, "each fault once"))
    return tuple(found)


def _methods(fields: Fields, folder: str) -> Tuple[StudyMethod, ...]:
    found: List[StudyMethod] = []
    for k, value in enumerate(fields.entries("methods", expected="a list of methods")):
        if value == "all":
            found += [StudyMethod(name) for name in NAMES]
            continue
        inner = fields.entry("methods", k, {"name": value} if isinstance(value, str) else value)
        if "launch" in inner:
            found += _programs(inner, folder)
            continue
        name = inner.text("name", choices=list(NAMES) + ["all"])
        table = registry.METHODS if name in registry.METHODS else registry.PLANNERS
        found += [StudyMethod(name, chosen)
                  for chosen in _levels(inner.below("parameters"), registry.find(table, name).PARAMETERS)]
        inner.end()
    for k, method in enumerate(found):
        if method in found[:k]:
            raise StudyError(fields.problem("methods", method.label, "each method once"))
    return tuple(found)


def _programs(fields: Fields, folder: str) -> List[StudyMethod]:
    """Return a ROS program as methods, one for each combination of its arguments."""
    path = fields.text("launch")
    arguments, axes = fields.below("arguments"), []
    for name in sorted(arguments.keys()):
        values = arguments.entries(name)
        if not all(isinstance(value, (str, int, float)) for value in values):
            raise StudyError(arguments.problem(name, values, "texts, numbers, true or false"))
        axes.append([(name, value) for value in values])
    try:
        made = read_program(os.path.join(folder, path))
    except (ProgramError, OSError) as error:
        raise StudyError(fields.problem("launch", path, str(error))) from None
    label = fields.text("name", os.path.basename(made.folder))
    fields.end()
    if label in NAMES:
        raise StudyError(fields.problem("name", label, "a name that no planner or method of this workspace has"))
    return [StudyMethod(label, chosen, replace(made, arguments=tuple((name, _as_argument(value))
                                                                     for name, value in chosen)))
            for chosen in itertools.product(*axes)]


def _as_argument(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
