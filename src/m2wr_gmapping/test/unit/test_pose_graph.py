# SPDX-License-Identifier: BSD-3-Clause
"""Optimisation of the pose graph."""
import math

import numpy as np

from m2wr_gmapping.backend.pose_graph import optimise
from m2wr_gmapping.se2 import between, compose


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
