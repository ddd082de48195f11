# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses, motion model, resampling, trajectory tree, pose graph and threads."""
import math
import queue
import threading

import numpy as np
import pytest

from m2wr_gmapping.backend import loop_graph
from m2wr_gmapping.backend.pose_graph import optimise
from m2wr_gmapping.filter import resampling
from m2wr_gmapping.filter.motion_model import MotionNoise, sample_motion
from m2wr_gmapping.filter.trajectory import TrajectoryTree
from m2wr_gmapping.se2 import between, compose, inverse, wrap
from m2wr_gmapping.workers import Workers


def test_poses_compose_and_invert():
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-4, 4, (50, 3)), rng.uniform(-4, 4, (50, 3))
    assert np.allclose(wrap(between(a, compose(a, b)) - b)[:, 2], 0.0)
    assert np.allclose(between(a, compose(a, b))[:, :2], b[:, :2])
    assert np.allclose(compose(a, inverse(a)), 0.0)
    assert -math.pi <= compose([0, 0, 3.0], [0, 0, 3.0])[2] < math.pi


def test_poses_come_out_the_same_wherever_they_lie_in_memory():
    rng = np.random.default_rng(3)
    poses = rng.normal(size=(196, 3))
    found = set()
    for _ in range(400):
        scattered = [np.empty(size) for size in rng.integers(1, 4000, int(rng.integers(1, 30)))]
        copy = poses.copy()
        found.add((compose(copy, poses[0]).tobytes(), between(copy, poses[0]).tobytes(), inverse(copy).tobytes()))
        del scattered
    assert len(found) == 1


def test_motion_noise_follows_the_step():
    noise = MotionNoise(0.1, 0.2, 0.3, 0.4)
    assert np.allclose(noise.deviations([1.0, 0.0, 0.0]), [0.1, 0.03, 0.2])
    assert np.allclose(noise.deviations([0.0, 0.0, -2.0]), [0.6, 0.6, 0.8])
    assert np.allclose(noise.deviations([0.0, 0.0, 0.0]), 0.0)


def test_samples_have_the_model_s_mean_and_deviation():
    noise, step = MotionNoise(0.1, 0.05, 0.02, 0.1), np.array([0.5, 0.1, 0.3])
    normals = np.random.default_rng(1).standard_normal((200000, 3))
    poses = sample_motion(np.tile([1.0, 2.0, 0.7], (200000, 1)), step, noise, normals)
    moved = between(np.array([1.0, 2.0, 0.7]), poses)
    assert np.allclose(moved.mean(axis=0), step, atol=1e-3)
    assert np.allclose(moved.std(axis=0), noise.deviations(step), rtol=0.02)


def test_bad_steps_are_refused():
    with pytest.raises(ValueError, match="not finite"):
        sample_motion(np.zeros((2, 3)), [np.inf, 0, 0], MotionNoise(), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="one row"):
        sample_motion(np.zeros((2, 3)), [0, 0, 0], MotionNoise(), np.zeros((3, 3)))


def test_weights_effective_number_and_entropy():
    even = resampling.normalise(np.full(8, -1e4), 24.0)
    assert np.allclose(even, 1 / 8) and resampling.effective_number(even) == pytest.approx(8.0)
    assert resampling.entropy(even) == pytest.approx(math.log(8))
    one = resampling.normalise(np.array([0.0, -1e9, -1e9]), 1.0)
    assert resampling.effective_number(one) == pytest.approx(1.0) and resampling.entropy(one) == 0.0


@pytest.mark.parametrize("seed", range(10))
def test_resampling_draws_what_a_plain_wheel_draws(seed):
    rng = np.random.default_rng(seed)
    weights = rng.random(20)**4
    weights /= weights.sum()
    start = rng.random()
    plain = [next(i for i in range(20) if weights[:i + 1].sum() > (start + k) / 20 or i == 19) for k in range(20)]
    ancestors = resampling.systematic_resample(weights, start)
    assert sorted(ancestors) == sorted(plain)
    assert all(ancestors[i] == i for i in set(plain))       # survivors keep their place


def test_tree_keeps_every_path_and_nothing_else():
    rng, tree, count = np.random.default_rng(2), TrajectoryTree(10), 10
    paths = [[] for _ in range(count)]
    for _ in range(300):
        if rng.random() < 0.5:
            ancestors = rng.integers(0, count, count)
            tree.resample(ancestors)
            paths = [list(paths[a]) for a in ancestors]
        poses = rng.random((count, 3))
        tree.extend(poses)
        for path, pose in zip(paths, poses):
            path.append(pose)
    for particle in range(count):
        assert np.array_equal(tree.path(particle), paths[particle])
    assert len(tree) == len({tuple(path[k]) + (k,) for path in paths for k in range(300)})
    depth = tree.common_depth()
    assert len({path[depth - 1].tobytes() for path in paths}) == 1
    assert len({path[depth].tobytes() for path in paths}) > 1


def test_replaced_past_is_everybody_s():
    tree, rng = TrajectoryTree(4), np.random.default_rng(3)
    for _ in range(5):
        tree.extend(rng.random((4, 3)))
    past, last = rng.random((4, 3)), rng.random((4, 3))
    tree.replace(past, last)
    assert len(tree) == 8 and tree.depth == 5 and tree.common_depth() == 4
    for particle in range(4):
        assert np.array_equal(tree.path(particle), np.vstack([past, last[particle]]))
    tree.resample(np.array([1, 1, 1, 1]))
    assert len(tree) == 5


def ring_graph(rng, noise):
    """A ring of poses, its steps with noise, and the link that closes it."""
    truth = [np.zeros(3)]
    for _ in range(39):
        truth.append(compose(truth[-1], [1.0, 0.0, 2 * math.pi / 40]))
    truth = np.array(truth)
    pairs = np.array([(k, k + 1) for k in range(39)] + [(0, 39)])
    measured = between(truth[pairs[:, 0]], truth[pairs[:, 1]])
    measured[:-1] += rng.normal(0.0, noise, (39, 3))
    start = [np.zeros(3)]
    for step in measured[:-1]:
        start.append(compose(start[-1], step))
    return truth, np.array(start), pairs, measured


def test_graph_without_noise_is_solved_from_a_bad_start():
    rng = np.random.default_rng(4)
    truth, start, pairs, measured = ring_graph(rng, 0.0)
    start[1:] += rng.normal(0.0, 0.1, (39, 3))
    found, _ = optimise(start, pairs, measured, np.tile(np.eye(3), (40, 1, 1)), np.zeros(40, bool))
    assert np.allclose(found[:, :2], truth[:, :2], atol=1e-6)


def test_a_link_closes_a_ring_and_a_wrong_one_is_outweighed():
    rng = np.random.default_rng(5)
    truth, start, pairs, measured = ring_graph(rng, 0.02)
    information = np.tile(np.eye(3) / 0.02**2, (41, 1, 1))
    found, _ = optimise(start, pairs, measured, information[:40], pairs[:, 1] - pairs[:, 0] > 1)
    before, after = (np.hypot(*(p - truth)[:, :2].T).mean() for p in (start, found))
    assert after < 0.7 * before
    wrong = np.vstack([pairs, [[5, 30]]]), np.vstack([measured, [[0.0, 0.0, 0.0]]])
    robust = wrong[0][:, 1] - wrong[0][:, 0] > 1
    held, weights = optimise(start, *wrong, information, robust, 12.0)
    assert weights[-1] < 0.01 < 0.5 < weights[-2]
    nominal, _ = optimise(start, pairs, measured, information[:40], robust[:40], 12.0)
    assert np.hypot(*(held - nominal)[:, :2].T).max() < 0.1


@pytest.mark.parametrize("threads, count", [(1, 7), (2, 7), (3, 100), (4, 1)])
def test_workers_cover_every_particle_once(threads, count):
    done, workers = [], Workers(threads)
    workers.run(lambda first, last: done.extend(range(first, last)), count)
    assert sorted(done) == list(range(count))
    workers.close()


def test_what_a_worker_raises_is_raised_and_it_goes_on():
    workers, done = Workers(2), []
    with pytest.raises(ZeroDivisionError):
        workers.run(lambda first, last: 1 // 0, 50)

    def elsewhere(first, last):             # only the helper fails, and it has the time to begin
        if threading.current_thread() is not threading.main_thread():
            begun.set()
            raise ZeroDivisionError
        assert begun.wait(10.0), "no helper has begun within 10 s"

    begun = threading.Event()
    with pytest.raises(ZeroDivisionError):
        workers.run(elsewhere, 50)
    workers.run(lambda first, last: done.extend(range(first, last)), 50)
    assert sorted(done) == list(range(50))
    workers.close()


def test_threads_end_with_their_owner():
    workers = Workers(3)
    workers.run(lambda first, last: None, 50)
    helpers = list(workers._helpers)
    del workers
    for helper in helpers:
        helper.join(10.0)
        assert not helper.is_alive()


def test_a_helper_that_comes_too_late_is_not_waited_for():
    workers, done, begun, go_on, left = Workers(2), [], threading.Event(), threading.Event(), queue.SimpleQueue()

    def busy():             # as if its core were
        begun.set()
        go_on.wait(20.0)

    workers._shares.put((busy, left))
    assert begun.wait(10.0), "the helper has not begun within 10 s"
    workers._shares.put((busy, left))       # of a run that was interrupted: not taken for a share of the next
    workers.run(lambda first, last: done.extend(range(first, last)), 50)
    assert sorted(done) == list(range(50)) and not go_on.is_set() and workers._shares.empty()
    go_on.set()
    assert left.get(timeout=10.0) is None
    workers.close()


@pytest.mark.parametrize("seed", range(3))
def test_covariance_of_a_match_agrees_with_the_library(seed):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    h = root @ root.T * 50.0
    prior, floor = np.array([0.1, 0.2, 0.05]), np.array([1e-4, 2e-4, 3e-5])
    wanted = np.linalg.inv(h / loop_graph.DEPENDENT + np.diag(prior**-2)) + np.diag(floor)
    upper = h[np.triu_indices(3)]
    found = loop_graph.covariance(upper, prior, floor)
    assert np.allclose(found, wanted) and np.allclose(loop_graph.inverse_symmetric(found), np.linalg.inv(wanted))


def test_new_nodes_and_paths_equal_their_plain_twin():
    rng, count = np.random.default_rng(6), 5
    tree, paths, serials, made = TrajectoryTree(count), [[] for _ in range(count)], [[] for _ in range(count)], 0
    for k in range(600):
        poses = rng.normal(size=(count, 3))
        tree.extend(poses)
        paths = [path + [pose] for path, pose in zip(paths, poses)]
        serials = [known + [made + n] for n, known in enumerate(serials)]
        made += count
        if k % 3 == 0:
            ancestors = np.sort(rng.integers(0, count, count))
            tree.resample(ancestors)
            paths, serials = [paths[a] for a in ancestors], [serials[a] for a in ancestors]
        if k % 250 == 100:              # all on one path, after a loop was closed
            past, last = rng.normal(size=(k, 3)), rng.normal(size=(count, 3))
            tree.replace(past, last)
            paths = [list(past) + [pose] for pose in last]
            common = list(range(made, made + k))
            serials = [common + [made + k + n] for n in range(count)]
            made += k + count
        if k % 50 == 0 or k == 599:
            for n in range(count):
                assert (tree.path(n) == np.array(paths[n])).all() and tree.keys(n).tolist() == serials[n]
            assert len(tree) == len({number for known in serials for number in known})
