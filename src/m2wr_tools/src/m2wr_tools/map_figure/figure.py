# SPDX-License-Identifier: BSD-3-Clause
"""A map over the world it was made in, with the path of the robot."""
from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon

from m2wr_maps.se2 import compose
from m2wr_tools.map_figure.graph_layer import draw_graph
from m2wr_view.outlines import convex_hull

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from numpy.typing import NDArray

    from m2wr_gmapping.graph_view import GraphView
    from m2wr_maps.saved_map import SavedMap
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline

DOTS_PER_INCH = 100
WIDTH = 10.0                # [inch]
MARGIN = 1.0                # around what is known [m]
RIM_POINTS = 60             # of a rounded outline that is no disc
UNKNOWN_COLOUR, MAP_COLOURS = "#DDDDDD", ("#FFFFFF", "#000000")     # free, occupied
# of Okabe and Ito, which colour-blind readers can distinguish
WORLD_COLOUR, WAY_COLOURS = "#8FCBF0", ("#D55E00", "#009E73", "#CC79A7", "#E69F00")
ENDINGS = (".png", ".svg", ".pdf")


class FigureError(ValueError):
    """A picture cannot be drawn or written; the message gives the reason."""


def _placed(points: FloatArray, offset: Sequence[float]) -> FloatArray:
    """Return points (N, 2) of the map frame in the world."""
    return compose(np.asarray(offset, float), np.column_stack([points, np.zeros(len(points))]))[:, :2]


def _patch(outline: Outline) -> Union[Circle, Polygon]:
    # the edge, a line of no particular width in metres, only closes the gaps between adjacent shapes
    style: Dict[str, Any] = dict(facecolor=WORLD_COLOUR, edgecolor=WORLD_COLOUR, linewidth=0.3, zorder=1)
    if len(outline.vertices) == 1:
        return Circle(tuple(outline.vertices[0]), outline.radius, **style)
    corners = outline.vertices
    if outline.radius > 0.0:
        turns = np.linspace(0.0, 2.0 * math.pi, RIM_POINTS, endpoint=False)
        rim = outline.radius * np.stack([np.cos(turns), np.sin(turns)], -1)
        corners = convex_hull((corners[:, None] + rim).reshape(-1, 2))
    return Polygon(corners, closed=True, **style)


def _bounds(saved: SavedMap, ways: Sequence[Tuple[str, FloatArray]]) -> FloatArray:
    """Return the lowest and highest x, y (2, 2) of the known cells and the paths, in the map frame."""
    rows, columns = np.nonzero(saved.data >= 0)
    points = [np.stack([columns, rows], -1) * saved.resolution + saved.origin] if len(rows) else []
    points += [way[:, :2] for _, way in ways if len(way)]
    if not points:
        raise FigureError("map {}: it has no known cells, and there is no path to draw".format(saved.name))
    known = np.concatenate(points)
    return np.stack([known.min(axis=0) - MARGIN, known.max(axis=0) + MARGIN])


def map_figure(saved: SavedMap, outlines: Sequence[Outline] = (), ways: Sequence[Tuple[str, FloatArray]] = (),
               offset: Sequence[float] = (0.0, 0.0, 0.0), title: str = "",
               graph: Optional[GraphView] = None) -> Figure:
    """Return the picture as a matplotlib Figure with one Axes in metres of the world.

    The obstacles of the world are areas of one colour; the free and the occupied cells of the map cover them.  So no
    line hides a cell that is to be compared with the world.

    Parameters
    ----------
    saved : SavedMap
    outlines : sequence of m2wr_view.outlines.Outline
        The world's obstacles from above.
    ways : sequence of (str, (K, 3) float)
        Names and poses, in the map frame.
    offset : (3,) float
        Pose of the map frame in the world [m, rad].
    title : str
        Of the figure.
    graph : GraphView, optional
        In the map frame.

    Raises
    ------
    FigureError
        If there is nothing to draw.
    """
    low, high = _bounds(saved, [*ways, ("graph", graph.nodes)] if graph is not None else ways)
    corners = _placed(np.array([low, (low[0], high[1]), high, (high[0], low[1])]), offset)
    left, right = corners.min(axis=0), corners.max(axis=0)
    width, height = right - left
    figure = Figure(figsize=(WIDTH, min(3.0 * WIDTH, 1.2 + WIDTH * height / width)), dpi=DOTS_PER_INCH,
                    facecolor="white")
    FigureCanvasAgg(figure)         # a canvas of its own: the backend of the caller is not changed
    axes = figure.add_subplot(1, 1, 1)
    # where cell (0, 0) has its middle at the origin, the picture begins half a cell before it
    edge = np.asarray(saved.origin) - 0.5 * saved.resolution
    rows, columns = saved.data.shape
    axes.set_facecolor(UNKNOWN_COLOUR)
    for outline in outlines:
        axes.add_patch(_patch(outline))
    axes.pcolormesh(*_edges(edge, rows, columns, saved.resolution, offset, low, high),
                    _cut(saved, edge, low, high), cmap=ListedColormap(MAP_COLOURS), vmin=0, vmax=1, zorder=2,
                    rasterized=True)
    handles: List[Artist] = [
        Patch(facecolor=MAP_COLOURS[1], label="occupied in the map"),
        Patch(facecolor=MAP_COLOURS[0], edgecolor="#808080", linewidth=0.5, label="free in the map"),
        Patch(facecolor=UNKNOWN_COLOUR, label="unknown")]
    handles += [Patch(facecolor=WORLD_COLOUR, label="obstacle of the world")] if len(outlines) else []
    for index, (name, way) in enumerate(ways):
        points = _placed(way[:, :2], offset)
        line, = axes.plot(points[:, 0], points[:, 1], color=WAY_COLOURS[index % len(WAY_COLOURS)], linewidth=1.2,
                          label=name, zorder=4)
        axes.plot(points[:1, 0], points[:1, 1], "o", color=line.get_color(), markersize=5, zorder=5)
        handles.append(line)
    if graph is not None:
        handles += draw_graph(axes, graph, offset)
    axes.set_xlim(left[0], right[0])
    axes.set_ylim(left[1], right[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(title)
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.07), ncol=5, frameon=False)
    return figure


def _range(edge: float, count: int, resolution: float, low: float, high: float) -> Tuple[int, int]:
    """Return the first and last (exclusive) cell along one axis between two positions."""
    first = int(np.clip(math.floor((low - edge) / resolution), 0, count))
    last = int(np.clip(math.ceil((high - edge) / resolution), first, count))
    return first, last


def _window(saved: SavedMap, edge: FloatArray, low: FloatArray, high: FloatArray) -> Tuple[int, int, int, int]:
    (left, right), (bottom, top) = (_range(edge[k], saved.data.shape[1 - k], saved.resolution, low[k], high[k])
                                    for k in (0, 1))
    return left, right, bottom, top


def _cut(saved: SavedMap, edge: FloatArray, low: FloatArray, high: FloatArray) -> NDArray[Any]:
    """Return the cells between two places as numbers of colours; unknown ones are masked."""
    left, right, bottom, top = _window(saved, edge, low, high)
    part = saved.data[bottom:top, left:right]
    return np.ma.masked_array(part == 100, part < 0).astype(int)


def _edges(edge: FloatArray, rows: int, columns: int, resolution: float, offset: Sequence[float], low: FloatArray,
           high: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Return x and y (h + 1, w + 1) of the corners of the cells between two places, in the world."""
    left, right = _range(edge[0], columns, resolution, low[0], high[0])
    bottom, top = _range(edge[1], rows, resolution, low[1], high[1])
    x, y = np.meshgrid(edge[0] + resolution * np.arange(left, right + 1),
                       edge[1] + resolution * np.arange(bottom, top + 1))
    points = _placed(np.stack([x.ravel(), y.ravel()], -1), offset)
    return points[:, 0].reshape(x.shape), points[:, 1].reshape(y.shape)


def write(figure: Figure, path: str) -> None:
    """Write a picture; the ending of the path gives its format.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The picture.
    path : str
        File to write.

    Raises
    ------
    FigureError
        If the ending is none of ENDINGS or the file cannot be written.
    """
    ending = os.path.splitext(path)[1].lower()
    if ending not in ENDINGS:
        raise FigureError("picture {}: expected a name that ends in {}".format(path, ", ".join(ENDINGS)))
    try:
        figure.savefig(path, format=ending[1:], dpi=DOTS_PER_INCH, bbox_inches="tight")
    except OSError as error:
        raise FigureError("picture {}: {}".format(path, error.strerror or error)) from error
