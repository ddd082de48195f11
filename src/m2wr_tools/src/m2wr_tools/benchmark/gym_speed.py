# SPDX-License-Identifier: BSD-3-Clause
"""Steps per second of the Gymnasium environments, and of other simulators that are installed.

All take random actions, which are drawn before.  A step of these environments is 0.1 s of simulated time with one scan
of 720 beams.  Steps of others differ in length and content: f1tenth_gym's is 0.01 s with 1080 beams, ir-sim's 0.1 s
with 720 beams among eight boxes, MuJoCo's Ant-v5 0.05 s without a laser.
"""
from __future__ import annotations

import itertools
import tempfile
import time
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_sim.errors import SimError

_SECONDS = 1.0                  # of processor time, of each measurement
_REFERENCE = "m2wr/GoToGoalWorld02-v0"
_ACTIONS = 1000                 # that are drawn before a measurement; sampling one takes as long as a scan
#: For ir-sim: a room with a differential drive, the beams of m2wr's laser, and eight boxes.
_IRSIM_WORLD = """
world: {height: 20, width: 20, step_time: 0.1, sample_time: 0.1, offset: [-10, -10], collision_mode: stop}
robot:
  - kinematics: {name: diff}
    shape: {name: circle, radius: 0.25}
    state: [0, 0, 0]
    vel_min: [-0.6, -1.0]
    vel_max: [0.6, 1.0]
    sensors: [{name: lidar2d, range_min: 0.1, range_max: 10, angle_range: 3.14159, number: 720, noise: true, std: 0.01}]
obstacle:
  - number: 8
    distribution: {name: manual}
    shape: {name: rectangle, length: 3.0, width: 0.4}
    state: [[5, 0, 0], [-5, 0, 0], [0, 5, 0], [0, -5, 0], [5, 5, 0.8], [-5, -5, 0.8], [5, -5, 2.3], [-5, 5, 2.3]]
"""


class Row(NamedTuple):
    """Name, steps per second of processor time, simulated seconds in a step (nan: not known)."""

    name: str
    rate: float
    seconds: float


def _gymnasium() -> Any:
    try:
        import gymnasium

        import m2wr_sim.api.gym_env  # noqa: F401  registers the environments
    except ImportError as error:
        raise SimError("the measurement needs the Python module gymnasium (%s): pip install gymnasium"
                       % error) from error
    return gymnasium


def rate_of(step: Callable[[], int], seconds: float = _SECONDS) -> float:
    """Return how many steps a function makes in a second of processor time; it returns the number of each call.

    Parameters
    ----------
    step : callable
        It is called once before the measurement begins.
    seconds : float
        How long to measure, in processor time.
    """
    step()
    begin, steps = time.process_time(), 0
    while time.process_time() - begin < seconds or not steps:
        steps += step()
    return steps / (time.process_time() - begin)


def _random_actions(space: Any) -> Iterator[Any]:
    """Return an iterator that repeats random actions for ever."""
    space.seed(1)
    return itertools.cycle([space.sample() for _ in range(_ACTIONS)])


def _single(env: Any) -> Callable[[], int]:
    """Return a function that makes 20 steps of an environment."""
    env.reset(seed=1)
    actions = _random_actions(env.action_space)

    def step() -> int:
        for _ in range(20):
            _, _, terminated, truncated, _ = env.step(next(actions))
            if terminated or truncated:
                env.reset()
        return 20
    return step


def _batch(envs: Any) -> Callable[[], int]:
    envs.reset(seed=1)
    actions = _random_actions(envs.action_space)

    def step() -> int:
        envs.step(next(actions))
        return int(envs.num_envs)
    return step


def ours(worlds: int, seconds: float = _SECONDS) -> Iterator[Row]:
    """Yield a row for each registered environment, and one for many worlds in this process.

    Parameters
    ----------
    worlds : int
        Number of batched worlds.
    seconds : float
        Of processor time, of each measurement.
    """
    gymnasium = _gymnasium()
    from m2wr_sim.api.gym_env import ENVIRONMENTS
    for name in ENVIRONMENTS:
        env = gymnasium.make(name)
        yield Row(name, rate_of(_single(env), seconds), 0.1)
        env.close()
    envs = gymnasium.make_vec(_REFERENCE, num_envs=worlds)
    yield Row("%s, %d worlds in one process" % (_REFERENCE, worlds), rate_of(_batch(envs), seconds), 0.1)
    envs.close()


def _f1tenth() -> Tuple[Callable[[], int], float]:
    import gym
    env = gym.make("f110_gym:f110-v0", num_agents=1)
    env.reset(np.zeros((1, 3)))
    rng = np.random.default_rng(1)

    def step() -> int:
        if env.step(rng.uniform((-0.3, 0.0), (0.3, 3.0), (1, 2)))[2]:
            env.reset(np.zeros((1, 3)))
        return 1
    return step, 0.01


def _irsim() -> Tuple[Callable[[], int], float]:
    import irsim
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        file.write(_IRSIM_WORLD)
        file.flush()
        env = irsim.make(file.name, display=False)
    rng = np.random.default_rng(1)

    def step() -> int:
        env.step(rng.uniform((-0.6, -1.0), (0.6, 1.0)).reshape(2, 1))
        return 1
    return step, 0.1


def _mujoco() -> Tuple[Callable[[], int], float]:
    import mujoco  # noqa: F401  tells whether it is there
    return _single(_gymnasium().make("Ant-v5")), 0.05


#: How to make the others; ImportError if one is not installed.
OTHERS: Dict[str, Callable[[], Tuple[Callable[[], int], float]]] = {
    "f1tenth_gym": _f1tenth, "ir-sim": _irsim, "MuJoCo Ant-v5": _mujoco}


def others(seconds: float = _SECONDS) -> Iterator[Tuple[str, Optional[Row], str]]:
    """Yield name, row and, where there is no row, the reason.

    Parameters
    ----------
    seconds : float
        Of processor time, of each measurement.
    """
    for name, make in OTHERS.items():
        try:
            step, length = make()
            yield name, Row(name, rate_of(step, seconds), length), ""
        except ImportError as error:
            yield name, None, "not installed (%s)" % error
        except Exception as error:      # another version of it has other calls; the table does without it
            yield name, None, "could not be measured (%s: %s)" % (type(error).__name__, error)


def table(rows: List[Row]) -> str:
    """Return the rows as a Markdown table; the ratios are to the reference environment."""
    reference = next((row.rate for row in rows if row.name == _REFERENCE), rows[0].rate)
    lines = ["| environment | steps per second | simulated seconds per second | times as many steps |",
             "| --- | --- | --- | --- |"]
    lines += ["| %s | %.0f | %.0f | %.2f |" % (row.name, row.rate, row.rate * row.seconds, row.rate / reference)
              for row in rows]
    return "\n".join(lines) + "\n"


def report(worlds: int, seconds: float = _SECONDS) -> str:
    """Measure everything that is there, and return the table and what is missing.

    Parameters
    ----------
    worlds : int
        Number of batched worlds.
    seconds : float
        Of processor time, of each measurement.

    Returns
    -------
    str
    """
    rows, missing = list(ours(worlds, seconds)), []
    for name, row, reason in others(seconds):
        if row is None:
            missing.append("%s: %s\n" % (name, reason))
        else:
            rows.append(row)
    return table(rows) + "".join(missing)
