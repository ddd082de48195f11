# SPDX-License-Identifier: BSD-3-Clause
"""The pose graph as plain arrays, for pictures and files: nodes, loop closures, and candidates that were rejected."""
from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Optional

import numpy as np

if TYPE_CHECKING:
    from m2wr_gmapping.mapper import Mapper
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray

FARTHEST = 1e9              # greatest coordinate of a node [m]
LARGEST = 1 << 28           # of a file [bytes]: some million nodes


class GraphError(ValueError):
    """A graph is inconsistent or a file holds none; the message says what was expected."""


@dataclass(frozen=True)
class GraphView:
    """A pose graph.

    Consecutive nodes are joined by the path; ``edges`` are all other constraints.

    Attributes
    ----------
    nodes : (N, 3) float64
        Poses of the base in ``map``, in the order of time [m, m, rad].
    edges : (M, 2) int64
        Older and newer node of each candidate of a loop closure.
    accepted : (M,) bool
        Whether it constrains the path now; otherwise it was rejected, or removed, or still waits for others.

    Raises
    ------
    GraphError
        If the arrays do not fit together.
    """

    nodes: FloatArray
    edges: IndexArray
    accepted: BoolArray

    def __post_init__(self) -> None:
        count = len(self.nodes)
        if self.nodes.shape != (count, 3) or not (np.abs(self.nodes) < FARTHEST).all():
            raise GraphError("nodes: expected rows of x, y, yaw below {:g}".format(FARTHEST))
        if self.edges.shape != (len(self.edges), 2) or not ((self.edges >= 0) & (self.edges < count)).all():
            raise GraphError("edges: expected pairs of numbers from 0 to {}".format(count - 1))
        if self.accepted.shape != (len(self.edges),):
            raise GraphError("accepted: expected one value for each of {} edges; got {}".format(
                len(self.edges), len(self.accepted)))

    def text(self) -> str:
        """Return the content of its file: a JSON object with the names of the attributes."""
        return json.dumps(dict(nodes=self.nodes.round(6).tolist(), edges=self.edges.tolist(),
                               accepted=self.accepted.tolist()))


def graph_of(mapper: Mapper) -> GraphView:
    """Return the pose graph of a mapper that has used a scan; without loop closing it has no edges.

    A mapper with a method ``graph_view`` says itself what its graph is.  Otherwise it is the best particle's path with
    the loop closures of the back end, those that it has rejected, and the candidates that wait for others.
    """
    own: Optional[Callable[[], GraphView]] = getattr(mapper, "graph_view", None)
    if own is not None:
        return own()
    nodes = mapper.base_poses(mapper.particles.tree.path(mapper.particles.best))
    loops = mapper._loops
    links = [] if loops is None else list(loops.graph.links)
    others = [] if loops is None else loops.graph.rejected + [candidate.link[:2] for candidate in loops._candidates]
    pairs = np.array([link[:2] for link in links] + others, np.int64).reshape(-1, 2)
    return GraphView(nodes, pairs, np.arange(len(pairs)) < len(links))


def read(path: str) -> GraphView:
    """Return the graph in a file that ``GraphView.text`` has made.

    Parameters
    ----------
    path : str

    Raises
    ------
    GraphError
        If it cannot be read or holds no graph.
    """
    try:
        if os.path.getsize(path) > LARGEST:
            raise GraphError("expected at most {} bytes".format(LARGEST))
        with open(path, encoding="utf-8") as stream:
            found = json.load(stream)
        if not isinstance(found, dict):
            raise GraphError("expected a JSON object with nodes, edges and accepted")
        pairs = _numbers(found, "edges", 2)
        if not (pairs == np.floor(pairs)).all():
            raise GraphError("edges: expected whole numbers")
        accepted = found.get("accepted")
        if not isinstance(accepted, list) or not all(isinstance(value, bool) for value in accepted):
            raise GraphError("accepted: expected a list of true and false")
        return GraphView(_numbers(found, "nodes", 3), pairs.astype(np.int64), np.array(accepted, bool))
    except OSError as error:
        raise GraphError("graph {}: {}".format(path, error.strerror or error)) from error
    except (ValueError, RecursionError) as error:           # no JSON, no text, or a GraphError from above
        raise GraphError("graph {}: {}".format(path, error)) from error


def _numbers(found: Any, name: str, columns: int) -> FloatArray:
    """Return a list of rows of numbers as an array (K, columns), of finite numbers of moderate size."""
    try:
        table = np.array(found.get(name), float)
    except (TypeError, ValueError, OverflowError):
        raise GraphError("{}: expected rows of {} numbers".format(name, columns)) from None
    if table.size == 0:
        table = table.reshape(0, columns)
    if table.ndim != 2 or table.shape[1] != columns or not (np.abs(table) < FARTHEST).all():
        raise GraphError("{}: expected rows of {} numbers below {:g}".format(name, columns, FARTHEST))
    return table
