# SPDX-License-Identifier: BSD-3-Clause
"""The page of a BARN benchmark: one file of HTML with a table, all worlds, paths and failures. It needs no network."""
from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence

import numpy as np

from m2wr_navigation.barn.score import LATER_LEAST, LEAST, MOST, PUBLISHED, ranked
from m2wr_navigation.barn.worlds import CELL, GOAL, OPTIMAL_SPEED, START, cylinders_of, place_of, reference_length
from m2wr_navigation.compare.drawing import cross, dot, pairs_of
from m2wr_navigation.compare.page import STYLE
from m2wr_navigation.compare.survey_page import interval

if TYPE_CHECKING:
    from m2wr_navigation.barn.fields import Field

    Record = Dict[str, Any]

MARGIN = 0.4                # m
MORE_STYLE = """.way { stroke-width: .06; } .bad { stroke-dasharray: .15 .1; } .end { stroke: #c00; stroke-width: .08; }
.key { display: inline-block; width: 1em; height: .7em; } .best { stroke-width: .04; }"""
COLUMNS = ("<tr><th>name</th><th class=n>runs</th><th class=n>success</th><th class=n>collision</th>"
           "<th class=n>time-out</th><th class=n>stuck</th><th class=n>time s</th><th class=n>score</th>"
           "<th class=n>later score</th><th class=n>CPU ms</th></tr>")


def barn_page(fields: Mapping[str, Field], records: Sequence[Record], optimal: Mapping[str, float]) -> str:
    """Return the page.

    Parameters
    ----------
    fields : mapping of str to Field
        By the names of their scenes.
    records : sequence of dict
        Of :func:`m2wr_navigation.barn.runs.run`.
    optimal : mapping of str to float
        Optimal time of each world [s].
    """
    rows = ranked(records, optimal)
    colours = {row["name"]: "hsl({:.0f} 80% 40%)".format((210.0 + 360.0 * k / len(rows)) % 360.0)
               for k, row in enumerate(rows)}
    title = "BARN: {} in {} worlds".format(", ".join(row["name"] for row in rows), len(fields))
    parts = ["<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>", escape(title),
             "</title><style>", STYLE, MORE_STYLE, "</style></head><body><h1>", escape(title), "</h1>", _intro(),
             "<table>", COLUMNS]
    parts += [_row(row, colours[row["name"]]) for row in rows]
    parts += ["<tr><td>published: {}</td><td></td><td class=n>{:.3f}</td><td></td><td></td><td></td><td class=n>{:.1f}"
              "</td><td class=n>{:.3f}</td><td></td><td></td></tr>".format(escape(name), *figures)
              for name, figures in PUBLISHED.items()]
    parts += ["</table><h2>Failures</h2>", _failures(records), "<h2>Worlds</h2><p>Dashed blue: the reference path. A "
              "dashed line in a colour of the table is a run that failed; the cross is its end.</p><div class=grid>"]
    parts += [_picture(name, field, [record for record in records if record["scene"] == name], colours)
              for name, field in fields.items()]
    return "".join(parts + ["</div></body></html>\n"])


def _intro() -> str:
    return ("<p>Each robot knows only its laser and its odometry. A run succeeds less than 1 m from the goal, by the "
            "truth, and ends at the first contact or after 100 s. Time is that of the successes, from 0.1 m on. The "
            "score is the optimal time, the reference length at {:g} m/s, over the time, clipped to {:g} to {:g} times "
            "the optimal time, 0 for a failure; the later score begins at {:g} times. Means are those of the worlds, "
            "with the 95 % interval of a bootstrap; success has Wilson's. The published figures are from the 50 worlds "
            "of the challenge, of the same distribution.</p>").format(OPTIMAL_SPEED, LEAST, MOST, LATER_LEAST)


def _row(row: Record, colour: str) -> str:
    low, high = row["success_interval"]
    numbers = [str(row["runs"]), "{:.3f} <small>({:.3f} to {:.3f})</small>".format(row["success"], low, high),
               str(row["collision"]), str(row["time_out"]), str(row["stuck"]), interval(row["time"], 1),
               interval(row["score"], 3), interval(row["later_score"], 3), "{:.1f}".format(row["cpu_ms"])]
    return "<tr><td><span class=key style=\"background:{}\"></span> {}</td>{}</tr>".format(
        colour, escape(row["name"]), "".join("<td class=n>{}</td>".format(text) for text in numbers))


def _failures(records: Sequence[Record]) -> str:
    failed = ["<li><b>{}</b>, world {}, run {}: {} after {:.1f} s. {}</li>".format(
        escape(record["name"]), escape(record["scene"]), record["seed"], escape(record["outcome"]), record["time"],
        escape(record["reason"])) for record in records if not record["success"]]
    return "<ul>{}</ul>".format("".join(failed)) if failed else "<p>None.</p>"


def _picture(name: str, field: Field, records: Sequence[Record], colours: Dict[str, str]) -> str:
    pillars = cylinders_of(field.full)
    points = np.array([pillar[:2] for pillar in pillars] + [START[:2], GOAL])
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    shapes = "".join("M{:.3f} {:.3f}h.001".format(x, -y) for x, y, _ in pillars)
    lines: List[str] = ["<path d=\"{}\" stroke=\"#8a8f98\" stroke-width=\"{:g}\" stroke-linecap=\"round\"/>".format(
        shapes, CELL)]
    reference = np.array([START[:2], *(place_of(*cell) for cell in field.path), GOAL])
    lines.append("<polyline class=best points=\"{}\"/>".format(pairs_of(reference)))
    for record in records:
        path = np.array(record["path"])
        lines.append("<polyline class=\"way{}\" style=\"stroke:{}\" points=\"{}\"><title>{}</title></polyline>".format(
            "" if record["success"] else " bad", colours[record["name"]], pairs_of(path), escape(record["name"])))
        if not record["success"]:
            lines.append(cross(path[-1], "end"))
    lines += [dot(np.array(START[:2]), "start"), dot(np.array(GOAL), "goal")]
    counts = ["{} {} of {}".format(each, sum(record["success"] for record in records if record["name"] == each),
                                   sum(record["name"] == each for record in records))
              for each in sorted({record["name"] for record in records})]
    return ("<figure><svg viewBox=\"{:.2f} {:.2f} {:.2f} {:.2f}\">{}</svg><figcaption><b>{}</b>: {:.1f} m, dimension "
            "{:.1f}, tortuosity {:.2f}. {}</figcaption></figure>").format(
                low[0], -high[1], high[0] - low[0], high[1] - low[1], "".join(lines), escape(name),
                reference_length(field), field.measures["dimension"], field.measures["tortuosity"],
                escape("; ".join(counts)))
