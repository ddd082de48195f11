# SPDX-License-Identifier: BSD-3-Clause
"""Play episodes of the Gymnasium environment with a simple controller: turn to the goal, slow down near obstacles."""
import sys

import gymnasium
import numpy as np

from m2wr_sim.api import gym_env


def controller(observation):
    """Return an action for an observation."""
    ahead, aside = observation["goal"]
    bearing = np.arctan2(aside, ahead)
    nearest = observation["scan"][24:48].min()                  # the middle third: 60 degrees
    speed = 0.5 * max(0.0, np.cos(bearing)) * np.clip(nearest - 0.5, 0.0, 1.0)
    return np.array([speed, np.clip(2.0 * bearing, -1.0, 1.0)], np.float32)


def main(episodes=5):
    env = gymnasium.make(gym_env.ENV_ID)
    for seed in range(episodes):
        observation, info = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            observation, reward, terminated, truncated, info = env.step(controller(observation))
            total, over = total + reward, terminated or truncated
        print("episode %d: return %6.2f after %4.1f s, %s" % (
            seed, total, info["time"], "goal" if info["is_success"] else "contact" if terminated else "time is up"))
    env.close()


if __name__ == "__main__":
    main(*[int(word) for word in sys.argv[1:2]])
