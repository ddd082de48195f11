# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a comparison: explored area over path, and the table's figures as boxes."""
from __future__ import annotations

from typing import Any, List, Mapping, Sequence

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402 (the backend first)

COLOURS = ("#888888", "#1f77b4", "#d95f02", "#1b9e77", "#7570b3", "#e7298a")


def draw(rows: Sequence[Mapping[str, Any]], strategies: List[str], path: str) -> None:
    """Draw the share of the reachable area over the path, in units of the offline tour; write a file.

    Parameters
    ----------
    rows : sequence of mapping
        Of :func:`m2wr_exploration.study.command.perform`.
    strategies : list of str
        In the order of the legend.
    path : str
        PNG or SVG.
    """
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 4.2), gridspec_kw={"width_ratios": (3, 2)})
    grid = np.linspace(0.0, 4.0, 161)
    ratios: List[List[float]] = []
    for number, name in enumerate(strategies):
        colour = COLOURS[number % len(COLOURS)]
        own = [row for row in rows if row["strategy"] == name and row["curve"] and row["offline"] > 0.0]
        curves = []
        for row in own:
            curve = np.array(row["curve"])
            curves.append(np.interp(grid * row["offline"], curve[:, 0], curve[:, 1]))
        if curves:
            low, middle, high = np.percentile(curves, (25, 50, 75), axis=0)
            left.plot(grid, 100.0 * middle, color=colour, label=name)
            left.fill_between(grid, 100.0 * low, 100.0 * high, color=colour, alpha=0.15, linewidth=0.0)
        ratios.append([row["length"] / row["offline"] for row in own if row["share"] >= 0.99])
    left.set_xlabel("path / path of the offline tour")
    left.set_ylabel("reachable area seen [%]")
    left.set_ylim(0.0, 101.0)
    left.set_xlim(0.0, 4.0)
    left.grid(alpha=0.3)
    left.legend(loc="lower right", title="median, middle half")
    right.boxplot(ratios, vert=False, widths=0.6)
    right.set_yticks(range(1, len(strategies) + 1))
    right.set_yticklabels(strategies)
    right.invert_yaxis()
    right.set_xlabel("path until the end / offline tour")
    right.grid(axis="x", alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def draw_teams(rows: Sequence[Mapping[str, Any]], numbers: Sequence[int], path: str) -> None:
    """Draw the share of the reachable area over time, for each number of robots; write a file.

    Parameters
    ----------
    rows : sequence of mapping
        Of :func:`m2wr_exploration.study.team_command.perform`.
    numbers : sequence of int
        Of robots, in the order of the legend.
    path : str
        PNG or SVG.
    """
    figure, axes = pyplot.subplots(figsize=(7.0, 4.2))
    last = max((row["time"] for row in rows if row["curve"]), default=1.0)
    grid = np.linspace(0.0, last, 201)
    for number, robots in enumerate(numbers):
        curves = [np.interp(grid, *np.array(row["curve"]).T) for row in rows
                  if row["robots"] == robots and row["curve"]]
        if curves:
            low, middle, high = np.percentile(curves, (25, 50, 75), axis=0)
            colour = COLOURS[number % len(COLOURS)]
            axes.plot(grid, 100.0 * middle, color=colour, label="%d" % robots)
            axes.fill_between(grid, 100.0 * low, 100.0 * high, color=colour, alpha=0.15, linewidth=0.0)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("reachable area seen [%]")
    axes.set_ylim(0.0, 101.0)
    axes.set_xlim(0.0, last)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", title="robots: median, middle half")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
