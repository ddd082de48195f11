# SPDX-License-Identifier: BSD-3-Clause
"""What the Gymnasium environments have in common: a world, a robot with a drive and a laser, places, pictures.

It needs the Python package gymnasium, which nothing else in this package does.
"""
from __future__ import annotations

import importlib
import importlib.util
import math
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple, Union

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

    from m2wr_sim.api.records import StepResult
    from m2wr_sim.model.types import Model, World

    Observed = Dict[str, NDArray[np.float32]]
    #: Names of parts of an observation -> least and greatest values, arrays of the part's shape.
    Bounds = Dict[str, Tuple[npt.ArrayLike, npt.ArrayLike]]

CLEARANCE = 0.7                 # m from a drawn place to the nearest obstacle: m2wr turns within 0.45 m
TRIES = 1000
#: Module with the class EnvView, of a package above this one that need not be there.
VIEW = "m2wr_live.ros.env_view"


def render_modes() -> List[str]:
    """Return the render modes: ``rgb_array``, and ``human`` where the live view and its library are installed."""
    try:
        there = all(importlib.util.find_spec(module) is not None for module in ("viser", VIEW))
    except ImportError:             # a package around the module is missing
        there = False
    return ["rgb_array"] + ["human"] * there


class RobotEnv(gymnasium.Env):
    """An environment of one robot; a task derives from it.

    Observation, a dictionary of float32 arrays with at least

    ============ =========== ====================================================================================
    ``scan``     (beams,)    least range of each group of neighbouring beams [m], the longest range for no hit
    ``velocity`` (2,)        linear x [m/s], angular z [rad/s] by odometry
    ============ =========== ====================================================================================

    Action: (2,) float32, linear x [m/s] and angular z [rad/s]; clipped to the limits.

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
        Bounds of places that are drawn: x min, x max, y min, y max [m].
    render_mode : str, optional
        ``rgb_array``: :meth:`render` returns an image from above, (800, 800, 3) uint8. ``human``, if m2wr_live is
        there: pages in web browsers watch in real time; the address is printed.
    **options
        The other options of Sim.

    Raises
    ------
    ValueError
        If the number of laser beams is no multiple of ``beams``, or an option has an unusable value.
    """

    metadata: Dict[str, Any] = {"render_modes": render_modes(), "render_fps": 10}

    def __init__(self, world: Union[World, str, os.PathLike[str]], robot: Union[Model, str, os.PathLike[str]],
                 duration: float, time_limit: float, beams: int, max_linear: float, max_angular: float,
                 area: Tuple[float, float, float, float], render_mode: Optional[str], **options: Any) -> None:
        check_render_mode(render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._picture: Any = None
        self._sim = Sim(world, robot, sensing="now", **options)
        try:
            laser = self._sim.lasers()[0] if self._sim.lasers() else None
            if laser is None or beams < 1 or laser.count % beams:
                raise ValueError("beams %r; expected a divisor of the laser's %d readings"
                                 % (beams, 0 if laser is None else laser.count))
            self._drive = self._sim.drive()             # NotFoundError if there is none
        except Exception:
            self._sim.close()
            raise
        self._name, self._beams = self._sim.robots[0], int(beams)
        self._duration, self._time_limit, self._area = duration, time_limit, tuple(area)
        self._range_max = np.float32(laser.range_max)
        limits = np.array([max_linear, max_angular], np.float32)
        self._linear, self._angular = limits.tolist()
        self.action_space = spaces.Box(-limits, limits, dtype=np.float32)
        sizes: Bounds = {"scan": (np.zeros(self._beams), np.full(self._beams, laser.range_max))}
        sizes.update(self._bounds())
        sizes["velocity"] = (-10.0 * limits, 10.0 * limits)
        self.observation_space = spaces.Dict({
            name: spaces.Box(*(np.asarray(bound, np.float32) for bound in bounds)) for name, bounds in sizes.items()})

    # ---- of the task -------------------------------------------------------------------------------------------

    def _bounds(self) -> Bounds:
        """Return the bounds of the parts of an observation that only this task has."""
        return {}

    def _place(self, options: Dict[str, Any]) -> Tuple[float, ...]:
        """Choose the task of an episode, and return the start (x, y, yaw)."""
        raise NotImplementedError

    def _begin(self, result: StepResult) -> None:
        """Prepare for an episode that begins with this result."""

    def _seen(self, result: StepResult) -> Observed:
        """Return the parts of the observation that only this task has, within their bounds."""
        return {}

    def _judge(self, result: StepResult) -> Tuple[float, bool]:
        """Return the reward of a step, and whether it ends the episode."""
        raise NotImplementedError

    def _info(self, result: StepResult) -> Dict[str, Any]:
        return {"time": result.time, "contacts": len(result.contacts)}

    def _marked(self) -> Tuple[float, float]:
        """Return the place (x, y) [m] that pictures mark; by default that of the robot at the start."""
        return self._sim.pose()[0][:2]

    # ---- of Gymnasium ------------------------------------------------------------------------------------------

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
        sim = self._sim
        sim.reset(seed=int(self.np_random.integers(2**31)))
        sim.set_pose(self._place(options or {}))
        sim.measure()
        result = sim.observe()
        self._begin(result)
        if self.render_mode is not None:
            self._begin_picture(result)
        return self._observation(result), self._info(result)

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
        if command.shape != (2,) or not math.isfinite(command[0]) or not math.isfinite(command[1]):
            raise ValueError("action %r; expected two finite numbers: linear x [m/s], angular z [rad/s]" % (action,))
        linear, angular = command.tolist()
        self._drive.command(clip(linear, self._linear), clip(angular, self._angular))
        result = self._sim.step(None, self._duration)
        if self._picture is not None:
            self._picture.take(result)
        reward, ended = self._judge(result)
        truncated = not ended and result.time >= self._time_limit
        return self._observation(result), float(reward), ended, truncated, self._info(result)

    def _observation(self, result: StepResult) -> Observed:
        scan, odometry = result.scan, result.odometry
        assert scan is not None and odometry is not None        # with sensing="now" both are measured in every step
        seen: Observed = {"scan": np.minimum(scan.ranges.reshape(self._beams, -1).min(axis=1), self._range_max)}
        seen.update(self._seen(result))
        seen["velocity"] = np.array((clip(odometry.linear_x, 10.0 * self._linear),
                                     clip(odometry.angular_z, 10.0 * self._angular)), np.float32)
        return seen

    def _free_place(self) -> Tuple[float, float]:
        """Return a random place (x, y) [m] away from obstacles."""
        for _ in range(TRIES):
            x, y = (float(self.np_random.uniform(low, high)) for low, high in (self._area[:2], self._area[2:]))
            if self._sim.clearance(x, y, reach=2.0 * CLEARANCE, ignore=self._name) >= CLEARANCE:
                return x, y
        raise RuntimeError("found no place in %s that is %g m away from everything after %d tries"
                           % (self._area, CLEARANCE, TRIES))

    def _free_start(self, start: Optional[Sequence[float]]) -> Tuple[float, ...]:
        """Return a start (x, y, yaw): the given one, or a random one."""
        if start is not None:
            return tuple(start)
        x, y = self._free_place()
        return x, y, self.np_random.uniform(-math.pi, math.pi)

    def _begin_picture(self, result: StepResult) -> None:
        if self._picture is None and self.render_mode == "human":
            self._picture = importlib.import_module(VIEW).EnvView(self._sim, self._name)
        elif self._picture is None:
            from m2wr_sim.api.gym_picture import EnvPicture  # the renderer is loaded only if images are used
            self._picture = EnvPicture(self._sim, self._name)
        self._picture.begin(self._marked())
        self._picture.take(result)

    def render(self) -> Optional[NDArray[np.uint8]]:
        """Return the present image, (800, 800, 3) uint8; None with ``human`` and without a ``render_mode``.

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
        """Free the world; called again it does nothing."""
        if self._picture is not None:
            self._picture.close()
        self._picture = None
        self._sim.close()


def clip(value: float, limit: float) -> float:
    """Return a value within -limit and limit.

    Parameters
    ----------
    value, limit : float

    Returns
    -------
    float
    """
    return min(limit, max(-limit, value))


def check_render_mode(mode: Optional[str], modes: Sequence[str]) -> None:
    """Check a ``render_mode``.

    Parameters
    ----------
    mode : str or None
    modes : sequence of str
        Those of the environment.

    Raises
    ------
    ValueError
        If it has no such mode.
    """
    if mode == "human" and mode not in modes:
        raise ValueError("render_mode 'human'; expected None or one of %s: the live view needs the package m2wr_live "
                         "of the workspace" % ", ".join(modes))
    if mode is not None and mode not in modes:
        raise ValueError("render_mode %r; expected None or one of %s" % (mode, ", ".join(modes)))
