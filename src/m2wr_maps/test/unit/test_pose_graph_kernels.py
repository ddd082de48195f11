# SPDX-License-Identifier: BSD-3-Clause
"""The sparse solver of the pose graph against a dense one, and its elimination against the rules it must keep."""
import math

import numpy as np
import pytest

from m2wr_maps import pose_graph_kernels as kernels
from m2wr_maps.pose_graph import optimise
from m2wr_maps.se2 import between, wrap


def graph(seed, count, links, chained=True):
    """Poses, pairs with some twice and some the other way round, measurements, information matrices, weights."""
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(-5.0, 5.0, (count, 2)), rng.uniform(-3.0, 3.0, count)])
    chain = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
    if not chained:                     # a star: all are connected through one
        chain = np.stack([np.full(count - 1, count // 2), np.setdiff1d(np.arange(count), [count // 2])], -1)
    more = rng.integers(0, count, (links, 2))
    more = more[more[:, 0] != more[:, 1]]
    pairs = np.concatenate([chain, more, more[:2, ::-1]])
    measured = between(poses[pairs[:, 0]], poses[pairs[:, 1]]) + rng.normal(0.0, 0.1, (len(pairs), 3))
    roots = rng.normal(size=(len(pairs), 3, 3))
    return poses, pairs, measured, roots @ roots.transpose(0, 2, 1) + np.eye(3), rng.uniform(0.1, 1.0, len(pairs))


def slow_residual(p, q, measured):
    return between(measured, between(p, q))


def slow_step(poses, pairs, measured, information, weights):
    """Gauss-Newton step (K, 3) from a dense matrix and differences; the second pose is turned by what was measured."""
    count = len(poses)
    h, g = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    for (p, q), z, omega, weight in zip(pairs, measured, information, weights):
        theta, d = poses[p, 2] + z[2], poses[q, :2] - poses[p, :2]
        turned = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
        a, b = -np.eye(3), np.eye(3)
        a[:2, :2], b[:2, :2] = -turned, turned
        a[:2, 2] = turned @ [d[1], -d[0]]
        j = np.zeros((3, 3 * count))
        j[:, 3 * p:3 * p + 3] += a
        j[:, 3 * q:3 * q + 3] += b
        h += weight * j.T @ omega @ j
        g += weight * j.T @ omega @ slow_residual(poses[p], poses[q], z)
    return np.concatenate([np.zeros(3), np.linalg.solve(h[3:, 3:], g[3:])]).reshape(-1, 3)


SHAPES = [(2, 0, True), (3, 2, True), (30, 0, True), (30, 12, True), (40, 200, True), (25, 10, False)]


@pytest.mark.parametrize("count, links, chained", SHAPES)
def test_step_equals_dense_solver(count, links, chained):
    poses, pairs, measured, information, weights = graph(count + links, count, links, chained)
    residual, squared = np.empty((len(pairs), 3)), np.empty(len(pairs))
    kernels.residuals(poses, pairs, measured, information, residual, squared)
    wanted = np.array([slow_residual(poses[p], poses[q], z) for (p, q), z in zip(pairs, measured)])
    assert np.allclose(wrap(residual - wanted), 0.0, atol=1e-12)
    assert np.allclose(squared, np.einsum("ei,eij,ej->e", wanted, information, wanted))
    order, starts, columns, targets, slots = kernels.plan(count, pairs)
    diagonal, blocks, step = np.empty((count, 9)), np.empty((len(columns), 9)), np.empty((count, 3))
    kernels.assemble(poses, pairs, measured, information, weights, residual, columns, slots, diagonal, blocks, step)
    assert kernels.factorise(order, starts, columns, targets, diagonal, blocks)
    kernels.substitute(order, starts, columns, diagonal, blocks, step)
    assert np.allclose(step[1:], slow_step(poses, pairs, measured, information, weights)[1:], atol=1e-9)


@pytest.mark.parametrize("count, links, chained", SHAPES)
def test_elimination_order_is_valid(count, links, chained):
    _, pairs, _, _, _ = graph(count + links, count, links, chained)
    order, starts, columns, targets, slots = kernels.plan(count, pairs)
    assert sorted(order) == list(range(1, count)) and starts[-1] == len(columns)
    near = {node: set() for node in range(1, count)}
    for p, q in pairs:
        if p and q:
            near[p].add(q)
            near[q].add(p)
    for k, node in enumerate(order):
        found = columns[starts[k]:starts[k + 1]]
        assert set(found) == near[node] and len(found) == len(near[node])
        for other in found:
            near[other] = (near[other] | near[node]) - {node, other}
    assert ((slots >= 0) == (pairs != 0).all(axis=1)).all()


def test_long_chain_has_no_fill_in():
    count = 20000
    chain = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
    order, starts, columns, targets, _ = kernels.plan(count, np.concatenate([chain, [[5, 15000], [300, 19000]]]))
    assert len(columns) < 2 * count + 10 and len(targets) < count + 10


def test_unconnected_pose_is_an_error():
    with pytest.raises(ValueError, match="graph of 4 poses: expected each to be connected"):
        optimise(np.zeros((4, 3)), np.array([[0, 1], [2, 3]]), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)),
                 np.zeros(2, bool))


def test_graph_without_measurements_is_unchanged():
    poses, weights = optimise(np.array([[1.0, 2.0, 4.0]]), np.zeros((0, 2), int), np.zeros((0, 3)),
                              np.zeros((0, 3, 3)), np.zeros(0, bool))
    assert np.allclose(poses, [[1.0, 2.0, 4.0 - 2.0 * math.pi]]) and len(weights) == 0
