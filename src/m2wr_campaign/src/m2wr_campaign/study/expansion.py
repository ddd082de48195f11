# SPDX-License-Identifier: BSD-3-Clause
"""From a study to its runs: worlds are read or generated, robots read, and all combinations made."""
from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Callable, Dict, Iterator, List, Optional, Sequence

from m2wr_campaign.study.content import content_of
from m2wr_campaign.study.factors import RunTask, StudyRobot, StudyWorld, key_of
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.worlds.generators import generate
from m2wr_navigation.compare.drive import Robot
from m2wr_navigation.compare.scenes import given
from m2wr_navigation.robot_body import body_of
from m2wr_sim.api import read_robot, read_world
from m2wr_sim.errors import SimError
from m2wr_sim.model.types import Noise

if TYPE_CHECKING:
    from m2wr_campaign.study.study_file import RobotEntry, Study, WorldEntry
    from m2wr_sim.model.types import Model

    Kept = Callable[[str], Optional[StudyWorld]]


def tasks_of(study: Study, kept: Kept = lambda recipe: None) -> Iterator[RunTask]:
    """Yield all runs: by worlds, then robots, noise, faults, methods and repeats.

    Parameters
    ----------
    study : Study
    kept : callable, optional
        Returns the world of a recipe that was generated before, or None.

    Raises
    ------
    StudyError
        If a world or robot cannot be used, or a generator finds no world in which the robots have a way.
    """
    robots = [_robot(study, entry) for entry in study.robots]
    radius = max(one.robot.body.turning_radius for one in robots)
    number = 0
    for entry in study.worlds:
        for index in range(entry.first, entry.first + entry.count):
            world = _world(study, entry, index, radius, kept)
            for robot in robots:
                for noise, fault, method, repeat in product(study.noise, study.faults, study.methods,
                                                            range(study.repeats)):
                    yield RunTask(number, world, robot, method, noise, repeat, study.seed, study.limit,
                                  study.time_limit, fault, study.patience)
                    number += 1


def all_tasks(study: Study, kept: Kept = lambda recipe: None) -> List[RunTask]:
    """Return all runs, each of which is another one.

    Parameters
    ----------
    study : Study
    kept : callable, optional
        As for :func:`tasks_of`.

    Raises
    ------
    StudyError
        As :func:`tasks_of`, and if two runs are the same.
    """
    found: Dict[str, RunTask] = {}
    for task in tasks_of(study, kept):
        other = found.setdefault(task.key, task)
        if other is not task:
            raise StudyError("{}: worlds or robots: {} with {} occurs twice; expected each once".format(
                study.file, task.world.label, task.robot.label))
    return list(found.values())


def balanced(tasks: Sequence[RunTask]) -> List[RunTask]:
    """Return runs in an order in which a part of them is a smaller study: all methods in the first world of each kind.

    The second worlds of each kind follow, and so on; further repeats come after all worlds.

    Parameters
    ----------
    tasks : sequence of RunTask
    """
    return sorted(tasks, key=lambda task: (task.repeat, task.world.number, task.number))


def recipe_of(study: Study, entry: WorldEntry, index: int, radius: float) -> str:
    """Return what makes a generated world the same: generator, parameters, seed, number, robot.

    Parameters
    ----------
    study : Study
    entry : WorldEntry
    index : int
    radius : float
        Of the disc in which the robot turns [m].
    """
    return key_of(entry.kind, entry.parameters, study.seed, index, round(radius, 6))


def _world(study: Study, entry: WorldEntry, index: int, radius: float, kept: Kept) -> StudyWorld:
    try:
        if entry.kind == "file":
            return _from_file(study, entry, radius)
        assert entry.parameters is not None
        recipe = recipe_of(study, entry, index, radius)
        known = kept(recipe)
        if known is not None:
            return known
        text, (start, goal) = generate(entry.kind, entry.parameters, study.seed, index, radius)
        values = tuple(sorted(entry.parameters.items()))
        return StudyWorld(key_of(text, start, goal), "{} {}".format(entry.kind, index), entry.kind, values, index,
                          text, text, start, goal, recipe)
    except (SimError, ValueError, OSError) as error:
        raise StudyError("{}: {}: {}".format(study.file, entry.place, error)) from None


def _from_file(study: Study, entry: WorldEntry, radius: float) -> StudyWorld:
    world = read_world(entry.file)
    if entry.start is None or entry.goal is None:
        scene = given(entry.file, study.seed, radius)
        start, goal = scene.start, scene.goal
    else:
        start = (entry.start + (0.0,))[:3]                  # type: ignore[assignment]
        goal = entry.goal                                   # type: ignore[assignment]
    label = entry.file.rsplit("/", 1)[-1]
    if label.endswith(".world"):
        label = label[:-len(".world")]
    return StudyWorld(key_of(content_of(world), start, goal), label, "file", (), 0, "", world, start, goal)


def _robot(study: Study, entry: RobotEntry) -> StudyRobot:
    try:
        model = read_robot(entry.file)
        robot = Robot(model, body_of(model), {"max_vel_x": entry.max_vel_x, "max_vel_theta": entry.max_vel_theta})
    except (SimError, ValueError, OSError) as error:
        raise StudyError("{}: {}: {}".format(study.file, entry.place, error)) from None
    label = entry.file.rsplit("/", 1)[-1]
    if len(study.robots) > 1:
        label += " {:g} m/s {:g} rad/s".format(entry.max_vel_x, entry.max_vel_theta)
    return StudyRobot(key_of(content_of(model), entry.max_vel_x, entry.max_vel_theta), label, robot)


def with_noise(model: Model, stddev: float) -> Model:
    """Return a robot whose lasers have Gaussian noise.

    Parameters
    ----------
    model : Model
    stddev : float
        Of the readings [m].
    """
    links = []
    for link in model.links:
        sensors = tuple(sensor if sensor.ray is None else replace(sensor, ray=replace(
            sensor.ray, noise=Noise("gaussian", 0.0, stddev) if stddev else Noise())) for sensor in link.sensors)
        links.append(replace(link, sensors=sensors))
    return replace(model, links=tuple(links))
