# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory tree."""

import numpy as np
import pytest

from m2wr_gmapping.filter.trajectory import FIRST_NODES, TrajectoryTree


def nodes_in_use(tree):
    return len(tree.compact()["_parent"])


@pytest.mark.parametrize("count", [5, 10, FIRST_NODES + 1])
def test_tree_equals_lists_of_poses(count):
    rng, tree = np.random.default_rng(2), TrajectoryTree(count)
    paths = [[] for _ in range(count)]
    for k in range(300 if count < 100 else 4):
        if rng.random() < 0.5:
            ancestors = rng.integers(0, count, count)
            tree.resample(ancestors)
            paths = [list(paths[a]) for a in ancestors]
        if k == 150:                    # all on one path, after a loop was closed
            past, poses = rng.random((k, 3)), rng.random((count, 3))
            tree.replace(past, poses)
            paths = [list(past) for _ in range(count)]
        else:
            poses = rng.random((count, 3))
            tree.extend(poses)
        for path, pose in zip(paths, poses):
            path.append(pose)
    assert tree.depth == len(paths[0])
    for particle in range(count):
        assert np.array_equal(tree.path(particle), paths[particle])
    assert nodes_in_use(tree) == len({tuple(path[k]) + (k,) for path in paths for k in range(tree.depth)})


def test_replaced_past_is_shared_by_all_particles():
    tree, rng = TrajectoryTree(4), np.random.default_rng(3)
    for _ in range(5):
        tree.extend(rng.random((4, 3)))
    past, last = rng.random((4, 3)), rng.random((4, 3))
    tree.replace(past, last)
    assert nodes_in_use(tree) == 8 and tree.depth == 5
    for particle in range(4):
        assert np.array_equal(tree.path(particle), np.vstack([past, last[particle]]))
    tree.resample(np.array([1, 1, 1, 1]))
    assert nodes_in_use(tree) == 5


def test_nodes_without_particles_are_deleted():
    tree, rng = TrajectoryTree(8), np.random.default_rng(4)
    for _ in range(5000):
        tree.extend(rng.random((8, 3)))
        tree.resample(np.zeros(8, np.int64))
    assert len(tree._parent) < 4 * 5000


def test_restored_tree_continues_with_the_same_paths():
    rng, tree, again = np.random.default_rng(5), TrajectoryTree(6), TrajectoryTree(6)
    for k in range(400):
        if k == 200:
            again.restore(tree.compact())
        poses, ancestors = rng.random((6, 3)), rng.integers(0, 6, 6)
        for one in (tree, again) if k >= 200 else (tree,):
            one.extend(poses)
            one.resample(ancestors)
    for particle in range(6):
        assert np.array_equal(tree.path(particle), again.path(particle))
    expected, found = tree.compact(), again.compact()
    assert all(np.array_equal(expected[name], found[name]) for name in expected)
