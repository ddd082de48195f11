# SPDX-License-Identifier: BSD-3-Clause
"""The page of a comparison: one file of HTML with a table and a picture of each path. It needs no network."""
from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Sequence

import numpy as np

from m2wr_navigation.compare.comparison import order
from m2wr_navigation.compare.drawing import dot, polyline, shape, thinned

if TYPE_CHECKING:
    from m2wr_navigation.compare.comparison import Comparison, Entry

MARGIN = 0.5                # m

STYLE = """
body { font: 15px/1.5 sans-serif; margin: 2em auto; max-width: 1150px; padding: 0 1em; color: #222; }
table { border-collapse: collapse; width: 100%; } td, th { padding: .2em .6em; border-bottom: 1px solid #ddd; }
th { text-align: left; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
tr.bad td { color: #a33; } figure { margin: 0; } figcaption { font-size: 14px; }
.grid { display: grid; grid-template-columns: repeat(auto-fill, minmax(250px, 1fr)); gap: 1em; }
svg { width: 100%; height: auto; background: #fafafa; border: 1px solid #ddd; }
.wall { fill: #8a8f98; } .best { fill: none; stroke: #0072b2; stroke-dasharray: .25 .15; }
.mover { fill: #cc79a7; stroke: #cc79a7; stroke-width: .05; } polyline.mover { fill: none; }
.way { fill: none; stroke: #d55e00; } .start { fill: #009e73; } .goal { fill: #d55e00; }
"""


def page(comparison: Comparison, entries: Sequence[Entry]) -> str:
    """Return the page.

    Parameters
    ----------
    comparison : Comparison
    entries : sequence of Entry
    """
    ordered, start, goal = order(entries), comparison.start, comparison.goal
    title = "{}: ({:g}, {:g}) to ({:g}, {:g})".format(comparison.name, start[0], start[1], goal[0], goal[1])
    parts = ["<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>", escape(title), "</title><style>",
             STYLE, "</style></head><body><h1>", escape(title), "</h1>", _intro(comparison), "<table>",
             "<tr><th>name</th><th>map</th><th>result</th><th class=n>length / optimum</th><th class=n>length m</th>"
             "<th class=n>time s</th><th class=n>clearance m</th><th class=n>contacts</th><th class=n>CPU ms</th></tr>"]
    parts += [_row(entry) for entry in ordered]
    parts += ["</table><h2>Paths</h2><svg style=\"position:absolute;width:0;height:0;border:0\"><defs><g id=\"world\">",
              "".join(shape(outline) for outline in comparison.obstacles),
              "".join(polyline(mover.path, "mover") + dot(mover.path[0], "mover") for mover in comparison.movers),
              polyline(comparison.optimum.points, "best"),
              dot(comparison.optimum.points[0], "start"), dot(comparison.optimum.points[-1], "goal"),
              "</g></defs></svg><div class=grid>"]
    view = _view(comparison, ordered)
    parts += [_picture(entry, view) for entry in ordered]
    return "".join(parts + ["</div></body></html>\n"])


def _intro(comparison: Comparison) -> str:
    return ("<p>Planners know the true map; pure pursuit drives along their paths. Methods see only the laser. The "
            "optimum, {:.2f} m, is the exact shortest path of a disc of {:g} m, the greatest inside of the robot: no "
            "path without contacts is shorter. The length is that of the axle's path. Time is simulated. Clearance is "
            "the least distance of the robot's outline from an obstacle. CPU time is that of one plan, or of one cycle "
            "of a method at 20 Hz.</p>").format(comparison.optimum.length, comparison.inscribed)


def contacts_told(contacts: int, met: int, struck: int) -> str:
    """Return the number of contacts, of meetings with what moves, and of those that a robot could not avoid.

    Parameters
    ----------
    contacts, met, struck : int
        As of :class:`m2wr_navigation.compare.comparison.Entry`.
    """
    return "{} <small>({} met, {} run into it)</small>".format(contacts, met, struck) if met else str(contacts)


def _row(entry: Entry) -> str:
    cells = ["<td>", escape(entry.name), "</td><td>", "true map" if entry.kind == "planner" else "none",
             "</td><td title=\"", escape(entry.reason), "\">", escape(entry.outcome), "</td>"]
    numbers = ["{:.3f}".format(entry.ratio) if entry.success else "", "{:.2f}".format(entry.length) if entry.success
               else "", "{:.1f}".format(entry.time), "{:.2f}".format(entry.clearance),
               contacts_told(entry.contacts, entry.met, entry.struck), "{:.2f}".format(entry.cpu_ms)]
    cells += ["<td class=n>{}</td>".format(number) for number in numbers]
    return "<tr{}>{}</tr>".format("" if entry.success else " class=bad", "".join(cells))


def _view(comparison: Comparison, entries: Sequence[Entry]) -> str:
    points = np.concatenate([outline.vertices for outline in comparison.obstacles] + [entry.path for entry in entries]
                            + [comparison.optimum.points])
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    return "{:.2f} {:.2f} {:.2f} {:.2f}".format(low[0], -high[1], high[0] - low[0], high[1] - low[1])


def _picture(entry: Entry, view: str) -> str:
    text = "{:.3f} × optimum, {:.0f} s".format(entry.ratio, entry.time) if entry.success else entry.outcome
    return ("<figure><svg viewBox=\"{}\"><use href=\"#world\"/>{}</svg><figcaption><b>{}</b>: {}</figcaption></figure>"
            .format(view, polyline(thinned(entry.path), "way"), escape(entry.name), escape(text)))
