# SPDX-License-Identifier: BSD-3-Clause
"""The figure of drives on growing roughness: the share that reached, tipped, slipped or got stuck, with bands."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence

import matplotlib

from m2wr_campaign.rough.drive import OUTCOMES
from m2wr_navigation.compare.statistics import wilson

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402 (the backend first)

if TYPE_CHECKING:
    from numpy.typing import NDArray  # noqa: F401

COLOURS = {"reached": "#009E73", "tipped": "#D55E00", "slipped": "#0072B2", "stuck": "#CC79A7"}


def shares(rows: Sequence[Mapping[str, Any]], robot: str) -> Dict[str, List[List[float]]]:
    """Return, for each outcome, rows (roughness, share, lower and upper end of its 95 % interval).

    Parameters
    ----------
    rows : sequence of mapping
        Of :func:`m2wr_campaign.rough.drive.on_relief`, with ``level`` [m].
    robot : str
    """
    own = [row for row in rows if row["robot"] == robot]
    found: Dict[str, List[List[float]]] = {name: [] for name in OUTCOMES}
    for level in sorted({row["level"] for row in own}):
        here = [row["outcome"] for row in own if row["level"] == level]
        for name in OUTCOMES:
            count = here.count(name)
            found[name].append([level, count / len(here), *wilson(count, len(here))])
    return found


def draw(rows: Sequence[Mapping[str, Any]], path: str) -> None:
    """Draw one panel for each robot; write a file.

    Parameters
    ----------
    rows : sequence of mapping
        As for :func:`shares`.
    path : str
        PNG or SVG.
    """
    robots = list(dict.fromkeys(row["robot"] for row in rows))
    figure, panels = pyplot.subplots(1, len(robots), figsize=(5.0 * len(robots), 4.0), sharey=True, squeeze=False)
    for axes, robot in zip(panels[0], robots):
        for name, lines in shares(rows, robot).items():
            level, share, low, high = zip(*lines)
            axes.plot([100.0 * x for x in level], [100.0 * y for y in share], color=COLOURS[name], label=name,
                      marker="o", markersize=4)
            axes.fill_between([100.0 * x for x in level], [100.0 * y for y in low], [100.0 * y for y in high],
                              color=COLOURS[name], alpha=0.15, linewidth=0.0)
        axes.set_title(os.path.splitext(os.path.basename(robot))[0])
        axes.set_xlabel("roughness: RMS height of the ground,\nand height of stones [cm]")
        axes.set_ylim(-2.0, 102.0)
        axes.grid(alpha=0.3)
    panels[0][0].set_ylabel("drives of 5 m [%], bands: 95 %")
    panels[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    pyplot.close(figure)
