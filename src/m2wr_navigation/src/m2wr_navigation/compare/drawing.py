# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles and paths as SVG, in metres."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_view.outlines import convex_hull

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline

RIM_POINTS = 32
APART = 0.03                # m between two points of a drawn path


def thinned(path: FloatArray, apart: float = APART) -> FloatArray:
    """Return points of a path, and its last one.

    Parameters
    ----------
    path : (N, 2) float64
        [m]
    apart : float, optional
        Least distance of two points [m].

    Returns
    -------
    (M, 2) float64
    """
    points = path.tolist()          # numbers of Python: an array is slow to take them from one by one
    kept, last = [0], points[0]
    for k, point in enumerate(points[1:], 1):
        if math.hypot(point[0] - last[0], point[1] - last[1]) >= apart:
            kept.append(k)
            last = point
    return path[kept + ([len(points) - 1] if kept[-1] != len(points) - 1 else [])]


def pairs_of(points: FloatArray) -> str:
    """Return points (N, 2) [m] as SVG has them, y downwards."""
    return " ".join("{:.2f},{:.2f}".format(x, -y) for x, y in points.tolist())


def polyline(points: FloatArray, name: str) -> str:
    """Return a line.

    Parameters
    ----------
    points : (N, 2) float64
        [m]
    name : str
        Its class in the style sheet.
    """
    return "<polyline class={} stroke-width=.1 points=\"{}\"/>".format(name, pairs_of(points))


def dot(point: FloatArray, name: str) -> str:
    """Return a dot.

    Parameters
    ----------
    point : (2,) float64
        [m]
    name : str
        Its class in the style sheet.
    """
    return "<circle class={} cx={:.2f} cy={:.2f} r=.22 />".format(name, point[0], -point[1])


def cross(point: FloatArray, name: str) -> str:
    """Return a cross.

    Parameters
    ----------
    point : (2,) float64
        [m]
    name : str
        Its class in the style sheet.
    """
    return "<path class={} d=\"M{:.2f} {:.2f}l.3 .3m0 -.3l-.3 .3\"/>".format(name, point[0] - 0.15, -point[1] - 0.15)


def shape(outline: Outline) -> str:
    """Return an obstacle."""
    if len(outline.vertices) == 1:
        (x, y), = outline.vertices.tolist()
        return "<circle class=wall cx={:.3f} cy={:.3f} r={:.3f} />".format(x, -y, outline.radius)
    corners = outline.vertices
    if outline.radius > 0.0:
        turns = np.linspace(0.0, 2.0 * math.pi, RIM_POINTS, endpoint=False)
        rim = outline.radius * np.stack([np.cos(turns), np.sin(turns)], -1)
        corners = convex_hull((corners[:, None] + rim).reshape(-1, 2))
    return "<polygon class=wall points=\"{}\"/>".format(pairs_of(corners))
