# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a comparison: explored area over path, and the table's figures as boxes."""
from __future__ import annotations

from typing import Any, List, Mapping, Sequence

import matplotlib
import numpy as np

from m2wr_exploration.study.team_statistics import mean_time, times

matplotlib.use("Agg")
from matplotlib import pyplot, ticker  # noqa: E402 (the backend first)

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
    """Draw the time against the number of robots, and the share that was seen over time; write a file.

    Parameters
    ----------
    rows : sequence of mapping
        Of :func:`m2wr_exploration.study.team_command.perform`.
    numbers : sequence of int
        Of robots, in the order of the legend.
    path : str
        PNG or SVG.
    """
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 4.2))
    _times_of_teams(left, rows, numbers)
    last = max((row["time"] for row in rows if row["curve"]), default=1.0)
    grid = np.linspace(0.0, last, 201)
    for number, robots in enumerate(numbers):
        curves = [np.interp(grid, *np.array(row["curve"]).T) for row in rows
                  if row["robots"] == robots and row["curve"]]
        if curves:
            low, middle, high = np.percentile(curves, (25, 50, 75), axis=0)
            colour = COLOURS[number % len(COLOURS)]
            right.plot(grid, 100.0 * middle, color=colour, label="%d" % robots)
            right.fill_between(grid, 100.0 * low, 100.0 * high, color=colour, alpha=0.15, linewidth=0.0)
    right.set_xlabel("time [s]")
    right.set_ylabel("reachable area seen [%]")
    right.set_ylim(0.0, 101.0)
    right.set_xlim(0.0, last)
    right.grid(alpha=0.3)
    right.legend(loc="lower right", title="robots: median, middle half")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _times_of_teams(axes: Any, rows: Sequence[Mapping[str, Any]], numbers: Sequence[int]) -> None:
    """Draw a line for each place, and the mean with its interval; both axes logarithmic."""
    found = {robots: times(rows, robots) for robots in numbers}
    for place in found[numbers[0]]:
        axes.plot(numbers, [found[robots][place] for robots in numbers], color="#bbbbbb", linewidth=0.8)
    if found[numbers[0]]:
        mean, low, high = np.array([mean_time(rows, robots) for robots in numbers]).T
        axes.fill_between(numbers, low, high, color=COLOURS[1], alpha=0.25, linewidth=0.0)
        axes.plot(numbers, mean, "o-", color=COLOURS[1], label="mean, 95 % interval")
        axes.plot(numbers, mean[0] * numbers[0] / np.array(numbers), ":", color="black",
                  label="if the robots shared the work of the first")
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(ticker.FormatStrFormatter("%d"))
        axes.yaxis.set_minor_formatter(ticker.FormatStrFormatter("%d"))
        axes.legend(loc="lower left")
    axes.set_xticks(numbers)
    axes.set_xticklabels(["%d" % robots for robots in numbers])
    axes.set_xlabel("robots")
    axes.set_ylabel("time until 99 % was seen [s]")
    axes.grid(alpha=0.3, which="both")
