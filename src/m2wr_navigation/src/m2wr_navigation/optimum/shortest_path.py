# SPDX-License-Identifier: BSD-3-Clause
"""The exact shortest path of a disc among convex obstacles: a visibility graph of tangents and arcs, and Dijkstra.

The obstacles are outlines: convex polygons rounded by a radius. Inflated by the robot's radius they are outlines again,
so that the path is exact up to rounding (Lozano-Perez, Wesley 1979, for polygons; Laumond 1987, for rounded ones).
"""
from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, List, Sequence, Tuple

import numpy as np

from m2wr_navigation.optimum.tangent_kernels import free_arcs, free_limits, is_point_free, tangents
from m2wr_view.outlines import Outline, point_distances

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray, Vector

MOST_CORNERS = 1000         # of all obstacles: the tangents grow with its square, the work with its cube
ARC_STEP = math.radians(3.0)        # between two points of an arc, only for display

#: Node of the graph: index of its circle, and angle on it [rad].
Node = Tuple[int, float]


class NoShortestPathError(ValueError):
    """There is no path; the message says why."""


@dataclass(frozen=True)
class ShortestPath:
    """A shortest path.

    Attributes
    ----------
    points : (N, 2) float64
        From start to goal [m]; arcs are sampled.
    length : float
        Exact, also for the arcs [m].
    """

    points: FloatArray
    length: float


def shortest_path(obstacles: Sequence[Outline], radius: float, start: Vector, goal: Vector) -> ShortestPath:
    """Return the shortest path of a disc.

    Parameters
    ----------
    obstacles : sequence of Outline
        In the world.
    radius : float
        Of the robot [m], more than 0.
    start, goal : (2,) float
        Of its centre [m].

    Raises
    ------
    NoShortestPathError
        If an end is too near to an obstacle, or nothing connects them.
    ValueError
        If a number is not finite, the radius is not positive, or there are more than MOST_CORNERS corners.
    """
    ends = np.array([start[:2], goal[:2]], float)
    if not np.isfinite(ends).all() or not 0.0 < radius < math.inf:
        raise ValueError("start {}, goal {}, radius {}; expected finite numbers and a positive radius".format(
            *ends.tolist(), radius))
    for place, end in zip(("start", "goal"), ends):
        _check_end(obstacles, radius, place, end)
    points, first, radii = inflated(_outermost(obstacles), radius)
    if len(points) > MOST_CORNERS:
        raise ValueError("the obstacles have {} corners; expected at most {}".format(len(points), MOST_CORNERS))
    circles = np.concatenate([np.column_stack((points, np.repeat(radii, np.diff(first)))),
                              np.column_stack((ends, np.zeros(2)))])
    graph = _graph(points, first, radii, circles)
    return _search(graph, circles)


def _check_end(obstacles: Sequence[Outline], radius: float, place: str, end: FloatArray) -> None:
    for outline in obstacles:
        distance = float(point_distances(end[None], outline)[0])
        if distance < radius:
            raise NoShortestPathError("the {} ({:.2f}, {:.2f}) is {:.2f} m from {}; the robot's radius is "
                                      "{:.2f} m".format(
                                          place, end[0], end[1], distance, outline.name or "an obstacle", radius))


def _outermost(obstacles: Sequence[Outline]) -> List[Outline]:
    """Return the outlines that no other one covers, such as the widest of the boxes of which a barrier is made."""
    if not obstacles:
        return []
    boxes = np.array([(*(one.vertices.min(axis=0) - one.radius), *(-one.vertices.max(axis=0) - one.radius))
                      for one in obstacles])
    kept = list(range(len(obstacles)))
    for k, one in enumerate(obstacles):
        for j in np.flatnonzero((boxes <= boxes[k]).all(axis=1)).tolist():      # whose bounding box covers that of k
            other = obstacles[j]
            if j != k and j in kept and other.radius >= one.radius and not point_distances(
                    one.vertices, Outline(other.vertices, other.radius - one.radius)).any():
                kept.remove(k)
                break
    return [obstacles[k] for k in kept]


def inflated(obstacles: Sequence[Outline], radius: float) -> Tuple[FloatArray, IndexArray, FloatArray]:
    """Return the corners (N, 2) [m], the index of each obstacle's first one (K + 1,), and the radii (K,) [m].

    Parameters
    ----------
    obstacles : sequence of Outline
    radius : float
        By which each is widened [m].
    """
    counts = [len(outline.vertices) for outline in obstacles]
    points = np.concatenate([np.zeros((0, 2))] + [outline.vertices for outline in obstacles])
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return np.ascontiguousarray(points), first, np.array([outline.radius + radius for outline in obstacles])


@dataclass
class _Graph:
    nodes: List[Node]
    edges: List[List[Tuple[int, float]]]
    start: List[int]
    goal: List[int]


def _graph(points: FloatArray, first: IndexArray, radii: FloatArray, circles: FloatArray) -> _Graph:
    """Return the graph: its nodes are where tangents meet circles, and where free arcs end."""
    limits: Dict[int, FloatArray] = {}
    used = [len(circles) - 2, len(circles) - 1]
    for k in range(len(circles) - 2):
        limits[k] = free_limits(points, first, radii, circles[k])
        # without limits the circle is free or blocked as a whole
        if len(limits[k]) or is_point_free(points, first, radii, circles[k, 0] + circles[k, 2], circles[k, 1]):
            used.append(k)
    pairs, angles, lengths = tangents(points, first, radii, circles, np.array(sorted(used), np.int64))
    graph = _Graph([], [[] for _ in range(2 * len(pairs))], [], [])
    on_circle: Dict[int, List[int]] = {}
    for (i, j), (at_i, at_j), length in zip(pairs.tolist(), angles.tolist(), lengths.tolist()):
        count = len(graph.nodes)
        graph.nodes += [(i, at_i), (j, at_j)]
        graph.edges[count].append((count + 1, length))
        graph.edges[count + 1].append((count, length))
        on_circle.setdefault(i, []).append(count)
        on_circle.setdefault(j, []).append(count + 1)
    graph.start, graph.goal = (list(on_circle.get(end, [])) for end in (len(circles) - 2, len(circles) - 1))
    for k, nodes in on_circle.items():
        if k < len(circles) - 2:
            for angle in limits[k].tolist():
                nodes.append(len(graph.nodes))
                graph.nodes.append((k, angle))
                graph.edges.append([])
            nodes.sort(key=lambda node: graph.nodes[node][1])
            at = np.array([graph.nodes[node][1] for node in nodes])
            arcs = free_arcs(points, first, radii, circles[k], at).tolist()
            for node, after, arc in zip(nodes, nodes[1:] + nodes[:1], arcs):
                if arc < math.inf:
                    graph.edges[node].append((after, arc))
                    graph.edges[after].append((node, arc))
    return graph


def _search(graph: _Graph, circles: FloatArray) -> ShortestPath:
    """Return the shortest path by Dijkstra's algorithm."""
    total = [math.inf] * len(graph.nodes)
    before = [-1] * len(graph.nodes)
    for node in graph.start:
        total[node] = 0.0
    heap, goals = [(0.0, node) for node in graph.start], set(graph.goal)
    heapq.heapify(heap)
    while heap:
        length, node = heapq.heappop(heap)
        if node in goals:
            break
        if length > total[node]:
            continue
        for after, step in graph.edges[node]:
            if length + step < total[after]:
                total[after], before[after] = length + step, node
                heapq.heappush(heap, (length + step, after))
    else:
        x, y = circles[-1, :2]
        raise NoShortestPathError("there is no way through to ({:.2f}, {:.2f})".format(x, y))
    nodes = [node]
    while before[nodes[-1]] >= 0:
        nodes.append(before[nodes[-1]])
    return ShortestPath(_points([graph.nodes[node] for node in nodes[::-1]], circles), length)


def _points(nodes: Sequence[Node], circles: FloatArray) -> FloatArray:
    """Return the points (N, 2) of a path, with points along its arcs."""
    points: List[Tuple[float, float]] = []
    for k, (circle, angle) in enumerate(nodes):
        x, y, radius = circles[circle]
        angles = [angle]
        if k and nodes[k - 1][0] == circle:
            arc = math.remainder(angle - nodes[k - 1][1], 2.0 * math.pi)
            count = max(1, math.ceil(abs(arc) / ARC_STEP))
            angles = [nodes[k - 1][1] + arc * (j + 1) / count for j in range(count)]
        points += [(x + radius * math.cos(at), y + radius * math.sin(at)) for at in angles]
    return np.array(points)
