# SPDX-License-Identifier: BSD-3-Clause
"""The old nodes that may be close to the newest one, against a plain twin."""
import numpy as np
import pytest

from m2wr_gmapping.backend.loop_graph import LoopGraph
from m2wr_gmapping.backend.route import Route, distances_along
from m2wr_gmapping.tuning import DRIFT, SEARCH


def walk(seed, count):
    """A path of that many nodes that comes back to where it was, and its length up to each node."""
    rng = np.random.default_rng(seed)
    turns = 2.0 * np.pi * 1.7 * np.arange(count) / max(1, count)
    path = np.stack([8.0 * np.cos(turns), 8.0 * np.sin(turns), turns], -1) + rng.normal(0.0, 0.05, (count, 3))
    return path, distances_along(path)


@pytest.mark.parametrize("count", [1, 2, 200])
def test_length_of_the_path_equals_reference(count):
    path, along = walk(count, count)
    wanted = [sum(float(np.hypot(*(b - a)[:2])) for a, b in zip(path[:k], path[1:k + 1])) for k in range(count)]
    assert along == pytest.approx(np.array(wanted))


@pytest.mark.parametrize("node", [0, 5, 120, 199])
def test_loop_candidates_equal_reference(node, monkeypatch):
    path, along = walk(3, 200)
    shift = np.random.default_rng(node).uniform(0.5, 4.0, 200)
    graph = LoopGraph(None, 0.05, None)
    monkeypatch.setattr(graph, "drift", lambda *_: (shift, shift))
    scene, near, far = graph.scene(Route(path, along, [None] * 200), node)
    old = [k for k in range(200) if along[node] - along[k] > SEARCH.reach]
    assert old == list(range(scene.count)) and len(scene.path) == len(scene.shift) == node + 1
    again = [k for k in old if np.hypot(*(path[k] - path[node])[:2]) < SEARCH.beyond * shift[k] + DRIFT.room]
    assert near.tolist() == [k for k in again if shift[k] <= DRIFT.room]
    assert far.tolist() == [k for k in again if shift[k] > DRIFT.room]
    assert node < 199 or (len(near) and len(far))


def test_a_correction_moves_the_nodes_that_are_not_old(monkeypatch):
    path, along = walk(3, 200)
    graph = LoopGraph(None, 0.05, None)
    monkeypatch.setattr(graph, "drift", lambda *_: (np.ones(200), np.ones(200)))
    scene, _, _ = graph.scene(Route(path, along, [None] * 200), 150, np.array([1.0, 0.0, 0.0]))
    moved = scene.path[:, :2] - path[:151, :2]
    assert not moved[:scene.count].any() and np.allclose(moved[scene.count:], [1.0, 0.0])
