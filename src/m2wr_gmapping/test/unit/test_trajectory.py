# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory tree."""

import numpy as np

from m2wr_gmapping.filter.trajectory import TrajectoryTree


def test_tree_stores_exactly_the_paths_of_all_particles():
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


def test_replaced_past_is_shared_by_all_particles():
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


def test_tree_equals_reference():
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
