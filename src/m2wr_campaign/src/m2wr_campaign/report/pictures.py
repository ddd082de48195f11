# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of runs, and charts of success against difficulty, as SVG."""
from __future__ import annotations

import json
from collections import Counter
from html import escape
from typing import TYPE_CHECKING, Any, Callable, Dict, Sequence, Tuple

import numpy as np

from m2wr_navigation.compare.drawing import cross, dot, polyline, shape, thinned
from m2wr_navigation.compare.page import MARGIN
from m2wr_navigation.compare.statistics import wilson

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

    Row = Dict[str, Any]

MOST_POINTS = 200           # of a drawn path
WIDE, HIGH = 200, 100       # units of a chart
LEFT, RIGHT, TOP, BOTTOM = 34, 192, 8, 80


class Worlds:
    """The worlds of a study, each drawn once; pictures refer to them.

    Parameters
    ----------
    worlds : sequence of dict
        As :meth:`ResultFile.worlds` gives them.
    path_of : callable
        From the key of a run to its path (N, 2) [m].
    """

    def __init__(self, worlds: Sequence[Row], path_of: Callable[[str], FloatArray]) -> None:
        self._rows = {world["key"]: (number, world) for number, world in enumerate(worlds)}
        self._alike = Counter(world["label"] for world in worlds)
        self._bounds = {world["key"]: _bounds(world) for world in worlds}
        self._path_of = path_of

    def label(self, key: str) -> str:
        """Return the name of a world, with its parameters if another one has the same name."""
        world = self._rows[key][1]
        if self._alike[world["label"]] == 1:
            return str(world["label"])
        return " ".join([world["label"]] + ["{} {}".format(name, value) for name, value in
                                            sorted(json.loads(world["parameters"]).items())])

    def definitions(self) -> str:
        """Return all worlds for the beginning of the page; they are not seen there."""
        drawn = ["<g id=\"w{}\">{}{}{}</g>".format(
            number, "".join(shape(outline) for outline in world["outlines"]),
            dot(_end(world, "start"), "start"), dot(_end(world, "goal"), "goal"))
            for number, world in self._rows.values()]
        return "<svg style=\"position:absolute;width:0;height:0;border:0\"><defs>{}</defs></svg>".format("".join(drawn))

    def picture(self, run: Row) -> str:
        """Return the path of a run in its world; the cross is where a run without success ended."""
        path, (low, high) = self._path_of(run["key"]), self._bounds[run["world"]]
        lines = "<use href=\"#w{}\"/>".format(self._rows[run["world"]][0])
        if len(path):
            length = float(np.hypot(*np.diff(path, axis=0).T).sum()) if len(path) > 1 else 0.0
            path = thinned(path, max(length / MOST_POINTS, 0.02))
            low, high = np.minimum(low, path.min(axis=0) - MARGIN), np.maximum(high, path.max(axis=0) + MARGIN)
            lines += polyline(path, "way") + ("" if run["success"] else cross(path[-1], "end"))
        return "<svg viewBox=\"{:.2f} {:.2f} {:.2f} {:.2f}\" role=img aria-label=\"{}\">{}</svg>".format(
            low[0], -high[1], high[0] - low[0], high[1] - low[1],
            escape("path of {} in {}".format(run["method"], self.label(run["world"]))), lines)


def _end(world: Row, name: str) -> FloatArray:
    return np.array([world[name + "_x"], world[name + "_y"]], float)


def _bounds(world: Row) -> Tuple[FloatArray, FloatArray]:
    """Return the corners (2,) of all that stands in a world, with a margin [m]."""
    points = [_end(world, "start")[None], _end(world, "goal")[None]]
    for outline in world["outlines"]:
        points += [outline.vertices - outline.radius, outline.vertices + outline.radius]
    every = np.concatenate(points)
    return every.min(axis=0) - MARGIN, every.max(axis=0) + MARGIN


def chart(points: Sequence[Tuple[float, int, int]], ends: Tuple[float, float], name: str) -> str:
    """Return success against a measure, with Wilson's intervals.

    Parameters
    ----------
    points : sequence of (float, int, int)
        Measure, successes, runs.
    ends : (2,) float
        Of the axis of the measure.
    name : str
        Of the chart, for readers of the screen.
    """
    def across(value: float) -> float:
        return LEFT + 6 + (RIGHT - LEFT - 12) * (value - ends[0]) / max(ends[1] - ends[0], 1e-9)

    def up(share: float) -> float:
        return BOTTOM - (BOTTOM - TOP) * share

    parts = ["<svg class=chart viewBox=\"0 0 {} {}\" role=img aria-label=\"{}\">".format(WIDE, HIGH, escape(name))]
    for share in (0.0, 0.5, 1.0):
        parts.append("<line class=grid-line x1={0} x2={1} y1={2:.1f} y2={2:.1f} /><text x={3} y={4:.1f} "
                     "text-anchor=end>{5:.0f} %</text>".format(LEFT, RIGHT, up(share), LEFT - 3, up(share) + 3,
                                                               100.0 * share))
    for value, anchor in zip(ends, ("start", "end")):
        parts.append("<text x={:.1f} y={} text-anchor={}>{:.3g}</text>".format(
            LEFT if anchor == "start" else RIGHT, HIGH - 6, anchor, value))
    marks = [(across(value), up(good / runs), *map(up, wilson(good, runs)), value, good, runs)
             for value, good, runs in points]
    parts.append("<polyline class=trend points=\"{}\"/>".format(
        " ".join("{:.1f},{:.1f}".format(*mark[:2]) for mark in marks)))
    for x, y, low, high, value, good, runs in marks:
        parts.append("<g><title>{:.3g}: {} of {}</title><line class=bar x1={:.1f} x2={:.1f} y1={:.1f} y2={:.1f} />"
                     "<circle class=mark cx={:.1f} cy={:.1f} r=2.5 /></g>".format(value, good, runs, x, x, low, high,
                                                                                  x, y))
    return "".join(parts) + "</svg>"
