# SPDX-License-Identifier: BSD-3-Clause
"""Paths of the particles: a tree of poses, where each node points to its predecessor."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict

import numpy as np

from m2wr_gmapping.filter import tree_kernels as kernels

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

FIRST_NODES = 1024


class TrajectoryTree:
    """Poses of all particles at all processed scans; particles share their common past.

    Attributes
    ----------
    leaves : (N,) int64
        Newest node of each particle, -1 before the first scan.
    """

    def __init__(self, count: int) -> None:
        self.leaves = np.full(count, -1, np.int64)
        self._parent = np.full(FIRST_NODES, -1, np.int64)
        self._children = np.zeros(FIRST_NODES, np.int32)
        self._pose = np.zeros((FIRST_NODES, 3))
        self._serial = np.zeros(FIRST_NODES, np.int64)
        self._free = np.arange(FIRST_NODES - 1, -1, -1)
        self._counters = np.array([FIRST_NODES, 0])
        self.depth = 0

    def __len__(self) -> int:
        return len(self._parent) - int(self._counters[0])

    def _grow(self) -> None:
        old = len(self._parent)
        unused = self._free[:self._counters[0]].copy()
        self._parent = np.concatenate([self._parent, np.full(old, -1, np.int64)])
        self._children = np.concatenate([self._children, np.zeros(old, np.int32)])
        self._pose = np.concatenate([self._pose, np.zeros((old, 3))])
        self._serial = np.concatenate([self._serial, np.zeros(old, np.int64)])
        spare = np.zeros(old - len(unused), np.int64)
        self._free = np.concatenate([np.arange(2 * old - 1, old - 1, -1), unused, spare])
        self._counters[0] += old

    def resample(self, ancestors: IndexArray) -> None:
        """Let particles (M,) continue their ancestors' paths; paths without descendants are deleted."""
        old = self.leaves
        self.leaves = old[ancestors]
        if self.depth:
            for leaf in np.setdiff1d(old, self.leaves):
                kernels.release(leaf, self._parent, self._children, self._free, self._counters)

    def extend(self, poses: FloatArray) -> None:
        """Add a node (N, 3) for each particle behind its newest one."""
        while self._counters[0] < len(poses):
            self._grow()
        kernels.extend(self.leaves, poses, self._parent, self._children, self._pose, self._serial, self._free,
                       self._counters)
        self.depth += 1

    def nodes(self, particle: int) -> IndexArray:
        """Return the nodes (K,) of one particle's path, oldest first."""
        out = np.empty(self.depth, np.int64)
        count = kernels.lineage(self.leaves[particle], self._parent, out)
        return out[:count][::-1]

    def path(self, particle: int) -> FloatArray:
        """Return the poses (K, 3) of one particle at all processed scans, oldest first."""
        out = np.empty((self.depth, 3))
        return out[kernels.path_to(self.leaves[particle], self._parent, self._pose, out):]

    def keys(self, particle: int) -> IndexArray:
        """Return unique numbers (K,) of the nodes of a path; equal numbers mean a common beginning."""
        return self._serial[self.nodes(particle)]

    def common_depth(self) -> int:
        """Return the number of oldest nodes that all particles share."""
        depth = self.depth
        nodes = np.unique(self.leaves)
        while depth and len(nodes) > 1:
            nodes = np.unique(self._parent[nodes])
            depth -= 1
        return depth

    def replace(self, path: FloatArray, last: FloatArray) -> None:
        """Give all particles one common past.

        Parameters
        ----------
        path : (K - 1, 3) float64
            The new past, without the newest node.
        last : (N, 3) float64
            Newest pose of each particle.
        """
        total = len(self._parent)
        self._free[:total] = np.arange(total - 1, -1, -1)
        self._counters[0] = total
        while self._counters[0] < len(path) + len(last):
            self._grow()
        above = kernels.chain(path, self._parent, self._children, self._pose, self._serial, self._free, self._counters)
        self.leaves, self.depth = np.full(len(last), above, np.int64), len(path)
        self.extend(last)

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored, with the nodes in use only, parents first."""
        used = np.ones(len(self._parent), bool)
        used[self._free[:self._counters[0]]] = False
        order = np.flatnonzero(used)
        order = order[np.argsort(self._serial[order], kind="stable")]
        number = np.full(len(used) + 1, -1, np.int64)           # the last entry is for "none"
        number[order] = np.arange(len(order))
        return dict(leaves=number[self.leaves], _parent=number[self._parent[order]], _pose=self._pose[order],
                    _serial=self._serial[order], next_serial=int(self._counters[1]), depth=self.depth)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned; raises ValueError if it is no tree with all leaves at the same depth."""
        parent, serial, count = stored["_parent"], stored["_serial"], len(stored["_parent"])
        if (parent >= np.arange(count)).any() or (np.diff(serial) <= 0).any() \
                or (count and serial[-1] >= stored["next_serial"]):
            raise ValueError("the paths' nodes are not in the order in which they were made")
        nodes = np.unique(stored["leaves"])
        for _ in range(stored["depth"]):
            if nodes[0] < 0:
                break
            nodes = np.unique(parent[nodes])
        else:
            if (nodes < 0).all():
                self.leaves, self._parent, self._pose, self._serial = (
                    stored[name] for name in ("leaves", "_parent", "_pose", "_serial"))
                self._children = np.bincount(parent[parent >= 0], minlength=count).astype(np.int32)
                self._free = np.zeros(count, np.int64)
                self._counters, self.depth = np.array([0, stored["next_serial"]]), stored["depth"]
                return
        raise ValueError("a path has not the {} nodes that it should have".format(stored["depth"]))
