# SPDX-License-Identifier: BSD-3-Clause
"""Gymnasium environments in which a robot drives to a goal without contacts; importing this module registers all.

A step lasts 0.1 s of simulated time; then the laser and the odometry are measured.  The reward of a step is

    1.0 for each metre by which the distance to the goal has decreased
    - 0.1 for each second
    + 10 at the goal, - 10 for a contact, except with the ground

The goal or a contact terminates the episode; after its time limit it is truncated.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_sim.api.gym_base import TRIES, RobotEnv, clip, gymnasium
from m2wr_sim.api.gym_tasks import ExplorationEnv, WallFollowingEnv

if TYPE_CHECKING:
    import os

    from m2wr_sim.api.gym_base import Bounds, Observed
    from m2wr_sim.api.records import StepResult
    from m2wr_sim.model.types import Model, World

ENV_ID = "m2wr/GoToGoal-v0"
PROGRESS_REWARD, TIME_REWARD = 1.0, -0.1        # each metre nearer, each second
GOAL_REWARD, CONTACT_REWARD = 10.0, -10.0
FARTHEST = 50.0                 # m: bound of the goal in an observation
STEP = 0.02                     # s: physics step of the environments that are made by name, except for ENV_ID


class GoToGoalEnv(RobotEnv):
    """See the module docstring.

    Observation, a dictionary of float32 arrays: ``scan`` and ``velocity`` of
    :class:`~m2wr_sim.api.gym_base.RobotEnv`, and

    ============ =========== ====================================================================================
    ``goal``     (2,)        the goal in the robot's frame: x ahead, y to the left [m]
    ============ =========== ====================================================================================

    Action: (2,) float32, linear x [m/s] and angular z [rad/s]; clipped to the limits.

    ``reset`` draws start, heading and goal from the environment's generator; ``options={"start": (x, y, yaw)}`` and
    ``options={"goal": (x, y)}`` set them.  ``info`` holds ``distance`` [m], ``time`` [s], ``contacts`` and
    ``is_success``.

    Parameters
    ----------
    world, robot, duration, time_limit, beams, max_linear, max_angular, area, render_mode, **options
        As for RobotEnv.
    distance : (2,) floats
        Least and greatest distance from start to goal [m].
    goal_radius : float
        The goal is reached within this distance [m].
    start, goal : (2,) floats, optional
        x, y [m] of each start and goal, if they are not drawn; the heading is.

    Raises
    ------
    ValueError
        If the number of laser beams is no multiple of ``beams``, or an option has an unusable value.
    """

    def __init__(self, world: Union[World, str, os.PathLike[str]] = "world02",
                 robot: Union[Model, str, os.PathLike[str]] = "m2wr", duration: float = 0.1, time_limit: float = 60.0,
                 beams: int = 72, max_linear: float = 0.6, max_angular: float = 1.0,
                 area: Tuple[float, float, float, float] = (-8.0, 8.0, -8.0, 8.0),
                 distance: Tuple[float, float] = (2.0, 6.0), goal_radius: float = 0.3,
                 start: Optional[Tuple[float, float]] = None, goal: Optional[Tuple[float, float]] = None,
                 render_mode: Optional[str] = None, **options: Any) -> None:
        if not 0.0 <= goal_radius < distance[0] <= distance[1]:
            raise ValueError("goal_radius %r and distance %r; expected goal_radius < least distance <= greatest"
                             % (goal_radius, distance))
        super().__init__(world, robot, duration, time_limit, beams, max_linear, max_angular, area, render_mode,
                         **options)
        self._goal_radius, self._range = goal_radius, tuple(distance)
        self._fixed_start, self._fixed_goal = start, goal
        self._goal: Tuple[float, float] = (0.0, 0.0)
        self._distance = 0.0

    def _bounds(self) -> Bounds:
        return {"goal": ((-FARTHEST, -FARTHEST), (FARTHEST, FARTHEST))}

    def _place(self, options: Dict[str, Any]) -> Tuple[float, ...]:
        start, goal = options.get("start"), options.get("goal", self._fixed_goal)
        if start is None and self._fixed_start is not None:
            start = (*self._fixed_start, self.np_random.uniform(-math.pi, math.pi))
        start, self._goal = self._places(start, goal)
        return start

    def _places(self, start: Optional[Sequence[float]], goal: Optional[Sequence[float]],
                ) -> Tuple[Tuple[float, ...], Tuple[float, float]]:
        """Return start (x, y, yaw) and goal (x, y); those not given are drawn, away from obstacles."""
        for _ in range(TRIES):
            heading = self.np_random.uniform(-math.pi, math.pi)
            from_place = tuple(start) if start is not None else self._free_place() + (heading,)
            to_place = (goal[0], goal[1]) if goal is not None else self._free_place()
            apart = math.hypot(to_place[0] - from_place[0], to_place[1] - from_place[1])
            if (start is not None and goal is not None) or self._range[0] <= apart <= self._range[1]:
                return from_place, to_place
        raise RuntimeError("found no start and goal %g to %g m apart in %s in %d tries; give them to reset as options"
                           % (self._range[0], self._range[1], self._area, TRIES))

    def _begin(self, result: StepResult) -> None:
        self._distance = self._goal_distance(result)

    def _judge(self, result: StepResult) -> Tuple[float, bool]:
        before, self._distance = self._distance, self._goal_distance(result)
        collided, reached = bool(result.contacts), self._distance < self._goal_radius
        reward = PROGRESS_REWARD * (before - self._distance) + TIME_REWARD * self._duration
        if collided:
            reward += CONTACT_REWARD
        elif reached:
            reward += GOAL_REWARD
        return reward, collided or reached

    def _goal_distance(self, result: StepResult) -> float:
        return math.hypot(self._goal[0] - result.position[0], self._goal[1] - result.position[1])

    def _seen(self, result: StepResult) -> Observed:
        x, y, yaw = result.pose
        ahead, aside = self._goal[0] - x, self._goal[1] - y
        cosine, sine = math.cos(yaw), math.sin(yaw)
        return {"goal": np.array((clip(cosine * ahead + sine * aside, FARTHEST),
                                  clip(cosine * aside - sine * ahead, FARTHEST)), np.float32)}

    def _info(self, result: StepResult) -> Dict[str, Any]:
        contacts = len(result.contacts)
        return {"distance": self._distance, "time": result.time, "contacts": contacts,
                "is_success": self._distance < self._goal_radius and not contacts}

    def _marked(self) -> Tuple[float, float]:
        return self._goal


#: Environments by name: class, and its arguments.  ``m2wr/GoToGoal-v0`` has the physics step of its world.
_BUG2: Dict[str, Any] = dict(start=(0.0, 8.0), goal=(0.0, -4.0), time_limit=180.0, step=STEP)
ENVIRONMENTS: Dict[str, Tuple[Any, Dict[str, Any]]] = {
    ENV_ID: (GoToGoalEnv, {}),
    "m2wr/GoToGoalWorld02-v0": (GoToGoalEnv, dict(step=STEP)),
    "m2wr/Bug2World02-v0": (GoToGoalEnv, dict(_BUG2, world="world02")),
    "m2wr/Bug2World03-v0": (GoToGoalEnv, dict(_BUG2, world="world03")),
    "m2wr/MovingObstacles-v0": (GoToGoalEnv, dict(world="moving_20", step=STEP, area=(-6.0, 6.0, -6.0, 6.0))),
    "m2wr/WallFollowing-v0": (WallFollowingEnv, dict(step=STEP)),
    "m2wr/Exploration-v0": (ExplorationEnv, dict(step=STEP)),
}


def _register() -> None:
    for name, (kind, arguments) in ENVIRONMENTS.items():
        batched = "m2wr_sim.api.gym_vector:BatchedGoToGoal" if kind is GoToGoalEnv else None
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=kind, vector_entry_point=batched, kwargs=arguments)


_register()
