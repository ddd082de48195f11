# SPDX-License-Identifier: BSD-3-Clause
"""Many worlds of a goal environment in one process, stepped together: arrays in, arrays out.

``gymnasium.make_vec(name, num_envs=64)`` makes it for the environments of :mod:`m2wr_sim.api.gym_env` with a goal.  Use
``vectorization_mode="async"`` for one process per world instead.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_sim.angles import yaw_of
from m2wr_sim.api.gym_base import gymnasium
from m2wr_sim.api.gym_env import CONTACT_REWARD, FARTHEST, GOAL_REWARD, PROGRESS_REWARD, TIME_REWARD, GoToGoalEnv
from m2wr_sim.api.quiet_batch import QuietBatch
from m2wr_sim.api.sim import ONE_STEPS
from m2wr_sim.runtime.once_logger import suppress_warnings

if TYPE_CHECKING:
    import numpy.typing as npt
    from numpy.typing import NDArray

    from m2wr_sim.api.gym_base import Observed

    #: Observations, rewards, terminated, truncated, infos.
    Stepped = Tuple[Observed, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Dict[str, Any]]

_batch_space = gymnasium.vector.utils.batch_space


class BatchedGoToGoal(gymnasium.vector.VectorEnv):
    """n worlds of :class:`~m2wr_sim.api.gym_env.GoToGoalEnv`, each with its own generator.

    Observations, rewards and ends are those of the single environment to the precision of float32.  A world whose
    episode has ended begins a new one with the next step, which ignores its action (Gymnasium's NEXT_STEP); the
    reward of that step is 0.

    Parameters
    ----------
    num_envs : int
        Number of worlds, n.
    each : sequence of dict, optional
        Arguments of GoToGoalEnv for one world, besides ``options``: world i gets ``each[i % len(each)]``.
    **options
        Arguments of GoToGoalEnv for all worlds; ``render_mode`` must be None.

    Raises
    ------
    ValueError
        If ``num_envs`` is below 1, or an option has an unusable value.
    """

    metadata: Dict[str, Any] = {"render_modes": []}
    if hasattr(gymnasium.vector, "AutoresetMode"):      # not in Gymnasium 1.0, whose only mode it is
        metadata["autoreset_mode"] = gymnasium.vector.AutoresetMode.NEXT_STEP

    def __init__(self, num_envs: int = 1, render_mode: Optional[str] = None,
                 each: Sequence[Dict[str, Any]] = ({},), **options: Any) -> None:
        self._envs: List[GoToGoalEnv] = []
        if num_envs < 1:
            raise ValueError("num_envs %r; expected at least one world" % (num_envs,))
        if not each:
            raise ValueError("each is empty; expected arguments of at least one world")
        if render_mode is not None:
            raise ValueError("render_mode %r; batched worlds have no pictures: use vectorization_mode=\"sync\""
                             % (render_mode,))
        self.num_envs, self.render_mode = num_envs, None
        try:
            for index in range(num_envs):
                with suppress_warnings(index > 0):
                    self._envs.append(GoToGoalEnv(**{**options, **each[index % len(each)]}))
        except Exception:
            self.close()
            raise
        first = self._envs[0]
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        self.action_space = _batch_space(self.single_action_space, num_envs)
        self.observation_space = _batch_space(self.single_observation_space, num_envs)
        self._limits = first.action_space.high.astype(np.float64)
        self._duration, self._time_limit, self._radius = first._duration, first._time_limit, first._goal_radius
        self._beams, self._range_max = first._beams, first._range_max
        self._ranges = np.empty((num_envs, first._sim.lasers()[0].count), np.float32)
        self._states = np.empty((num_envs, 6))          # see _World
        self._goals, self._distances = np.zeros((num_envs, 2)), np.zeros(num_envs)
        self._collided, self._over = np.zeros(num_envs, bool), np.zeros(num_envs, bool)
        self._worlds = [_World(env, self._ranges[index], self._states[index]) for index, env in enumerate(self._envs)]
        self._batch = QuietBatch([(world.simulator, world.drive, world.laser, world.length_ns)
                                  for world in self._worlds], self._ranges)

    def reset(self, *, seed: Optional[Union[int, Sequence[Optional[int]]]] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Observed, Dict[str, Any]]:
        """Start an episode in all worlds.

        Parameters
        ----------
        seed : int or sequence, optional
            World i gets ``seed + i``, or the i-th of the sequence.
        options : dict, optional
            As for GoToGoalEnv, for all worlds.  ``reset_mask``, (n,) bool, says which worlds begin; the others stay
            as they are.

        Returns
        -------
        observations : dict of str to array
            Each has one row per world.
        infos : dict of str to array

        Raises
        ------
        ValueError
            If there are not as many seeds, or truth values, as worlds.
        """
        seeds: Sequence[Optional[int]] = seed if isinstance(seed, (list, tuple)) else [
            None if seed is None else int(seed) + index for index in range(self.num_envs)]     # type: ignore[arg-type]
        if len(seeds) != self.num_envs:
            raise ValueError("%d seeds for %d worlds" % (len(seeds), self.num_envs))
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise ValueError("reset_mask: %s of %s for %d worlds; expected one truth value for each"
                             % (mask.shape, mask.dtype, self.num_envs))
        for index in np.flatnonzero(mask):
            self._begin(int(index), seeds[index], options)
        self._over &= ~mask
        return self._observe(), self._infos()

    def _begin(self, index: int, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None) -> None:
        env = self._envs[index]
        env.reset(seed=seed, options=options)
        self._goals[index] = env._goal
        self._worlds[index].begin()
        self._batch.begin(index)
        self._collided[index] = False
        self._distances[index] = math.dist(self._goals[index], self._states[index, :2])

    def step(self, actions: npt.ArrayLike) -> Stepped:
        """Drive all robots for ``duration``.

        Parameters
        ----------
        actions : (n, 2) array_like
            Linear x [m/s], angular z [rad/s]; clipped to the limits.

        Returns
        -------
        observations : dict of str to array
        rewards : (n,) float64
        terminated, truncated : (n,) bool
        infos : dict of str to array

        Raises
        ------
        ValueError
            If there are not two finite numbers for each world.
        """
        commands = np.asarray(actions, dtype=np.float64)
        if commands.shape != (self.num_envs, 2) or not np.isfinite(commands).all():
            raise ValueError("actions of shape %s; expected %d pairs of finite numbers: linear x [m/s], angular z "
                             "[rad/s]" % (commands.shape, self.num_envs))
        renewed = self._over.copy()
        before = self._distances.copy()
        rows = np.clip(commands, -self._limits, self._limits).tolist()
        with ONE_STEPS:
            together = np.flatnonzero(self._batch.quiet & ~renewed)
            for index in self._batch.step(together, rows) if together.size else ():
                self._collided[index] = self._worlds[index].collides()
            for index in np.flatnonzero(~self._batch.quiet & ~renewed).tolist():
                self._collided[index] = self._worlds[index].step(*rows[index])
        self._take_motions(together)
        for index in np.flatnonzero(renewed):
            self._begin(int(index))
        difference = self._goals - self._states[:, :2]
        self._distances = np.hypot(difference[:, 0], difference[:, 1])
        reached = self._distances < self._radius
        rewards = PROGRESS_REWARD * (before - self._distances) + TIME_REWARD * self._duration
        rewards += np.where(self._collided, CONTACT_REWARD, np.where(reached, GOAL_REWARD, 0.0))
        rewards[renewed] = 0.0
        terminated = (self._collided | reached) & ~renewed
        truncated = (self._states[:, 5] >= self._time_limit) & ~terminated & ~renewed
        self._over = terminated | truncated
        return self._observe(), rewards, terminated, truncated, self._infos()

    def _take_motions(self, which: NDArray[np.int64]) -> None:
        """Write the states of the worlds that were stepped together."""
        x, y, _, qx, qy, qz, qw, along, across, _, _, _, rate = self._batch.motions[which].T
        yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        times = [self._worlds[index].simulator.now_ns / 1e9 for index in which.tolist()]
        self._states[which] = np.stack((x, y, yaw, np.cos(yaw) * along + np.sin(yaw) * across, rate, times), axis=1)

    def _observe(self) -> Observed:
        x, y, yaw, linear, angular, _ = self._states.T
        ahead, aside = self._goals[:, 0] - x, self._goals[:, 1] - y
        cosine, sine = np.cos(yaw), np.sin(yaw)
        goal = np.stack((cosine * ahead + sine * aside, cosine * aside - sine * ahead), axis=1)
        scan = _least(self._ranges.reshape(self.num_envs, self._beams, -1))
        velocity = np.clip(np.stack((linear, angular), axis=1), -10.0 * self._limits, 10.0 * self._limits)
        return {"scan": np.minimum(scan, self._range_max),
                "goal": np.clip(goal, -FARTHEST, FARTHEST).astype(np.float32), "velocity": velocity.astype(np.float32)}

    def _infos(self) -> Dict[str, Any]:
        everywhere = np.ones(self.num_envs, bool)
        return {"distance": self._distances.copy(), "_distance": everywhere,
                "time": self._states[:, 5].copy(), "_time": everywhere,
                "is_success": (self._distances < self._radius) & ~self._collided, "_is_success": everywhere}

    def close_extras(self, **_: Any) -> None:
        """Free all worlds."""
        for env in self._envs:
            env.close()


def _least(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the minimum over the last axis of three; for a short one this takes a sixth of the time of ``min``."""
    if values.shape[2] > 64:
        return values.min(axis=2)               # type: ignore[no-any-return]
    least = values[:, :, 0].copy()
    for column in range(1, values.shape[2]):
        np.minimum(least, values[:, :, column], out=least)
    return least


class _World:
    """One of the worlds, stepped without the records of :class:`~m2wr_sim.api.sim.Sim`.

    Parameters
    ----------
    env : GoToGoalEnv
    ranges : (beams,) float32
        Gets the newest scan [m].
    state : (6,) float64
        Gets x, y [m], yaw [rad], linear x [m/s], angular z [rad/s], time [s].
    """

    def __init__(self, env: GoToGoalEnv, ranges: NDArray[np.float32], state: NDArray[np.float64]) -> None:
        sim = env._sim
        self.simulator, self.drive, self.laser = sim.simulator, sim.drive(), sim.lasers()[0]
        self._name, self._ranges, self._state = env._name, ranges, state
        self.length_ns = int(round(env._duration * 1e9 / self.simulator.step_ns)) * self.simulator.step_ns

    def begin(self) -> None:
        """Take over scan and state after a reset, without another measurement."""
        scan = self.laser.scan
        assert scan is not None         # a reset measures
        self._ranges[:] = scan.ranges
        self._read_state()

    def step(self, linear: float, angular: float) -> bool:
        """Drive, measure, and return whether the robot has collided."""
        simulator = self.simulator
        end_ns = simulator.now_ns + self.length_ns
        self.drive.command(linear, angular)
        while simulator.now_ns < end_ns:
            simulator.advance(end_ns, lazily=True)
        simulator.settle()
        self._read_state()
        self._ranges[:] = self.laser.measure()[0]
        return self.collides()

    def collides(self) -> bool:
        """Return whether the robot has new contacts; each is reported once."""
        contacts, self.simulator.contacts = self.simulator.contacts, []
        begin = self._name + "::"
        return any(contact.first.startswith(begin) or contact.second.startswith(begin) for contact in contacts)

    def _read_state(self) -> None:
        """Measure pose, velocity and time."""
        position, orientation, twist = self.drive.measure()
        if not self.drive.measures_truth:
            position, orientation = self.simulator.models[self._name].pose(self.simulator.engine)
        self._state[:] = (position[0], position[1], yaw_of(orientation), twist[0], twist[2],
                          self.simulator.now_ns / 1e9)
