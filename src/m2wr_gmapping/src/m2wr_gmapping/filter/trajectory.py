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

    A node is always behind its predecessor. Nodes without a particle are deleted when the arrays are full.

    Parameters
    ----------
    count : int
        Particles.

    Attributes
    ----------
    leaves : (N,) int64
        Newest node of each particle, -1 before the first scan.
    depth : int
        Number of nodes of each path.
    """

    def __init__(self, count: int) -> None:
        self.leaves = np.full(count, -1)
        self._parent, self._pose, self._used = np.empty(0, np.int64), np.empty((0, 3)), 0
        self.depth = 0

    def resample(self, ancestors: IndexArray) -> None:
        """Let particles (M,) continue their ancestors' paths."""
        self.leaves = self.leaves[ancestors]

    def extend(self, poses: FloatArray) -> None:
        """Add a node (N, 3) for each particle behind its newest one."""
        if self._used + len(poses) > len(self._parent):
            self._make_room(len(poses))
        new = np.arange(self._used, self._used + len(poses))
        self._parent[new], self._pose[new] = self.leaves, poses
        self.leaves, self._used = new, self._used + len(poses)
        self.depth += 1

    def _make_room(self, least: int) -> None:
        """Delete the nodes without a particle; make room for as many new nodes as there are, or ``least``."""
        self.__dict__.update(self.compact())
        self._used = len(self._parent)
        more = max(self._used, FIRST_NODES, least)
        self._parent = np.concatenate([self._parent, np.empty(more, np.int64)])
        self._pose = np.concatenate([self._pose, np.empty((more, 3))])

    def path(self, particle: int) -> FloatArray:
        """Return the poses (K, 3) of one particle at all processed scans, oldest first."""
        out = np.empty((self.depth, 3))
        kernels.path_to(self.leaves[particle], self._parent, self._pose, out)
        return out

    def replace(self, path: FloatArray, last: FloatArray) -> None:
        """Give all particles one common past.

        Parameters
        ----------
        path : (K - 1, 3) float64
            The new past, without the newest node.
        last : (N, 3) float64
            Newest pose of each particle.
        """
        past = len(path)
        self._parent, self._pose, self._used = np.arange(-1, past - 1), path.copy(), past
        self.leaves, self.depth = np.full(len(last), past - 1), past
        self.extend(last)

    # ---- saving

    def compact(self) -> Dict[str, Any]:
        """Return the attributes that are stored, with the nodes in use only and in a new numbering."""
        used = np.zeros(self._used, bool)
        kernels.mark_used(self.leaves, self._parent, used)
        number = np.append(np.cumsum(used) - 1, -1)             # the last entry is for "none"
        parent, pose = self._parent[:self._used][used], self._pose[:self._used][used]
        return dict(leaves=number[self.leaves], _parent=number[parent], _pose=pose, depth=self.depth)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned; raises ValueError if it is no tree with all leaves at the same depth."""
        self.__dict__.update(stored)
        self._used, depth, nodes = len(self._parent), 0, np.unique(self.leaves)
        if (self._parent >= np.arange(self._used)).any():
            raise ValueError("the paths' nodes are not in the order in which they were made")
        while (nodes >= 0).all() and len(nodes):
            nodes, depth = np.unique(self._parent[nodes]), depth + 1
        if depth != self.depth or (nodes >= 0).any():
            raise ValueError("a path has not the {} nodes that it should have".format(self.depth))
