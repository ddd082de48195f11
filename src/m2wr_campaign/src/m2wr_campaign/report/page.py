# SPDX-License-Identifier: BSD-3-Clause
"""The page of a study: tables, charts and pictures in one file of HTML that needs no network."""
from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence

from m2wr_campaign.report.figures import (
    DIFFICULTIES,
    best_median_worst,
    compared,
    difficulties,
    edges_of,
    gain_of,
    ranked,
    shares_by,
    variants,
)
from m2wr_campaign.report.pictures import Worlds, chart
from m2wr_navigation.compare.drive import TIME_OUT
from m2wr_navigation.compare.page import STYLE
from m2wr_navigation.compare.survey_page import interval

if TYPE_CHECKING:
    from m2wr_campaign.report.figures import Interval, MethodFigures
    from m2wr_campaign.store.result_file import ResultFile

    Row = Dict[str, Any]
    Groups = Mapping[str, Sequence[Row]]

MOST_COMPARED = 40          # methods in the table of all pairs
MOST_FAILURES = 20_000      # pictures
OPENED = 60                 # pictures of failures that are drawn at once
LONGEST_REASON, LONGEST_LOG = 300, 3000         # characters

MORE_STYLE = """h2 { margin-top: 2em; } .way { stroke-width: 2px; vector-effect: non-scaling-stroke; }
.end { stroke: #c00; stroke-width: 2px; vector-effect: non-scaling-stroke; fill: none; }
.scroll { overflow-x: auto; } .matrix { width: auto; font-size: 12px; } .matrix td { text-align: right; }
.matrix th { font-weight: normal; white-space: nowrap; } .matrix b { font-weight: 700; }
.chart { width: 200px; background: none; border: 0; font-size: 9px; } .grid-line { stroke: #ddd; }
.trend { fill: none; stroke: #0072b2; stroke-width: 1.5; } .bar { stroke: #0072b2; } .mark { fill: #0072b2; }
.three { display: grid; grid-template-columns: repeat(3, minmax(0, 1fr)); gap: 1em; max-width: 900px; }
.three svg, .grid svg { height: 220px; } details { margin: .5em 0; } summary { cursor: pointer; }
pre { font-size: 12px; overflow: auto; max-height: 16em; background: #f4f4f4; padding: .5em; }
"""
#: Pictures of failures are in templates until their part of the page is opened, so that a large page stays quick.
SCRIPT = ("<script>document.addEventListener('toggle', function (event) { "
          "var kept = event.target.querySelector(':scope > template'); "
          "if (kept) kept.replaceWith(kept.content); }, true);</script>")


def study_page(results: ResultFile) -> str:
    """Return the page.

    Parameters
    ----------
    results : ResultFile
    """
    name, text = results.study()
    runs = list(results.runs())
    groups = variants(runs)
    order = ranked(groups)
    worlds = Worlds(results.worlds(), results.path_of)
    title = "Study {}: {} methods, {} runs".format(name, len(groups), len(runs))
    parts = ["<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>", escape(title),
             "</title><style>", STYLE, MORE_STYLE, "</style></head><body><h1>", escape(title), "</h1>",
             _intro(runs, results.planned()), worlds.definitions()]
    if runs:
        parts += [_methods(order), _pairs(order, groups), _matrix(order, groups), _difficulty(order, groups, runs),
                  _overlays(order, groups, worlds), *_failures(order, groups, worlds)]
    parts += ["<h2>The study</h2><pre>", escape(text), "</pre>", _versions(runs), SCRIPT, "</body></html>\n"]
    return "".join(parts)


def _intro(runs: Sequence[Row], planned: int) -> str:
    failed = sum(run["status"] == "failed" for run in runs)
    missing = "" if len(runs) == planned else " <b>{} of its {} runs are not done yet.</b>".format(
        planned - len(runs), planned)
    return ("<p>{} runs in {} worlds; {} gave no result.{} A success is the goal without a contact. All intervals are "
            "95 %: Wilson's for the share of successes, a bootstrap of worlds with a fixed seed for the rest. Runs in "
            "one world resemble one another: Wilson's interval takes each as a new one, and is too narrow if there "
            "are few worlds; for the rest a world counts once.</p>").format(
                len(runs), len({run["world"] for run in runs}), failed, missing)


def _shown(three: Interval, digits: int, scale: float = 1.0) -> str:
    return interval([scale * value if math.isfinite(value) else None for value in three], digits)


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> str:
    """Return a table whose first columns have texts, the others numbers."""
    head = "".join("<th{}>{}</th>".format("" if k < texts else " class=n", title) for k, title in enumerate(titles))
    body = "".join("<tr>{}</tr>".format("".join("<td{}>{}</td>".format("" if k < texts else " class=n", cell)
                                                for k, cell in enumerate(row))) for row in rows)
    return "<table><tr>{}</tr>{}</table>".format(head, body)


def _methods(order: Sequence[MethodFigures]) -> str:
    rows = [[escape(one.label), "{} of {}".format(one.successes, one.runs), _shown(one.share, 1, 100.0),
             _shown(one.means["ratio"], 3), _shown(one.means["time"], 1), _shown(one.means["clearance"], 2),
             _shown(one.means["turning"], 1), _shown(one.means["cpu_ms"], 2)] for one in order]
    return ("<h2>Methods</h2><p>Length is that of the axle's path over the exact shortest one; clearance the least "
            "distance of the robot's outline from an obstacle; turning the sum of all changes of the heading. These "
            "are of the successes. CPU time is that of one plan, or of one cycle of a method.</p>"
            + _table(["method", "successes", "share %", "length / optimum", "time s", "clearance m", "turning rad",
                      "CPU ms"], rows))


def _pairs(order: Sequence[MethodFigures], groups: Groups) -> str:
    if len(order) < 2:
        return ""
    first, rows = order[0].label, []
    for other in order[1:]:
        found = compared(groups[first], groups[other.label])
        rows.append([escape(other.label), str(found.pairs), str(found.only_first), str(found.only_second),
                     _shown(found.gain, 1, 100.0), _shown(found.ratio, 3), _shown(found.time, 1)])
    return ("<h2>Pairs: {0} and each other</h2><p>Both in the same worlds with the same seeds. Differences are {0} "
            "less the other: of the share of successes, and of length and time where both had success.</p>{1}").format(
                escape(first), _table(["other", "pairs", "only {} succeeds".format(escape(first)),
                                       "only the other", "successes, points of %", "length / optimum", "time s"], rows))


def _matrix(order: Sequence[MethodFigures], groups: Groups) -> str:
    shown = order[:MOST_COMPARED]
    if len(shown) < 3:
        return ""
    head = "<tr><th></th>{}</tr>".format("".join("<th>{}</th>".format(k + 1) for k in range(len(shown))))
    gains: Dict[Any, Interval] = {}
    for k, one in enumerate(shown):
        for j, other in enumerate(shown[k + 1:], k + 1):
            mean, low, high = gain_of(groups[one.label], groups[other.label])
            gains[k, j], gains[j, k] = (mean, low, high), (-mean, -high, -low)
    rows = ["<tr><th>{}. {}</th>{}</tr>".format(k + 1, escape(one.label), "".join(
        "<td></td>" if k == j else _gain(gains[k, j], one.label, other.label) for j, other in enumerate(shown)))
        for k, one in enumerate(shown)]
    left_out = "" if shown is order or len(shown) == len(order) else " The first {} methods are shown.".format(
        len(shown))
    return ("<h3>All pairs</h3><p>Points of % by which the method of the row has more successes than that of the "
            "column. Bold: the interval does not contain 0; of so many pairs some do so by chance.{}</p><div "
            "class=scroll><table class=matrix>{}{}</table></div>").format(left_out, head, "".join(rows))


def _gain(three: Interval, label: str, other: str) -> str:
    if not math.isfinite(three[0]):
        return "<td></td>"
    mean, low, high = (100.0 * value for value in three)
    colour = "rgba({},{:.2f})".format("0,114,178" if mean > 0.0 else "213,94,0", min(abs(mean) / 100.0, 0.6))
    text = "{:+.0f}".format(mean) if round(mean) else "0"
    return "<td style=\"background:{}\" title=\"{}: {:+.1f} ({:+.1f} to {:+.1f})\">{}</td>".format(
        colour, escape("{} less {}".format(label, other)), mean, low, high,
        "<b>{}</b>".format(text) if low > 0.0 or high < 0.0 else text)


def _difficulty(order: Sequence[MethodFigures], groups: Groups, runs: Sequence[Row]) -> str:
    tables = {name: difficulties(runs, name) for name in DIFFICULTIES}
    edges = {name: edges_of(sorted(table.values())) for name, table in tables.items()}
    used = [name for name in DIFFICULTIES if edges[name]]
    if not used:
        return ""
    rows = []
    for one in order:
        cells = [escape(one.label)]
        for name in used:
            table = tables[name]
            points = shares_by(groups[one.label], lambda run, table=table: table.get(  # type: ignore[misc]
                (run["world"], run["robot"]), math.nan), edges[name])
            cells.append(chart(points, (edges[name][0], edges[name][-1]),
                               "successes of {} by {}".format(one.label, DIFFICULTIES[name])))
        rows.append(cells)
    return ("<h2>Success against difficulty</h2><p>Share of successes with Wilson's interval, for as many worlds in "
            "each point. Long and winding shortest paths are hard; a large distance from obstacles is easy.</p>"
            + _table(["method"] + [DIFFICULTIES[name] for name in used], rows, 1 + len(used)))


def _overlays(order: Sequence[MethodFigures], groups: Groups, worlds: Worlds) -> str:
    parts = ["<h2>Best, median and worst run</h2><p>Successes by length over the optimum, then the other runs. Green: "
             "start. Orange: goal and path. A red cross: where a run without success ended.</p>"]
    for one in order:
        pictures = "".join("<figure>{}<figcaption><b>{}</b>: {}</figcaption></figure>".format(
            worlds.picture(run), which, escape(_told(run, worlds))) for which, run in
            best_median_worst(groups[one.label]))
        parts.append("<h3>{}</h3><div class=three>{}</div>".format(escape(one.label), pictures))
    return "".join(parts)


def _told(run: Row, worlds: Worlds) -> str:
    """Return a run in a line."""
    place = "{}, run {}".format(worlds.label(run["world"]), run["repeat"])
    if run["success"]:
        return "{}: {:.3f} × optimum, {:.0f} s".format(place, run["ratio"], run["time"])
    contacts = ", {} contacts".format(run["contacts"]) if run["contacts"] else ""
    seconds = "" if run["time"] is None else " after {:.0f} s".format(run["time"])
    reason = run["reason"][:LONGEST_REASON] if run["outcome"] not in ("reached", TIME_OUT) else ""
    return "{}: {}{}{}{}".format(place, run["outcome"], seconds, contacts, ". " + reason if reason else "")


def _failures(order: Sequence[MethodFigures], groups: Groups, worlds: Worlds) -> List[str]:
    total, drawn = sum(one.runs - one.successes for one in order), 0
    if not total:
        return ["<h2>Failures</h2><p>None.</p>"]
    parts = ["<h2>Failures</h2><p>{} runs without success. Open a line to see them.</p>".format(total)]
    for one in order:
        failed = [run for run in groups[one.label] if not run["success"]]
        for first in range(0, len(failed), OPENED):
            some = failed[first:first + OPENED]
            if drawn + len(some) > MOST_FAILURES:
                parts.append("<p>The other {} are not drawn: their reasons are in the results file.</p>".format(
                    total - drawn))
                return parts
            drawn += len(some)
            counts = ", ".join("{} {}".format(number, what) for what, number in one.outcomes.items())
            summary = "{}: {} of {} runs ({}){}".format(
                one.label, len(failed), one.runs, counts,
                "" if len(failed) <= OPENED else ", {} to {}".format(first + 1, first + len(some)))
            pictures = "<div class=grid>{}</div>".format("".join(_failure(run, worlds) for run in some))
            parts.append("<details{}><summary>{}</summary>{}</details>".format(
                " open" if total <= OPENED else "", escape(summary),
                pictures if total <= OPENED else "<template>{}</template>".format(pictures)))
    return parts


def _failure(run: Row, worlds: Worlds) -> str:
    log = "" if not run["log"] else "<details><summary>log</summary><pre>{}</pre></details>".format(
        escape(run["log"][-LONGEST_LOG:]))
    return "<figure>{}<figcaption>{}{}</figcaption></figure>".format(worlds.picture(run), escape(_told(run, worlds)),
                                                                     log)


def _versions(runs: Sequence[Row]) -> str:
    return "<p><small>Versions: {}</small></p>".format(
        escape("; ".join(sorted({run["versions"] for run in runs})))) if runs else ""
