# SPDX-License-Identifier: BSD-3-Clause
"""Optimisation of the pose graph."""
import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from m2wr_maps.pose_graph import optimise
from m2wr_maps.se2 import between, compose


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


def test_noise_free_graph_converges_from_a_bad_start():
    rng = np.random.default_rng(4)
    truth, start, pairs, measured = ring_graph(rng, 0.0)
    start[1:] += rng.normal(0.0, 0.1, (39, 3))
    found, _ = optimise(start, pairs, measured, np.tile(np.eye(3), (40, 1, 1)), np.zeros(40, bool))
    assert np.allclose(found[:, :2], truth[:, :2], atol=1e-6)


def test_loop_is_closed_and_outlier_is_down_weighted():
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


def test_narrowing_kernel_closes_a_large_loop():
    truth = [np.zeros(3)]
    for _ in range(199):
        truth.append(compose(truth[-1], [0.5, 0.0, 2 * math.pi / 200]))
    truth = np.array(truth)
    pairs = np.array([(k, k + 1) for k in range(199)] + [(0, 199)])
    measured = between(truth[pairs[:, 0]], truth[pairs[:, 1]])
    measured[:-1, 2] += 0.003
    start = [np.zeros(3)]
    for step in measured[:-1]:
        start.append(compose(start[-1], step))
    assert np.hypot(*(np.array(start) - truth)[-1, :2]) > 4.0
    information = np.tile(np.diag(1.0 / np.square([0.01, 0.01, 0.004])), (200, 1, 1))
    robust = np.arange(200) == 199
    found, weights = optimise(start, pairs, measured, information, robust, 12.0, True)
    assert weights[-1] > 0.5 and np.hypot(*(found - truth)[:, :2].T).max() < 0.2


def random_graph(seed, wrong):
    """A walk of 12 poses with noisy steps, 6 noisy links, of which ``wrong`` are far off, and full covariances."""
    rng = np.random.default_rng(seed)
    truth = [np.zeros(3)]
    for _ in range(11):
        truth.append(compose(truth[-1], [1.0, 0.0, rng.uniform(-0.8, 0.8)]))
    truth = np.array(truth)
    links = np.array([sorted(rng.choice(12, 2, replace=False)) for _ in range(6)])
    pairs = np.vstack([np.column_stack([np.arange(11), np.arange(1, 12)]), links])
    robust = np.arange(len(pairs)) >= 11
    roots = rng.normal(0.0, 0.01, (len(pairs), 3, 3)) + 0.03 * np.eye(3)
    covariances = roots @ roots.transpose(0, 2, 1)
    measured = between(truth[pairs[:, 0]], truth[pairs[:, 1]])
    measured += np.array([rng.multivariate_normal(np.zeros(3), covariance) for covariance in covariances])
    measured[11:11 + wrong, :2] += 1.5
    start = [np.zeros(3)]
    for step in measured[:11]:
        start.append(compose(start[-1], step))
    return np.array(start), pairs, measured, np.linalg.inv(covariances), robust


def cost_terms(poses, pairs, measured, roots, robust, kernel):
    """Terms whose squares add up to the cost: whitened residuals, and one Cauchy term for each robust measurement."""
    errors = between(measured, between(poses[pairs[:, 0]], poses[pairs[:, 1]]))
    errors[:, 2] = np.remainder(errors[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    whitened = np.einsum("eji,ej->ei", roots, errors)
    cauchy = np.sqrt(kernel * np.log1p((whitened[robust] ** 2).sum(axis=1) / kernel))
    return np.concatenate([whitened[~robust].ravel(), cauchy])


@pytest.mark.parametrize("wrong", [0, 1])
@pytest.mark.parametrize("seed", range(4))
def test_the_minimum_is_that_of_another_solver(seed, wrong):
    """SciPy's trust-region solver minimises the same cost from the result and from the start."""
    start, pairs, measured, information, robust = random_graph(seed, wrong)
    kernel, roots = 12.0, np.linalg.cholesky(information)

    def terms(flat):
        return cost_terms(np.vstack([start[:1], flat.reshape(-1, 3)]), pairs, measured, roots, robust, kernel)

    found, _ = optimise(start, pairs, measured, information, robust, kernel)
    cost = np.sum(terms(found[1:].ravel()) ** 2)
    near, far = (least_squares(terms, begin[1:].ravel(), method="lm", max_nfev=4000) for begin in (found, start))
    assert cost <= 2.0 * min(near.cost, far.cost) * (1.0 + 1e-4)
    moved = near.x.reshape(-1, 3) - found[1:]
    assert np.abs(moved[:, :2]).max() < 1e-3
    assert max(abs(math.remainder(angle, 2.0 * math.pi)) for angle in moved[:, 2]) < 1e-3
