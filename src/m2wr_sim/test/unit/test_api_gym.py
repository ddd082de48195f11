# SPDX-License-Identifier: BSD-3-Clause
"""The Gymnasium environment: passes the library's own check, pays for progress, ends at the goal and at a contact."""
import math
import subprocess
import sys
import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the optional Python package gymnasium is not installed")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from m2wr_sim.api import gym_env, read_robot, read_world  # noqa: E402
from m2wr_sim.api.gym_base import check_render_mode  # noqa: E402


@pytest.fixture(scope="module")
def scene():
    """Return a world and a robot, read once."""
    return {"world": read_world("world02"), "robot": read_robot("m2wr")}


@pytest.fixture
def env(scene):
    """Return an environment."""
    made = gym_env.GoToGoalEnv(**scene)
    yield made
    made.close()


def drive(env, observation, limit=1000):
    """Turn to the goal and drive; returns rewards, the last step's result and the observations."""
    rewards, seen = [], [observation]
    for _ in range(limit):
        bearing = math.atan2(observation["goal"][1], observation["goal"][0])
        action = np.array([0.5 * max(0.0, math.cos(bearing)), np.clip(2.0 * bearing, -1.0, 1.0)], np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
        seen.append(observation)
        if terminated or truncated:
            break
    return rewards, (terminated, truncated, info), seen


@pytest.mark.parametrize("name, mode", [(gym_env.ENV_ID, "rgb_array")] + [
    (name, None) for name in gym_env.ENVIRONMENTS])
def test_passes_the_checker_without_a_warning(name, mode):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        env = gymnasium.make(name, render_mode=mode)
        try:
            check_env(env.unwrapped)
        finally:
            env.close()
    assert [str(one.message) for one in said if "ymnasium" in str(one.filename) or one.category is UserWarning] == []


def test_it_is_drawn_from_above(scene):
    env = gym_env.GoToGoalEnv(render_mode="rgb_array", **scene)
    try:
        with pytest.raises(RuntimeError, match="before reset"):
            env.render()
        env.reset(seed=1, options={"start": (0.0, 8.0, 0.0), "goal": (3.0, 8.0)})
        first = env.render()
        for _ in range(20):
            env.step(np.array([0.6, 0.0], np.float32))
        later = env.render()
        for picture in (first, later):
            assert picture.shape == (800, 800, 3) and picture.dtype == np.uint8 and len(np.unique(picture)) > 20
        assert (first != later).any()           # it has driven
        env.reset(seed=1, options={"start": (0.0, 8.0, 0.0), "goal": (3.0, 8.0)})
        assert (env.render() == first).all()    # and the trail is gone
    finally:
        env.close()


def test_without_pictures_nothing_that_draws_is_loaded():
    program = ("import sys; from m2wr_sim.api import gym_env; env = gym_env.GoToGoalEnv(); env.reset(); "
               "assert env.render() is None; sys.exit('cairo' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


def test_made_by_name_with_options_and_vectorised():
    env = gymnasium.make("m2wr_sim.api.gym_env:m2wr/GoToGoal-v0", beams=36, duration=0.2)
    observation, info = env.reset(seed=1)
    assert observation["scan"].shape == (36,) and env.observation_space.contains(observation)
    assert env.step(np.zeros(2, np.float32))[4]["time"] == pytest.approx(0.2)
    env.close()
    many = gymnasium.make_vec(gym_env.ENV_ID, num_envs=2, vectorization_mode="sync")
    observations, _ = many.reset(seed=1)
    assert observations["scan"].shape == (2, 72)
    assert np.array_equal(observations["goal"], many.reset(seed=1)[0]["goal"])
    many.close()


def test_reaching_the_goal_ends_the_episode_and_pays(env):
    observation, info = env.reset(seed=0, options={"start": (0.0, 8.0, 0.0), "goal": (3.0, 7.0)})
    assert info["distance"] == pytest.approx(math.hypot(3.0, 1.0), abs=1e-6)
    assert observation["goal"] == pytest.approx((3.0, -1.0), abs=1e-5)
    rewards, (terminated, truncated, info), seen = drive(env, observation)
    assert terminated and not truncated and info["is_success"] and info["distance"] < 0.3
    progress = math.hypot(3.0, 1.0) - info["distance"]
    assert sum(rewards) == pytest.approx(progress - 0.1 * info["time"] + 10.0, abs=1e-6)
    assert all(env.observation_space.contains(one) for one in seen)
    assert np.median([one["velocity"][0] for one in seen]) == pytest.approx(0.5, abs=0.02)


def test_a_contact_ends_the_episode_and_costs(env):
    observation, _ = env.reset(seed=0, options={"start": (0.0, 7.0, -math.pi / 2), "goal": (0.0, 0.0)})
    rewards, (terminated, truncated, info), seen = drive(env, observation)        # a wall at y = 5 is in the way
    assert terminated and not truncated and not info["is_success"] and info["contacts"] > 0
    assert rewards[-1] < -9.0 and min(rewards[:-1]) > -0.2
    assert seen[-1]["scan"].min() < 0.5 < seen[0]["scan"].min()


def test_time_cuts_the_episode_off(scene):
    env = gym_env.GoToGoalEnv(time_limit=0.5, **scene)
    env.reset(seed=3)
    ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(5)]
    env.close()
    assert ends == [(False, False)] * 4 + [(False, True)]


def test_a_seed_repeats_an_episode_bit_for_bit(env, scene):
    def episode(one):
        observation, _ = one.reset(seed=7)
        rewards, end, seen = drive(one, observation, 20)
        return rewards, end, b"".join(part[name].tobytes() for part in seen for name in sorted(part))

    first = episode(env)
    env.reset(seed=8)
    env.step(np.array([0.6, 1.0], np.float32))
    assert episode(env) == first
    other = gym_env.GoToGoalEnv(**scene)
    assert episode(other) == first
    other.close()


def test_places_have_room_and_are_as_far_apart_as_asked(env):
    for seed in range(20):
        _, info = env.reset(seed=seed)
        assert 2.0 <= info["distance"] <= 6.0 and info["contacts"] == 0
        x, y = env._sim.pose()[0][:2]
        assert env._sim.clearance(x, y, ignore="m2wr") >= 0.69
        assert env._sim.clearance(*env._goal, ignore="m2wr") >= 0.69


def test_scan_holds_the_least_range_of_each_group(env):
    observation, _ = env.reset(seed=2)
    full = env._sim.observe().scan.ranges
    expected = np.minimum(full.reshape(72, 10).min(axis=1), 10.0)
    assert np.array_equal(observation["scan"], expected) and np.isfinite(observation["scan"]).all()


@pytest.mark.parametrize("options, text", [
    ({"beams": 7}, "expected a divisor of the laser's 720"),
    ({"render_mode": "ansi"}, "expected None or one of rgb_array"),
    ({"goal_radius": 3.0}, "goal_radius")])
def test_unusable_options_are_refused(scene, options, text):
    with pytest.raises(ValueError, match=text):
        gym_env.GoToGoalEnv(**dict(scene, **options))


def test_human_needs_the_live_view():
    check_render_mode("human", ["rgb_array", "human"])
    with pytest.raises(ValueError, match="'human'; expected None or one of rgb_array: the live view needs the package"):
        check_render_mode("human", ["rgb_array"])


def test_bug2_environments_have_a_fixed_start_and_goal():
    env = gymnasium.make("m2wr/Bug2World02-v0")
    headings = set()
    for seed in (1, 2):
        env.reset(seed=seed)
        (x, y, _), (_, _, z, w) = env.unwrapped._sim.pose()
        assert (x, y) == pytest.approx((0.0, 8.0)) and env.unwrapped._goal == (0.0, -4.0)
        headings.add(round(2.0 * math.atan2(z, w), 6))
    env.close()
    assert len(headings) == 2


def test_obstacles_move_beside_the_robot():
    env = gymnasium.make("m2wr/MovingObstacles-v0")
    env.reset(seed=1)
    sim = env.unwrapped._sim
    movers = [name for name in sim.models if not sim.simulator.models[name].record.static and name != "m2wr"]
    before = [sim.pose(name)[0] for name in movers]
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    moved = [math.dist(one, sim.pose(name)[0]) for one, name in zip(before, movers)]
    env.close()
    assert len(movers) >= 20 and sum(distance > 0.01 for distance in moved) >= 10


def test_an_action_that_is_not_finite_is_refused(env):
    env.reset(seed=0)
    with pytest.raises(ValueError, match="two finite numbers"):
        env.step(np.array([np.nan, 0.0], np.float32))


def test_without_gymnasium_the_message_says_what_to_install():
    code = "import sys\nsys.path[:] = %r\nsys.modules['gymnasium'] = None\nimport m2wr_sim.api.gym_env\n" % (sys.path,)
    done = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, timeout=120)
    assert done.returncode != 0
    assert "needs the Python package gymnasium, 1.0 or newer, which is not installed" in done.stderr.decode()


def test_stable_baselines_checker_has_no_warnings():
    checker = pytest.importorskip("stable_baselines3.common.env_checker",
                                  reason="the optional Python package stable-baselines3 is not installed")
    for name in gym_env.ENVIRONMENTS:
        env = gymnasium.wrappers.RescaleAction(gymnasium.make(name), np.float32(-1.0), np.float32(1.0))
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            checker.check_env(env)
        env.close()
