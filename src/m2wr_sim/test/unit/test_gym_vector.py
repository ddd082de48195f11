# SPDX-License-Identifier: BSD-3-Clause
"""Batched worlds give what single environments give; so do environments in processes of their own."""
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the optional Python package gymnasium is not installed")

from m2wr_sim.api import gym_env  # noqa: E402
from m2wr_sim.api.gym_vector import BatchedGoToGoal  # noqa: E402
from m2wr_sim.model.types import Box, Collision, Link, Model  # noqa: E402

OPTIONS = dict(world="world02", step=0.02, time_limit=2.0)


def actions(count, steps, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform((-0.2, -1.0), (0.8, 1.0), (steps, count, 2)).astype(np.float32)


def test_batched_worlds_equal_single_environments():
    batch = BatchedGoToGoal(3, **OPTIONS)
    singles = [gym_env.GoToGoalEnv(**OPTIONS) for _ in range(3)]
    seen, infos = batch.reset(seed=5)
    expected = [env.reset(seed=5 + index) for index, env in enumerate(singles)]
    over = np.zeros(3, bool)
    ends = 0
    for row in actions(3, 50):
        for name, values in seen.items():
            assert values.dtype == np.float32
            np.testing.assert_allclose(values, [one[0][name] for one in expected], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(infos["distance"], [one[-1]["distance"] for one in expected])
        assert batch.observation_space.contains(seen)
        seen, rewards, terminated, truncated, infos = batch.step(row)
        expected = [(env.reset()[0], 0.0, False, False, {"distance": env._distance}) if done else env.step(action)
                    for env, action, done in zip(singles, row, over)]
        np.testing.assert_allclose(rewards, [one[1] for one in expected], rtol=1e-6, atol=1e-6)
        assert terminated.tolist() == [one[2] for one in expected]
        assert truncated.tolist() == [one[3] for one in expected]
        over = terminated | truncated
        ends += over.sum()
    assert ends >= 6                    # every world has begun again
    batch.close()
    for env in singles:
        env.close()


def test_made_by_name_without_warnings(recwarn):
    many = gymnasium.make_vec("m2wr/GoToGoalWorld02-v0", num_envs=2)
    assert isinstance(many.unwrapped, BatchedGoToGoal)
    observations, _ = many.reset(seed=1)
    assert observations["scan"].shape == (2, 72)
    many.step(many.action_space.sample())
    many.close()
    assert [str(one.message) for one in recwarn if one.category is UserWarning] == []


def test_one_process_for_each_environment():
    many = gymnasium.make_vec("m2wr/GoToGoalWorld02-v0", num_envs=2, vectorization_mode="async")
    batch = gymnasium.make_vec("m2wr/GoToGoalWorld02-v0", num_envs=2)
    try:
        one, other = many.reset(seed=3)[0], batch.reset(seed=3)[0]
        for name in ("scan", "goal", "velocity"):
            np.testing.assert_allclose(one[name], other[name], rtol=1e-6, atol=1e-6)
        for row in actions(2, 3):
            one, other = many.step(row), batch.step(row)
            np.testing.assert_allclose(one[1], other[1], rtol=1e-6, atol=1e-6)
    finally:
        many.close()
        batch.close()


@pytest.mark.parametrize("arguments, text", [
    (dict(num_envs=0), "at least one world"), (dict(num_envs=1, render_mode="rgb_array"), "no pictures"),
    (dict(num_envs=1, beams=7), "divisor"), (dict(num_envs=1, each=[]), "at least one world")])
def test_unusable_options_are_refused(arguments, text):
    with pytest.raises(ValueError, match=text):
        BatchedGoToGoal(**arguments)


def test_unusable_actions_and_seeds_are_refused():
    batch = BatchedGoToGoal(2, **OPTIONS)
    with pytest.raises(ValueError, match="1 seeds for 2 worlds"):
        batch.reset(seed=[1])
    batch.reset(seed=[1, 2])
    for wrong in (np.zeros(2), np.full((2, 2), np.nan)):
        with pytest.raises(ValueError, match="2 pairs of finite numbers"):
            batch.step(wrong)
    batch.close()


def test_each_world_has_its_own_arguments_and_begins_alone():
    each = [dict(start=(0.0, 8.0), goal=(0.0, -4.0)), dict(world="world03", start=(0.0, 8.0), goal=(-7.0, -4.0))]
    batch = BatchedGoToGoal(3, each=each, step=0.02, time_limit=0.2)
    seen, infos = batch.reset(seed=1)
    np.testing.assert_allclose(infos["distance"], [12.0, np.hypot(7.0, 12.0), 12.0])
    for _ in range(2):
        seen, _, _, truncated, infos = batch.step(np.full((3, 2), 0.5))
    assert truncated.all()
    begun, infos = batch.reset(options={"reset_mask": np.array([False, True, False])})
    assert infos["time"].tolist() == [0.2, 0.0, 0.2]
    np.testing.assert_array_equal(begun["scan"][0], seen["scan"][0])
    infos = batch.step(np.zeros((3, 2)))[-1]
    assert infos["time"].tolist() == [0.0, 0.1, 0.0]        # the others begin with the next step
    with pytest.raises(ValueError, match="one truth value for each"):
        batch.reset(options={"reset_mask": np.ones(3)})
    batch.close()


def compare(batch, singles, steps, drive):
    """Step both, as long as no episode ends; return the numbers of contacts and of steps."""
    over, contacts = np.zeros(len(singles), bool), 0
    for count in range(steps):
        row = drive(count)
        seen, _, terminated, _, infos = batch.step(row)
        expected = [env.step(action) for env, action in zip(singles, row)]
        for name, values in seen.items():
            np.testing.assert_allclose(values, [one[0][name] for one in expected], rtol=1e-6, atol=1e-6)
        assert terminated.tolist() == [one[2] for one in expected]
        assert infos["time"].tolist() == [one[4]["time"] for one in expected]
        contacts += sum(one[4]["contacts"] for one in expected)
        over = terminated
        if over.any():
            break
    return contacts, count + 1


def test_compiled_and_other_worlds_in_one_batch():
    """In the last world obstacles move, so that it is not quiet."""
    each = [dict(world="world02"), dict(world="shapes", area=(-3.0, 3.0, -3.0, 3.0), distance=(0.5, 6.0)),
            dict(world="world03"), dict(world="moving_20", area=(-6.0, 6.0, -6.0, 6.0))]
    batch = BatchedGoToGoal(4, each=each, step=0.02)
    singles = [gym_env.GoToGoalEnv(step=0.02, **one) for one in each]
    seen, _ = batch.reset(seed=11)
    for index, env in enumerate(singles):
        one = env.reset(seed=11 + index)[0]
        np.testing.assert_allclose(seen["scan"][index], one["scan"], rtol=1e-6)
    assert batch._batch.quiet.tolist() == [True, True, True, False]
    rng = np.random.default_rng(2)
    assert compare(batch, singles, 15, lambda _: rng.uniform((0.0, -1.0), (0.4, 1.0), (4, 2)))[1] > 3
    batch.close()
    for env in singles:
        env.close()


def test_without_compiled_engine_worlds_are_stepped_one_by_one():
    options = dict(OPTIONS, engine="pyode")
    batch, singles = BatchedGoToGoal(2, **options), [gym_env.GoToGoalEnv(**options) for _ in range(2)]
    batch.reset(seed=5)
    for index, env in enumerate(singles):
        env.reset(seed=5 + index)
    assert not batch._batch.quiet.any()
    compare(batch, singles, 5, lambda count: np.array([[0.3, 0.1 * count], [0.2, -0.5]]))
    batch.close()
    for env in singles:
        env.close()


def test_a_contact_in_a_batch_ends_the_episode():
    options = dict(OPTIONS, time_limit=60.0)
    batch, singles = BatchedGoToGoal(2, **options), [gym_env.GoToGoalEnv(**options) for _ in range(2)]
    start = dict(start=(0.0, 8.0, 0.0), goal=(0.0, -4.0))
    batch.reset(seed=1, options=start)
    for index, env in enumerate(singles):
        env.reset(seed=1 + index, options=start)
    assert batch._batch.quiet.all()
    contacts, steps = compare(batch, singles, 300, lambda _: np.array([[0.6, 0.0], [0.05, 0.0]]))
    assert contacts and 10 < steps < 300
    batch.close()
    for env in singles:
        env.close()


def test_a_model_that_comes_between_two_steps_is_seen():
    batch = BatchedGoToGoal(2, world="empty", step=0.02)
    batch.reset(seed=1, options=dict(start=(0.0, 0.0, 0.0), goal=(20.0, 0.0)))
    commands = np.array([[0.2, 0.0], [0.2, 0.0]])
    assert batch.step(commands)[0]["scan"].min() == 10.0 and batch._batch.quiet.all()
    wall = Model("wall", (Link("link", collisions=(Collision("shape", Box((0.2, 20.0, 2.0))),)),), static=True)
    batch._worlds[0].simulator.spawn(wall, ((3.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)))
    least = batch.step(commands)[0]["scan"].min(axis=1)
    assert 2.5 < least[0] < 3.0 and least[1] == 10.0
    batch.close()
