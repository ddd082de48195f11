# SPDX-License-Identifier: BSD-3-Clause
"""The page of a comparison in many worlds: one file of HTML with a table and all paths. It needs no network."""
from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any, Dict, List, Sequence

import numpy as np

from m2wr_navigation.compare.drawing import dot, pairs_of, polyline, shape
from m2wr_navigation.compare.movers import movers_of
from m2wr_navigation.compare.page import MARGIN, STYLE, contacts_told
from m2wr_navigation.compare.survey import ranked
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import FLOOR

if TYPE_CHECKING:
    from m2wr_navigation.compare.drive import Robot
    from m2wr_navigation.compare.scenes import Scene

    Record = Dict[str, Any]

COLUMNS = ("<tr><th>name</th><th>map</th><th class=n>success</th><th class=n>length / optimum</th>"
           "<th class=n>time s</th><th class=n>clearance m</th><th class=n>contacts</th><th class=n>CPU ms</th></tr>")


def survey_page(scenes: Sequence[Scene], records: Sequence[Record], robot: Robot) -> str:
    """Return the page.

    Parameters
    ----------
    scenes : sequence of Scene
    records : sequence of dict
        As :func:`m2wr_navigation.compare.survey.run` makes them.
    robot : Robot
    """
    rows = ranked(records)
    colours = {name: "hsl({:.0f} 75% {}%)".format(360.0 * k / max(len(rows), 1), 40 + 12 * (k % 2))
               for k, name in enumerate(sorted(row["name"] for row in rows))}
    title = "{} planners and methods in {} worlds".format(len(rows), len(scenes))
    parts = ["<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>", title, "</title><style>", STYLE,
             ".way { stroke-width: .08; } .key { display: inline-block; width: 1em; height: .7em; }</style></head>"
             "<body><h1>", title, "</h1>", _intro(robot), "<table>", COLUMNS]
    parts += [_row(row, colours[row["name"]]) for row in rows]
    parts += ["</table><h2>Worlds</h2><p>Paths that reached the goal without a contact, in the colours of the table. "
              "Dashed: the optimum. Green: start. "
              "Pink lines: where obstacles move, from the dots on.</p><div class=grid>"]
    parts += [_picture(scene, [record for record in records if record["scene"] == scene.name], robot, colours)
              for scene in scenes]
    return "".join(parts + ["</div></body></html>\n"])


def _intro(robot: Robot) -> str:
    return ("<p>Each drives once in each world. Planners know the true map; pure pursuit drives along their paths. "
            "Methods see only the laser. A success is the goal without a contact; its interval is Wilson's, 95 %. "
            "Other figures are means with the 95 % interval of a bootstrap: length over the exact shortest path of a "
            "disc of {:.2f} m, simulated time, and least clearance, of the successes; CPU time of one plan, or of one "
            "cycle of a method at 20 Hz. Contacts with an obstacle that moves, less than a second apart, are one "
            "meeting; it has run into the robot if it closed the gap at least as fast.</p>").format(
                robot.body.inscribed_radius)


def interval(three: Sequence[Any], digits: int) -> str:
    """Return a mean with its interval, or nothing if there is none.

    Parameters
    ----------
    three : sequence of float or None
        Mean, low and high end.
    digits : int
        After the point.
    """
    if three[0] is None:
        return ""
    return "{0:.{3}f} <small>({1:.{3}f} to {2:.{3}f})</small>".format(*three, digits)


def _row(row: Record, colour: str) -> str:
    low, high = row["success_interval"]
    cells = ["<td><span class=key style=\"background:{}\"></span> {}</td>".format(colour, escape(row["name"])),
             "<td>{}</td>".format("true map" if row["kind"] == "planner" else "none")]
    shares = "{} of {} <small>({:.0f} to {:.0f} %)</small>"
    numbers = [shares.format(row["successes"], row["worlds"], 100.0 * low, 100.0 * high),
               interval(row["ratio"], 3), interval(row["time"], 1), interval(row["clearance"], 2),
               contacts_told(row["contacts"], row["met"], row["struck"]), interval(row["cpu_ms"], 2)]
    return "<tr>{}</tr>".format("".join(cells + ["<td class=n>{}</td>".format(text) for text in numbers]))


def _picture(scene: Scene, records: Sequence[Record], robot: Robot, colours: Dict[str, str]) -> str:
    world, top = read_world(scene.world), robot.body.height
    obstacles = obstacle_outlines(world, FLOOR, top, (scene.start[0], scene.start[1]))
    best = shortest_path(obstacles, robot.body.inscribed_radius, robot.body.axle(scene.start), scene.goal)
    corners = np.concatenate([outline.vertices for outline in obstacles] + [best.points])
    low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
    lines: List[str] = [shape(outline) for outline in obstacles] + [
        polyline(mover.path, "mover") + dot(mover.path[0], "mover") for mover in movers_of(world, FLOOR, top)]
    for record in records:
        if record["success"]:
            lines.append("<polyline class=way style=\"stroke:{}\" points=\"{}\"><title>{}</title></polyline>".format(
                colours[record["name"]], pairs_of(np.array(record["path"])), escape(record["name"])))
    lines += [polyline(best.points, "best"), dot(best.points[0], "start"), dot(best.points[-1], "goal")]
    failed = ["{} ({})".format(record["name"], record["outcome"] if not record["contacts"] else "contact")
              for record in records if not record["success"]]
    return ("<figure><svg viewBox=\"{:.2f} {:.2f} {:.2f} {:.2f}\">{}</svg><figcaption><b>{}</b>: optimum {:.1f} m. "
            "{}</figcaption></figure>").format(
                low[0], -high[1], high[0] - low[0], high[1] - low[1], "".join(lines), escape(scene.name), best.length,
                "Not: " + escape(", ".join(failed)) + "." if failed else "All reached the goal.")
