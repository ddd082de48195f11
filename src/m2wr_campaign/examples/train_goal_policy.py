#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Learn to drive to goals in generated worlds by PPO of stable-baselines3; write the policy for the method ``learned``.

Needs stable-baselines3 and torch (the CPU build is enough) in a venv that was made with --system-site-packages. The
worlds of training and of the exam have different seeds; nothing is chosen by the exam. See docs/how-to/gymnasium.md.
"""
from __future__ import annotations

import argparse
import csv
import sys
import time
from typing import Any, Dict, List, Sequence, Tuple

import gymnasium
import numpy as np

import m2wr_sim.api.gym_env  # noqa: F401  registers the environments
from m2wr_campaign.worlds.generators import generate
from m2wr_navigation.methods.body import M2WR
from m2wr_navigation.methods.learned import (
    ANGULAR,
    FEATURES,
    LINEAR,
    MOST_SPEED,
    SECTORS,
    features,
    network,
    read_policy,
    scaled,
)

try:
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor
except ImportError as error:
    sys.exit("train_goal_policy.py needs stable-baselines3 and torch (%s): pip install torch stable-baselines3" % error)

KINDS = ("pillars", "rooms")
HALF_SIDE = 5.5             # m: starts and goals are drawn within; the generated worlds have 12 m
TRAINING_SEED, EXAM_SEED = 100, 1
EXAM_LIMIT = 120.0          # s of simulated time


def arguments_of(count: int, seed: int, fixed: bool) -> List[Dict[str, Any]]:
    """Return the arguments of environments in generated worlds; ``fixed``: with the start and goal of the generator."""
    made = []
    for number in range(count):
        world, (start, goal) = generate(KINDS[number % len(KINDS)], {}, seed, number, M2WR.turning_radius)
        made.append(dict(world=world, **(dict(start=start[:2], goal=goal) if fixed else {})))
    return made


class Worlds(VecEnv):
    """Batched worlds as stable-baselines3 takes them: features in, actions from -1 to 1 out.

    Parameters
    ----------
    count : int
        Worlds that are stepped together.
    each : sequence of dict
        See BatchedGoToGoal.
    **options
        Of GoToGoalEnv.
    """

    def __init__(self, count: int, each: Sequence[Dict[str, Any]], **options: Any) -> None:
        self.worlds = gymnasium.make_vec("m2wr/GoToGoalWorld02-v0", num_envs=count, each=each, beams=SECTORS,
                                         max_linear=LINEAR, max_angular=ANGULAR, area=(-HALF_SIDE, HALF_SIDE) * 2,
                                         **options)
        box = gymnasium.spaces.Box
        super().__init__(count, box(-MOST_SPEED, MOST_SPEED, (FEATURES,)), box(-1.0, 1.0, (2,)))
        self._actions = np.zeros((count, 2))

    def begin(self, seed: int) -> np.ndarray:
        """Start an episode in all worlds."""
        return self._features(self.worlds.reset(seed=seed)[0])

    def reset(self) -> np.ndarray:
        seeds = [seed for seed in self._seeds if seed is not None]
        self._reset_seeds()
        return self.begin(seeds[0]) if seeds else self._features(self.worlds.reset()[0])

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> Tuple[np.ndarray, np.ndarray, np.ndarray, List[Dict[str, Any]]]:
        observations, rewards, ended, truncated, infos = self.worlds.step(scaled(self._actions))
        over, seen = ended | truncated, self._features(observations)
        told: List[Dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(over):
            told[index] = {"terminal_observation": seen[index], "is_success": bool(infos["is_success"][index]),
                           "TimeLimit.truncated": bool(truncated[index])}
        if over.any():
            seen = self._features(self.worlds.reset(options={"reset_mask": over})[0])
        return seen, rewards.astype(np.float32), over, told

    @staticmethod
    def _features(seen: Dict[str, np.ndarray]) -> np.ndarray:
        return features(seen["scan"], seen["goal"], seen["velocity"])

    def close(self) -> None:
        self.worlds.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> List[Any]:
        return [getattr(self, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError("the worlds have no attributes to set")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> List[Any]:
        raise NotImplementedError("the worlds have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> List[bool]:
        return [False for _ in self._get_indices(indices)]


class Curve(BaseCallback):
    """Notes steps, processor and wall time, and the share of the last hundred episodes that reached the goal.

    The policy is written each time, so that an interrupted training is not lost.
    """

    def __init__(self, path: str, policy: str) -> None:
        super().__init__()
        self._path, self._policy, self._begun = path, policy, (time.process_time(), time.perf_counter())
        self.rows: List[Tuple[int, float, float, float, float]] = []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        if not self.model.ep_success_buffer:
            return
        self.rows.append((self.num_timesteps, time.process_time() - self._begun[0],
                          time.perf_counter() - self._begun[1], float(np.mean(self.model.ep_success_buffer)),
                          float(np.mean([episode["r"] for episode in self.model.ep_info_buffer]))))
        print("%8d steps  %6.0f s of processor time  %6.0f s   goal reached in %3.0f %%   reward %6.2f" % (
            self.rows[-1][:3] + (100.0 * self.rows[-1][3], self.rows[-1][4])), flush=True)
        with open(self._path, "w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(("steps", "cpu_s", "wall_s", "success", "reward"))
            writer.writerows(self.rows)
        export(self.model, self._policy)


def train(steps: int, count: int, seed: int, curve: str, policy: str) -> None:
    """Train, and write curve and policy.

    Parameters
    ----------
    steps : int
        Of all worlds together.
    count : int
        Worlds.
    seed : int
    curve : str
        CSV file that gets the curve.
    policy : str
        File that gets the policy.
    """
    torch.set_num_threads(1)        # the network is small: more threads take more processor time and are no faster
    worlds = VecMonitor(Worlds(count, arguments_of(count, TRAINING_SEED, False), distance=(1.0, 11.0),
                               time_limit=60.0), info_keywords=())
    model = PPO("MlpPolicy", worlds, n_steps=128, batch_size=1024, n_epochs=8, gamma=0.995, gae_lambda=0.95,
                learning_rate=lambda left: 1e-3 * left, ent_coef=0.001, clip_range=0.2, seed=seed, device="cpu",
                policy_kwargs=dict(net_arch=[64, 64], activation_fn=torch.nn.Tanh, log_std_init=-0.5))
    model.learn(steps, callback=Curve(curve, policy))
    export(model, policy)
    worlds.close()


def examine(policy: str, count: int) -> Dict[str, float]:
    """Return the shares of exam worlds in which the goal was reached, an obstacle was hit, or the time was over.

    Parameters
    ----------
    policy : str
        File, as the method reads it.
    count : int
        Worlds; one drive in each.
    """
    layers = read_policy(policy)
    worlds = Worlds(count, arguments_of(count, EXAM_SEED, True), distance=(1.0, 20.0), time_limit=EXAM_LIMIT)
    seen, open_runs, ends = worlds.begin(EXAM_SEED), np.ones(count, bool), {"reached": 0, "contact": 0, "late": 0}
    while open_runs.any():
        worlds.step_async(network(layers, seen))
        seen, _, over, told = worlds.step_wait()
        for index in np.flatnonzero(over & open_runs):
            end = told[index]
            ends["reached" if end["is_success"] else "late" if end["TimeLimit.truncated"] else "contact"] += 1
        open_runs &= ~over
    worlds.close()
    return {name: number / count for name, number in ends.items()}


def draw(curve: str, path: str) -> None:
    """Draw the share of episodes that reached their goal over the steps; write a file.

    Parameters
    ----------
    curve : str
        CSV file of the training.
    path : str
        PNG or SVG.
    """
    import matplotlib  # only for the figure
    matplotlib.use("Agg")
    from matplotlib import pyplot
    rows = np.loadtxt(curve, delimiter=",", skiprows=1, ndmin=2)
    figure, axes = pyplot.subplots(figsize=(7.0, 3.6))
    axes.plot(1e-3 * rows[:, 0], 100.0 * rows[:, 3], color="#1f77b4")
    axes.set_xlabel("steps [thousand]")
    axes.set_ylabel("goal reached, last 100 episodes [%]")
    axes.set_xlim(0.0, 1e-3 * rows[-1, 0])
    axes.set_ylim(0.0, 100.0)
    axes.grid(alpha=0.3)
    axes.set_title("training: {:.0f} s of processor time".format(rows[-1, 1]))
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def export(model: Any, path: str) -> None:
    """Write the policy's network as arrays of numpy.

    Parameters
    ----------
    model : stable_baselines3.PPO
    path : str
        Ends in ``.npz``.
    """
    layers = [layer for layer in model.policy.mlp_extractor.policy_net if isinstance(layer, torch.nn.Linear)]
    arrays: Dict[str, np.ndarray] = {}
    for number, layer in enumerate([*layers, model.policy.action_net]):
        arrays["weights_%d" % number] = layer.weight.detach().numpy()
        arrays["offsets_%d" % number] = layer.bias.detach().numpy()
    np.savez_compressed(path, **arrays)


def main() -> None:
    parser = argparse.ArgumentParser(description="Learn to drive to goals in generated worlds.")
    parser.add_argument("--steps", type=int, default=2000000, help="of all worlds together (default: %(default)s)")
    parser.add_argument("--worlds", type=int, default=64, help="of the training (default: %(default)s)")
    parser.add_argument("--exam", type=int, default=200, help="worlds of the exam (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--policy", default="learned_policy.npz", help="file to write (default: %(default)s)")
    parser.add_argument("--curve", default="learning_curve.csv", help="file to write (default: %(default)s)")
    parser.add_argument("--figure", default="", metavar="FILE",
                        help="also draw the curve, PNG or SVG; needs matplotlib")
    options = parser.parse_args()
    train(options.steps, options.worlds, options.seed, options.curve, options.policy)
    if options.figure:
        draw(options.curve, options.figure)
    print("exam in %d worlds of other seeds: %s" % (options.exam, ", ".join(
        "%s %.1f %%" % (name, 100.0 * share) for name, share in examine(options.policy, options.exam).items())))


if __name__ == "__main__":
    main()
