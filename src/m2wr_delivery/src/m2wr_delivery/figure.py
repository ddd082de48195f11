# SPDX-License-Identifier: BSD-3-Clause
"""A figure of a run: the field from above, its places, and the paths of the robots."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_delivery.scenario import CHARGER_REACH, WALL

if TYPE_CHECKING:
    from m2wr_delivery.referee import Referee
    from m2wr_delivery.scenario import Scenario

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#f0e442", "#000000")  # Okabe and Ito


def save(path: str, scenario: Scenario, referee: Referee) -> None:
    """Draw a run.

    Parameters
    ----------
    path : str
        Of the picture, PNG or SVG.
    scenario : Scenario
    referee : Referee
        At the end.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LightSource
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 8.0))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    half = 0.5 * scenario.grid.size
    cell = scenario.grid.cell
    shade = LightSource(315, 45).hillshade(scenario.heights, vert_exag=2.0, dx=cell, dy=cell)
    axes.imshow(shade, cmap="gray", extent=(-half, half, -half, half), vmin=-0.6, vmax=1.0, alpha=0.6)
    for wall in scenario.walls:
        along, across = 0.5 * wall.length, 0.5 * WALL[0]
        corners = np.array([(-along, -across), (along, -across), (along, across), (-along, across)])
        turn = np.array([[math.cos(wall.yaw), math.sin(wall.yaw)], [-math.sin(wall.yaw), math.cos(wall.yaw)]])
        axes.fill(*(corners @ turn + (wall.x, wall.y)).T, color="#703010")
    angles = np.linspace(0.0, 2.0 * math.pi, 61)
    axes.plot(CHARGER_REACH * np.cos(angles), CHARGER_REACH * np.sin(angles), color="black", lw=1.0, ls="--")
    axes.annotate("base and charger", (0.0, -CHARGER_REACH), (0.0, -4.0), "data", "offset points", ha="center",
                  va="top", fontsize=8)
    for colour, (name, member) in zip(COLOURS, referee.members.items()):
        if member.path:
            axes.plot(*np.array(member.path).T, color=colour, lw=1.2, label=name)
            axes.plot(*member.path[-1], "o", color=colour, ms=5)
    for name, (x, y) in scenario.places.items():
        axes.text(x, y, name, ha="center", va="center", fontsize=9,
                  bbox={"boxstyle": "circle", "fc": "white", "ec": "black", "lw": 0.8})
    for cargo in referee.cargo.values():
        if cargo.delivered is None and not cargo.carried:
            axes.plot(*cargo.place, "s", ms=13, mfc="none", mec="#d00000", mew=1.5)
    axes.plot([], [], "s", ms=8, mfc="none", mec="#d00000", mew=1.5, label="parcel not delivered")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    done = sum(cargo.delivered is not None for cargo in referee.cargo.values())
    axes.set_title("{} of {} parcels delivered in {:.0f} s (seed {})".format(
        done, len(referee.cargo), referee.time - referee.began, scenario.seed))
    axes.legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=110, bbox_inches="tight")
