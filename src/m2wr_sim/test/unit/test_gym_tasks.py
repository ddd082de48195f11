# SPDX-License-Identifier: BSD-3-Clause
"""Following a wall pays at the wanted distance; exploring pays for each cell once."""
import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the optional Python package gymnasium is not installed")

from m2wr_sim.api import read_robot  # noqa: E402
from m2wr_sim.api.gym_tasks import ExplorationEnv, WallFollowingEnv  # noqa: E402

WALL = """<sdf version="1.6"><world name="w"><model name="ground"><static>true</static><link name="link">
  <collision name="plane"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link></model>
  <model name="wall"><static>true</static><pose>0 {y} 0.5 0 0 0</pose><link name="link"><collision name="box">
  <geometry><box><size>40 0.2 1</size></box></geometry></collision></link></model></world></sdf>"""
STRAIGHT = np.array([0.5, 0.0], np.float32)


def follow(y, steps=20):
    """Drive along a wall whose near side is 0.1 m above y; return the rewards, the last info, and the end."""
    env = WallFollowingEnv(WALL.format(y=y), step=0.01, distance=0.7)
    env.reset(seed=1, options={"start": (0.0, 0.0, 0.0)})
    results = [env.step(STRAIGHT) for _ in range(steps)]
    env.close()
    return [result[1] for result in results], results[-1][4], results[-1][2]


def test_driving_at_the_wanted_distance_pays_the_way():
    rewards, info, ended = follow(y=-0.8)
    assert info["wall"] == pytest.approx(0.7, abs=0.03) and not ended and info["contacts"] == 0
    assert np.mean(rewards[-10:]) == pytest.approx(0.05, abs=0.003)          # 0.5 m/s for 0.1 s


def test_driving_too_far_from_the_wall_pays_less():
    rewards, info, _ = follow(y=-1.1)
    assert info["wall"] == pytest.approx(1.0, abs=0.03)
    assert np.mean(rewards[-10:]) == pytest.approx(0.05 / math.e, abs=0.005)


def test_a_contact_with_the_wall_costs_and_ends():
    env = WallFollowingEnv(WALL.format(y=-0.8), step=0.01)
    env.reset(seed=1, options={"start": (0.0, 0.0, -math.pi / 2)})
    ended, rewards = False, []
    while not ended and len(rewards) < 50:
        _, reward, ended, _, info = env.step(STRAIGHT)
        rewards.append(reward)
    env.close()
    assert ended and info["contacts"] > 0 and rewards[-1] < -9.0 and min(rewards[:-1]) >= -0.01


def test_each_cell_is_paid_once():
    env = ExplorationEnv(WALL.format(y=-0.8), step=0.01, area=(-8.0, 8.0, -8.0, 8.0))
    observation, info = env.reset(seed=1, options={"start": (0.0, 0.0, math.pi / 2)})
    assert env.observation_space.contains(observation) and observation["known"].shape == (256,)
    first = info["explored"]
    assert 0.3 < first < 0.6                                # half a disc of 10 m, cut by the area
    known = observation["known"].reshape(16, 16)
    assert known[15, 8] > 0.5 and known[0].max() == 0.0     # ahead, and behind the wall
    assert sum(env.step(np.zeros(2, np.float32))[1] for _ in range(3)) < 1.0              # nothing new but noise
    rewards, before = [], env.step(np.zeros(2, np.float32))[4]["explored"]
    for _ in range(10):
        observation, reward, ended, _, info = env.step(np.array([0.0, 1.0], np.float32))
        rewards.append(reward)
    env.close()
    assert not ended and sum(rewards) == pytest.approx(0.05 * 64 * 64 * (info["explored"] - before))
    assert info["explored"] > first + 0.02 and observation["pose"][2] == pytest.approx(math.pi / 2 + 0.95, abs=0.1)


def test_a_new_episode_knows_nothing():
    env = ExplorationEnv(WALL.format(y=-0.8), step=0.01)
    start = {"start": (0.0, 0.0, math.pi / 2)}
    first = env.reset(seed=1, options=start)[1]["explored"]
    for _ in range(5):
        env.step(np.array([0.6, 1.0], np.float32))
    again = env.reset(seed=1, options=start)[1]["explored"]
    env.close()
    assert again == first


def test_a_far_reaching_laser_does_not_slow_a_step_down():
    model = read_robot("m2wr")
    links = tuple(replace(link, sensors=tuple(
        sensor if sensor.ray is None else replace(sensor, ray=replace(sensor.ray, range_max=1e12))
        for sensor in link.sensors)) for link in model.links)
    env = ExplorationEnv(WALL.format(y=-0.8), replace(model, links=links), step=0.01)
    _, info = env.reset(seed=1, options={"start": (0.0, 0.0, math.pi / 2)})
    env.close()
    assert 0.4 < info["explored"] < 0.6                     # all that is ahead, in a part of a second


@pytest.mark.parametrize("kind, options, text", [
    (WallFollowingEnv, {"distance": 0.0}, "distance 0.0"), (WallFollowingEnv, {"width": math.nan}, "width nan"),
    (ExplorationEnv, {"cell": 5.0}, "cell 5.0"), (ExplorationEnv, {"cell": 0.001}, "cell 0.001"),
    (ExplorationEnv, {"area": (0.0, 1e6, 0.0, 1e6)}, "4096 cells")])
def test_unusable_options_are_refused(kind, options, text):
    with pytest.raises(ValueError, match=text):
        kind("empty", **options)
