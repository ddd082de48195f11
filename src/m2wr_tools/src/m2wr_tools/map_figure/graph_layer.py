# SPDX-License-Identifier: BSD-3-Clause
"""Draws a pose graph into the picture of a map."""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Sequence

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from m2wr_maps.se2 import compose

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from m2wr_gmapping.graph_view import GraphView

# of Okabe and Ito, which colour-blind readers can distinguish; the two kinds of edges differ in their style too
NODE_COLOUR, ACCEPTED_COLOUR, REJECTED_COLOUR = "#0072B2", "#009E73", "#D55E00"
NODE_SIZE = 4.0             # area [points^2]


def draw_graph(axes: Axes, graph: GraphView, offset: Sequence[float]) -> List[Artist]:
    """Draw nodes and edges.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        In metres of the world.
    graph : GraphView
    offset : (3,) float
        Pose of the map frame in the world [m, rad].

    Returns
    -------
    list of matplotlib.artist.Artist
        Entries of the legend.
    """
    nodes = compose(np.asarray(offset, float), graph.nodes)[:, :2]
    axes.plot(nodes[:, 0], nodes[:, 1], color=NODE_COLOUR, linewidth=0.6, zorder=3)
    axes.scatter(nodes[:, 0], nodes[:, 1], s=NODE_SIZE, color=NODE_COLOUR, linewidths=0.0, zorder=4)
    shown: List[Artist] = [Line2D([], [], color=NODE_COLOUR, marker="o", markersize=3, linewidth=0.6,
                                  label="%d nodes" % len(nodes))]
    for accepted, colour, style, name in ((False, REJECTED_COLOUR, "dashed", "not accepted"),
                                          (True, ACCEPTED_COLOUR, "solid", "loop closures")):
        chosen = graph.edges[graph.accepted == accepted]
        axes.add_collection(LineCollection(nodes[chosen], colors=colour, linewidths=1.0, linestyles=style,
                                           zorder=5 + accepted), autolim=False)
        shown.append(Line2D([], [], color=colour, linestyle=style, label="%d %s" % (len(chosen), name)))
    return shown
