# SPDX-License-Identifier: BSD-3-Clause
"""``m2wr/GoToGoal-v0``: a Gymnasium environment in which a robot drives to a goal without contacts.

Importing this module registers it.  It needs the Python package gymnasium, which nothing else here does.

A step lasts 0.1 s of simulated time; then the laser and the odometry are measured.  The reward of a step is

    1.0 for each metre by which the distance to the goal has decreased
    - 0.1 for each second
    + 10 at the goal, - 10 for a contact, except with the ground

The goal or a contact terminates the episode; after 60 s it is truncated.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_sim.api.sim import Sim

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise ImportError("m2wr_sim.api.gym_env needs the Python package gymnasium, 1.0 or newer, which is not installed "
                      "(%s)" % error) from error

if TYPE_CHECKING:
    import os

    import numpy.typing as npt
    from numpy.typing import NDArray

    from m2wr_sim.api.gym_picture import EnvPicture
    from m2wr_sim.api.records import StepResult
    from m2wr_sim.model.types import Model, World

    Observed = Dict[str, NDArray[np.float32]]

ENV_ID = "m2wr/GoToGoal-v0"
PROGRESS_REWARD, TIME_REWARD = 1.0, -0.1        # each metre nearer, each second
GOAL_REWARD, CONTACT_REWARD = 10.0, -10.0
_CLEARANCE = 0.7                # m from the start and the goal to the nearest obstacle: m2wr turns within 0.45 m
_TRIES = 1000
_FARTHEST = 50.0                # m: bound of the goal in an observation


class GoToGoalEnv(gymnasium.Env):
    """See the module docstring.

    Observation, a dictionary of float32 arrays:

    ============ =========== ====================================================================================
    ``scan``     (beams,)    least range of each group of neighbouring beams [m], the longest range for no hit
    ``goal``     (2,)        the goal in the robot's frame: x ahead, y to the left [m]
    ``velocity`` (2,)        linear x [m/s], angular z [rad/s] by odometry
    ============ =========== ====================================================================================

    Action: (2,) float32, linear x [m/s] and angular z [rad/s]; clipped to the limits.

    ``reset`` draws start, heading and goal from the environment's generator; ``options={"start": (x, y, yaw)}`` and
    ``options={"goal": (x, y)}`` set them.  ``info`` holds ``distance`` [m], ``time`` [s], ``contacts`` and
    ``is_success``.

    Parameters
    ----------
    world, robot
        As for :class:`~m2wr_sim.api.sim.Sim`; the robot needs a drive and a laser of one row.
    duration : float
        Of a step [s].
    time_limit : float
        Of an episode [s].
    beams : int
        Size of ``scan``; must divide the laser's number of beams.
    max_linear, max_angular : float
        Limits of the action [m/s, rad/s].
    area : (4,) floats
        Bounds of start and goal: x min, x max, y min, y max [m].
    distance : (2,) floats
        Least and greatest distance from start to goal [m].
    goal_radius : float
        The goal is reached within this distance [m].
    render_mode : str, optional
        ``rgb_array``: :meth:`render` returns an image from above, (800, 800, 3) uint8.
    **options
        The other options of Sim.

    Raises
    ------
    ValueError
        If the number of laser beams is no multiple of ``beams``, or an option has an unusable value.
    """

    metadata: Dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, world: Union[World, str, os.PathLike[str]] = "world02",
                 robot: Union[Model, str, os.PathLike[str]] = "m2wr", duration: float = 0.1, time_limit: float = 60.0,
                 beams: int = 72, max_linear: float = 0.6, max_angular: float = 1.0,
                 area: Tuple[float, float, float, float] = (-8.0, 8.0, -8.0, 8.0),
                 distance: Tuple[float, float] = (2.0, 6.0), goal_radius: float = 0.3,
                 render_mode: Optional[str] = None, **options: Any) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError("render_mode %r; expected None or one of %s" % (
                render_mode, ", ".join(self.metadata["render_modes"])))
        if not 0.0 <= goal_radius < distance[0] <= distance[1]:
            raise ValueError("goal_radius %r and distance %r; expected goal_radius < least distance <= greatest"
                             % (goal_radius, distance))
        self.render_mode = render_mode
        self._picture: Optional[EnvPicture] = None
        self._sim = Sim(world, robot, sensing="now", **options)
        try:
            laser = self._sim.lasers()[0] if self._sim.lasers() else None
            if laser is None or beams < 1 or laser.count % beams:
                raise ValueError("beams %r; expected a divisor of the laser's %d readings"
                                 % (beams, 0 if laser is None else laser.count))
            self._sim.drive()               # NotFoundError if there is none
        except Exception:
            self._sim.close()
            raise
        self._name, self._beams = self._sim.robots[0], int(beams)
        self._duration, self._time_limit, self._goal_radius = duration, time_limit, goal_radius
        self._area, self._range = tuple(area), tuple(distance)
        self._goal: Tuple[float, float] = (0.0, 0.0)
        self._distance = 0.0
        limits = np.array([max_linear, max_angular], np.float32)
        self.action_space = spaces.Box(-limits, limits, dtype=np.float32)
        self._bounds: Dict[str, Tuple[npt.ArrayLike, npt.ArrayLike]] = {
            "scan": (0.0, laser.range_max), "goal": (-_FARTHEST, _FARTHEST),
            "velocity": (-10.0 * limits, 10.0 * limits)}
        sizes = {"scan": (self._beams,), "goal": (2,), "velocity": (2,)}
        self.observation_space = spaces.Dict({
            name: spaces.Box(*(np.broadcast_to(np.asarray(bound, np.float32), sizes[name]) for bound in bounds))
            for name, bounds in self._bounds.items()})

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Observed, Dict[str, Any]]:
        """Start an episode.

        Parameters
        ----------
        seed : int, optional
            Of the environment's generator; None: continue its sequence.
        options : dict, optional
            See the class.

        Returns
        -------
        observation : dict of str to array
        info : dict
        """
        super().reset(seed=seed)
        sim, options = self._sim, options or {}
        sim.reset(seed=int(self.np_random.integers(2**31)))
        start, goal = self._places(options.get("start"), options.get("goal"))
        sim.set_pose(start)
        sim.measure()
        self._goal = goal
        result = sim.observe()
        self._distance = self._goal_distance(result)
        if self.render_mode is not None:
            self._begin_picture(result)
        return self._observation(result), self._info(result)

    def _places(self, start: Optional[Sequence[float]], goal: Optional[Sequence[float]],
                ) -> Tuple[Tuple[float, ...], Tuple[float, float]]:
        """Return start (x, y, yaw) and goal (x, y); those not given are drawn, away from obstacles."""
        for _ in range(_TRIES):
            heading = self.np_random.uniform(-math.pi, math.pi)
            from_place = tuple(start) if start is not None else self._free_place() + (heading,)
            to_place = (goal[0], goal[1]) if goal is not None else self._free_place()
            apart = math.hypot(to_place[0] - from_place[0], to_place[1] - from_place[1])
            if (start is not None and goal is not None) or self._range[0] <= apart <= self._range[1]:
                return from_place, to_place
        raise RuntimeError("found no start and goal %g to %g m apart in %s in %d tries; give them to reset as options"
                           % (self._range[0], self._range[1], self._area, _TRIES))

    def _free_place(self) -> Tuple[float, float]:
        for _ in range(_TRIES):
            x, y = (float(self.np_random.uniform(low, high)) for low, high in (self._area[:2], self._area[2:]))
            if self._sim.clearance(x, y, reach=2.0 * _CLEARANCE, ignore=self._name) >= _CLEARANCE:
                return x, y
        raise RuntimeError("found no place in %s that is %g m away from everything after %d tries"
                           % (self._area, _CLEARANCE, _TRIES))

    def step(self, action: npt.ArrayLike) -> Tuple[Observed, float, bool, bool, Dict[str, Any]]:
        """Drive for ``duration``.

        Parameters
        ----------
        action : (2,) array_like
            Linear x [m/s], angular z [rad/s].

        Returns
        -------
        observation : dict of str to array
        reward : float
        terminated, truncated : bool
        info : dict

        Raises
        ------
        ValueError
            If the action is not two finite numbers.
        """
        command = np.asarray(action, dtype=np.float64)
        if command.shape != (2,) or not np.all(np.isfinite(command)):
            raise ValueError("action %r; expected two finite numbers: linear x [m/s], angular z [rad/s]" % (action,))
        result = self._sim.step(np.clip(command, self.action_space.low, self.action_space.high), self._duration)
        before, self._distance = self._distance, self._goal_distance(result)
        if self._picture is not None:
            self._picture.take(result)
        collided, reached = bool(result.contacts), self._distance < self._goal_radius
        reward = PROGRESS_REWARD * (before - self._distance) + TIME_REWARD * self._duration
        if collided:
            reward += CONTACT_REWARD
        elif reached:
            reward += GOAL_REWARD
        truncated = not (collided or reached) and result.time >= self._time_limit
        return self._observation(result), float(reward), collided or reached, truncated, self._info(result)

    def _goal_distance(self, result: StepResult) -> float:
        return math.hypot(self._goal[0] - result.position[0], self._goal[1] - result.position[1])

    def _observation(self, result: StepResult) -> Observed:
        scan, odometry = result.scan, result.odometry
        assert scan is not None and odometry is not None        # with sensing="now" both are measured in every step
        x, y, yaw = result.pose
        ahead, aside = self._goal[0] - x, self._goal[1] - y
        cosine, sine = math.cos(yaw), math.sin(yaw)
        values: Dict[str, npt.ArrayLike] = {
            "scan": scan.ranges.reshape(self._beams, -1).min(axis=1),
            "goal": (cosine * ahead + sine * aside, cosine * aside - sine * ahead),
            "velocity": (odometry.linear_x, odometry.angular_z)}
        return {name: np.clip(np.asarray(values[name], np.float32), *self._bounds[name]).astype(np.float32)
                for name in values}

    def _info(self, result: StepResult) -> Dict[str, Any]:
        contacts = len(result.contacts)
        return {"distance": self._distance, "time": result.time, "contacts": contacts,
                "is_success": self._distance < self._goal_radius and not contacts}

    def _begin_picture(self, result: StepResult) -> None:
        if self._picture is None:
            from m2wr_sim.api.gym_picture import EnvPicture  # the renderer is loaded only if images are used
            self._picture = EnvPicture(self._sim, self._name)
        self._picture.begin(self._goal)
        self._picture.take(result)

    def render(self) -> Optional[NDArray[np.uint8]]:
        """Return the present image, (800, 800, 3) uint8, or None without a ``render_mode``.

        Raises
        ------
        RuntimeError
            Before the first reset.
        """
        if self.render_mode is None:
            return None
        if self._picture is None:
            raise RuntimeError("render() before reset(): there is nothing to draw yet")
        return self._picture.draw()

    def close(self) -> None:
        """Free the world."""
        self._sim.close()


if ENV_ID not in gymnasium.registry:
    gymnasium.register(ENV_ID, entry_point=GoToGoalEnv)
