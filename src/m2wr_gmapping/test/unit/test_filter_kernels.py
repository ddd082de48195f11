# SPDX-License-Identifier: BSD-3-Clause
"""What one processed scan does to all particles, against slow plain twins."""
import math

import numpy as np
import pytest

from m2wr_gmapping.filter import filter_kernels as fk
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.ros.pose_covariance import normalise
from m2wr_maps.se2 import compose, wrap

DEVIATIONS = np.array([0.05, 0.02, 0.01])


def matches(rng, count):
    """Result rows, some of a scan that tells nothing or little along one direction."""
    rows = np.zeros((count, mk.RESULT_SIZE))
    rows[:, :3] = rng.uniform(-3.1, 3.1, (count, 3))
    rows[:, mk.COST], rows[:, mk.LOG_LIKELIHOOD] = rng.uniform(0.0, 50.0, count), -rng.uniform(0.0, 500.0, count)
    for row in rows:
        root = rng.normal(size=(3, 3)) * 10.0**rng.uniform(-1.0, 3.0, 3)[:, None] * rng.integers(0, 2, (3, 1))
        row[mk.INFORMATION:] = (root.T @ root)[np.triu_indices(3)]
    return rows


@pytest.mark.parametrize("count", [1, 2, 50])
def test_draws_equal_reference(count):
    rng = np.random.default_rng(count)
    rows, normals, before = matches(rng, count), rng.normal(size=(count, 3)), rng.normal(size=count)
    sums, poses = before.copy(), np.empty((count, 3))
    best = fk.draw(rows, DEVIATIONS, normals, 0.3, 10.0, sums, poses)
    wanted = before - rows[:, mk.COST] / 10.0
    assert best == wanted.argmax() and (poses[best] == rows[best, :3]).all() and sums[best] == wanted[best]
    for n in range(count):
        if n != best:
            h = np.zeros((3, 3))
            h[np.triu_indices(3)] = rows[n, mk.INFORMATION:]
            h = h + h.T - np.diag(h.diagonal()) + np.diag(1.0 / np.square(DEVIATIONS))
            drawn = np.linalg.inv(np.linalg.cholesky(h).T) @ (0.3 * normals[n])
            away = poses[n] - compose(rows[n, :3], drawn)
            assert np.abs([*away[:2], wrap(away[2])]).max() < 1e-9
            assert sums[n] == pytest.approx(wanted[n] - 0.5 * np.square(0.3 * normals[n]).sum())


def test_draws_have_the_combined_covariance():
    rng, count = np.random.default_rng(1), 40001
    rows = np.repeat(matches(rng, 1), count, axis=0)
    root = rng.normal(size=(3, 3)) * 30.0
    rows[:, mk.INFORMATION:], rows[0, mk.COST] = (root.T @ root)[np.triu_indices(3)], -1.0
    rows[:, :3], poses = 0.0, np.empty((count, 3))
    assert fk.draw(rows, DEVIATIONS, rng.normal(size=(count, 3)), 1.0, 10.0, np.zeros(count), poses) == 0
    wanted = np.linalg.inv(root.T @ root + np.diag(1.0 / np.square(DEVIATIONS)))
    size = np.sqrt(wanted.diagonal())
    assert np.abs(np.cov(poses[1:].T) - wanted).max() < 0.05 * size.max()**2


@pytest.mark.parametrize("count", [1, 30])
def test_weights_equal_reference(count):
    rng = np.random.default_rng(count)
    rows, logs, weights = matches(rng, count), -rng.uniform(0.0, 300.0, count), np.empty(count)
    wanted = logs + rows[:, mk.LOG_LIKELIHOOD]
    fk.weigh(rows, mk.LOG_LIKELIHOOD, 20.0, logs, weights)
    assert np.allclose(logs, wanted) and np.allclose(weights, normalise(wanted, 20.0))
    assert math.isclose(weights.sum(), 1.0)
