# SPDX-License-Identifier: BSD-3-Clause
"""Small kernels on paths and their nodes, against plain twins."""
import numpy as np
import pytest

from m2wr_gmapping.backend import drift_kernels as gk
from m2wr_gmapping.backend.loop_graph import STEP_FLOOR, LoopGraph, covariance, distances_along
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend.matcher import FastMatcher
from m2wr_gmapping.workers import Workers


def walk(seed, count):
    """A path of that many nodes that comes back to where it was, and its length up to each node."""
    rng = np.random.default_rng(seed)
    turns = 2.0 * np.pi * 1.7 * np.arange(count) / max(1, count)
    path = np.stack([8.0 * np.cos(turns), 8.0 * np.sin(turns), turns], -1) + rng.normal(0.0, 0.05, (count, 3))
    return path, distances_along(path)


@pytest.mark.parametrize("count", [1, 2, 200])
def test_drift_equals_reference(count):
    path, along = walk(count, count)
    wanted = [sum(float(np.hypot(*(b - a)[:2])) for a, b in zip(path[:k], path[1:k + 1])) for k in range(count)]
    assert along == pytest.approx(np.array(wanted))


@pytest.mark.parametrize("node", [0, 5, 120, 199])
def test_loop_candidates_equal_reference(node):
    path, along = walk(3, 200)
    shift = np.random.default_rng(node).uniform(0.5, 4.0, 200)
    old = [k for k in range(200) if along[node] - along[k] > 12.0]
    count = gk.old_nodes(along, node, 12.0)
    assert old == list(range(count))
    numbers = np.full((2, 200), -1)
    near, far = gk.loop_candidates(path[:node + 1], shift, count, 1.3, 2.0, 2.0, numbers)
    again = [k for k in old if np.hypot(*(path[k] - path[node])[:2]) < 1.3 * shift[k] + 2.0]
    assert numbers[0, :near].tolist() == [k for k in again if shift[k] <= 2.0]
    assert numbers[1, :far].tolist() == [k for k in again if shift[k] > 2.0]
    assert node < 199 or (near and far)


def test_search_widths_equal_reference():
    rng = np.random.default_rng(0)
    found, shift, turn = 10.0**rng.uniform(-3.0, 5.0, (300, 3)), np.empty(300), np.empty(300)
    gk.widths(found, 2.5, 0.0005, (0.5, 30.0), (0.1, 0.6), shift, turn)
    assert np.allclose(shift, np.minimum(0.5 + 2.5 * (0.0005 * found[:, 0] + np.sqrt(found[:, 1])), 30.0))
    assert np.allclose(turn, np.minimum(0.1 + 2.5 * 0.0005 * found[:, 2], 0.6))
    assert shift.min() < 0.6 and shift.max() == 30.0 and turn.min() < 0.11 and turn.max() == 0.6


@pytest.mark.parametrize("seed", range(4))
def test_step_information_is_the_inverse_covariance(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * 10.0**rng.uniform(-1.0, 3.0, (3, 1))
    told, deviations, out = (root.T @ root)[np.triu_indices(3)], rng.uniform(0.01, 0.3, 3), np.empty((3, 3))
    variance = gk.step_information(told, 10.0, deviations, STEP_FLOOR, out)
    found = covariance(told, deviations, STEP_FLOOR)
    assert variance == pytest.approx(found[0, 0] + found[1, 1])
    assert out @ found == pytest.approx(np.eye(3), abs=1e-6) and (out == out.T).all()


@pytest.mark.parametrize("forward, turn, yaw", [(0.5, 0.0, 0.0), (-0.4, 0.3, 2.5), (0.0, 0.4, -1.0)])
def test_bias_moves_only_unobserved_directions(forward, turn, yaw):
    """A match is the mean of scan and odometry, weighted by their information."""
    rng = np.random.default_rng(5)
    root, deviations = rng.normal(size=(3, 3)) * [40.0, 5.0, 30.0], np.array([0.01, 0.02, 0.015])
    held, prior = root.T @ root, np.diag(1.0 / np.square(deviations))
    c, s = np.cos(yaw), np.sin(yaw)
    leads = np.array([[c * forward, -0.5 * s * forward * turn, -0.5 * s * forward**2],
                      [s * forward, 0.5 * c * forward * turn, 0.5 * c * forward**2], [0.0, turn, forward]])
    out = np.empty((3, 3))
    gk.bias_jacobian(held[np.triu_indices(3)], deviations, np.array([forward, turn, yaw]), out)
    assert out == pytest.approx(np.linalg.solve(held + prior, prior @ leads), rel=1e-9, abs=1e-12)


def test_smoothed_bias_equals_batch_least_squares():
    rng, count, variance, changes = np.random.default_rng(8), 30, 9e-4, np.array([3e-7, 0.0, 5e-7])
    accounts, leverages = np.zeros((count, 6, 3)), rng.normal(size=(count, 3, 3))
    for k in [0, 0, 0, *rng.integers(0, count, 12)]:
        row = rng.normal(size=3)
        accounts[k, :3] += 2e3 * np.outer(row, row)
        accounts[k, 3] += 2e3 * row * (row @ [0.02, -0.01, 0.03] + rng.normal(0.0, 0.02))
    accounts[:, 4] = rng.normal(0.0, 0.01, (count, 3))
    accounts[:, 5, 0] = rng.uniform(-0.2, 1.0, count)
    # the second value never changes; the others walk, and what the first node tells keeps them below their limit
    matrix, wanted = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    matrix[:3, :3] += np.eye(3) / variance
    for k in range(count):
        here = slice(3 * k, 3 * k + 3)
        matrix[here, here] += accounts[k, :3]
        wanted[here] = accounts[k, 3]
        if k:
            tie = np.diag(1.0 / np.maximum(changes * abs(accounts[k, 5, 0]), 1e-14))
            joint = slice(3 * k - 3, 3 * k + 3)
            matrix[joint, joint] += np.block([[tie, -tie], [-tie, tie]])
    found = np.linalg.solve(matrix, wanted).reshape(-1, 3)
    out = np.empty((count, 3))
    gk.smooth_bias(accounts, leverages, variance, changes, out)
    assert np.abs(found).min() > 1e-3
    assert out == pytest.approx(np.einsum("kij,kj->ki", leverages, found - accounts[:, 4]), abs=1e-6)


def test_path_length_uses_the_smoothed_bias():
    """Wheels that tell 3 % too much along a plain corridor; only near its end scans tell of it."""
    graph = LoopGraph(FastMatcher(GmappingConfig.from_mapping({}), Workers(1)), 0.05)
    sees, path = np.array([1e-6, 0.0, 0.0, 2e4, 0.0, 2e4]), np.zeros((101, 3))
    for k in range(1, 101):
        account = np.zeros((6, 3))
        account[5, 0] = 0.5
        if k > 60:
            account[0, 0], account[3, 0] = 5e4, -0.03 * 5e4
        graph.add_step(sees, np.full(3, 0.01), account)
        path[k, 0] = path[k - 1, 0] + 0.5 * 1.03
    graph.links.append((0, 20, np.array([20 * 0.5, 0.0, 0.0]), np.diag([1e-4, 2e3, 1e4])))
    bent = graph.solve(path)
    assert bent[60, 0] == pytest.approx(30.0, abs=0.1)      # 30.9 without
    assert bent[100, 0] == pytest.approx(50.0, abs=0.1)


def test_changed_step_stays_changed():
    """Of more steps than there is room for at first."""
    graph, path = LoopGraph(FastMatcher(GmappingConfig.from_mapping({}), Workers(1)), 0.05), np.zeros((1200, 3))
    path[:, 0] = 0.5 * np.arange(1200)
    for _ in path[1:]:
        graph.add_step(np.array([2e4, 0.0, 0.0, 2e4, 0.0, 2e4]), np.full(3, 0.02), np.zeros((6, 3)))
    graph.links.append((0, 20, np.array([10.0, 0.0, 0.0]), np.eye(3)))
    assert graph.solve(path) is None
    changes = np.zeros_like(path)
    changes[1100, 1] = 0.2
    graph.change_steps(changes)
    path[1100:, 1] += 0.2
    assert graph.solve(path) is None and graph.closures == 0
    path[1100:, 1] -= 0.2
    assert graph.solve(path)[-1, 1] == pytest.approx(0.2, abs=0.001)
