# SPDX-License-Identifier: BSD-3-Clause
"""Small kernels on paths and their nodes, against plain twins."""
import numpy as np
import pytest

from m2wr_gmapping.backend import drift_kernels as gk
from m2wr_gmapping.backend.loop_graph import distances_along


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
    near, far = gk.loop_candidates(path[:node + 1], shift, count, 1.3, 2.0, numbers)
    again = [k for k in old if np.hypot(*(path[k] - path[node])[:2]) < 1.3 * shift[k] + 2.0]
    assert numbers[0, :near].tolist() == [k for k in again if shift[k] <= 2.0]
    assert numbers[1, :far].tolist() == [k for k in again if shift[k] > 2.0]
    assert node < 199 or (near and far)
