# SPDX-License-Identifier: BSD-3-Clause
"""A run as a picture: obstacles from above, the path of the robot, hit and leave points."""
from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Protocol, Sequence, Union

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.ticker import MaxNLocator

from m2wr_view.errors import ViewError
from m2wr_view.layout import with_obstacles
from m2wr_view.outlines import M2WR_FOOTPRINT

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline
    from m2wr_view.run_log import Drive, RunLog

DOTS_PER_INCH = 100
SIZE = (10.0, 10.8)         # inches: a square of axes, the title above it and the legend below
AXES = (0.075, 0.135, 0.9, 0.8333)
MARGIN = 0.5                # m around the run and the obstacles
OUTLINE_PERIOD = 10.0       # s between two faint outlines of the robot

# colours of Okabe and Ito, which colour-blind readers can distinguish
STATE_COLOURS = {"go_to_point": "#0072B2", "wall_following": "#E69F00", "goal_reached": "#009E73",
                 "goal_unreachable": "#CC79A7"}
OTHER_COLOUR = "#000000"    # a state that is not in the list, or not recorded
START_COLOUR, GOAL_COLOUR, HIT_COLOUR, LEAVE_COLOUR = "#F0E442", "#009E73", "#D55E00", "#56B4E9"
OBSTACLE_COLOUR, OVERHANG_COLOUR, LINE_COLOUR, ROBOT_COLOUR = "#909090", "#D0D0D0", "#505050", "#000000"


class RunFigures(Protocol):
    """Figures of a run for the title of its picture; None where not known."""

    @property
    def final_state(self) -> Optional[str]:
        """Last state of Bug 2."""

    @property
    def duration(self) -> Optional[float]:
        """Simulated time of the run [s]."""

    @property
    def path_length(self) -> Optional[float]:
        """Distance travelled [m]."""

    @property
    def least_clearance(self) -> Optional[float]:
        """Least distance from an obstacle [m]."""

    @property
    def contacts(self) -> Optional[int]:
        """Number of contacts that the robot began."""


def draw_run(log: RunLog, obstacles: Sequence[Outline], anything: Sequence[Outline], summary: RunFigures,
             path: str) -> None:
    """Write the picture of a run as PNG, 1000 by 1080 pixels.

    Parameters
    ----------
    log : m2wr_view.run_log.RunLog
        The run; what it lacks is left out.
    obstacles, anything : sequence of m2wr_view.outlines.Outline
        Obstacles at the height of the robot; these and the shapes above it.
    summary : RunFigures
        For the title.
    path : str
        File to write.

    Raises
    ------
    ViewError
        If the file cannot be written.
    """
    figure = run_figure(log, obstacles, anything, summary)
    try:
        figure.savefig(os.fspath(path), format="png", dpi=DOTS_PER_INCH)
    except OSError as error:
        raise ViewError("picture %s: %s; expected a file in a folder that can be written to"
                        % (path, error.strerror or error)) from error


def run_figure(log: RunLog, obstacles: Sequence[Outline], anything: Sequence[Outline], summary: RunFigures) -> Figure:
    """Return the picture as a matplotlib Figure with one Axes in metres; see :func:`draw_run`.

    Parameters
    ----------
    log : m2wr_view.run_log.RunLog
        The run; what it lacks is left out.
    obstacles : sequence of m2wr_view.outlines.Outline
        Obstacles at the height of the robot.
    anything : sequence of m2wr_view.outlines.Outline
        Obstacles and the shapes above the robot.
    summary : RunFigures
        For the title.
    """
    figure = Figure(figsize=SIZE, dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)         # this figure's own canvas: whatever backend the caller uses stays as it is
    axes = figure.add_axes(AXES)
    handles = draw_path(axes, log, obstacles, anything)
    axes.set_title(_title(summary), fontsize=13)
    figure.legend(handles=handles, loc="lower center", ncol=4, fontsize=10, frameon=False)
    return figure


def draw_path(axes: Axes, log: RunLog, obstacles: Sequence[Outline], anything: Sequence[Outline]) -> List[Artist]:
    """Draw a run from above.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        In metres.
    log : m2wr_view.run_log.RunLog
        The run; what it lacks is left out.
    obstacles : sequence of m2wr_view.outlines.Outline
        Obstacles at the height of the robot.
    anything : sequence of m2wr_view.outlines.Outline
        Obstacles and the shapes above the robot.

    Returns
    -------
    list of matplotlib.artist.Artist
        Entries for a legend.
    """
    handles = _draw_obstacles(axes, obstacles, anything)
    handles += _draw_path(axes, log)
    handles += _draw_line(axes, log)
    handles += _draw_robot(axes, log)
    handles += _draw_marks(axes, log)
    _set_view(axes, _run_points(log), anything)
    return handles


# ---- layers ------------------------------------------------------------------------------------------------------

def _patches(outline: Outline, **style: Any) -> Union[Circle, Polygon]:
    """Return the matplotlib patches that fill an outline, which is rounded only if it is a disc."""
    if len(outline.vertices) == 1:
        return Circle(tuple(outline.vertices[0]), outline.radius, **style)
    return Polygon(outline.vertices, closed=True, **style)


def _draw_obstacles(axes: Axes, obstacles: Sequence[Outline], anything: Sequence[Outline]) -> List[Artist]:
    handles: List[Artist] = []
    for outline in anything:
        axes.add_patch(_patches(outline, facecolor=OVERHANG_COLOUR, linewidth=0.0, zorder=1))
    for outline in obstacles:
        axes.add_patch(_patches(outline, facecolor=OBSTACLE_COLOUR, linewidth=0.0, zorder=2))
    if obstacles:
        handles.append(Patch(facecolor=OBSTACLE_COLOUR, label="obstacle"))
    return handles


def _draw_path(axes: Axes, log: RunLog) -> List[Artist]:
    """Draw the path, one line for each visit of a state, without gaps in between."""
    drive = log.drive
    if drive is None or len(drive.times) < 2:
        return []
    states = log.states or ()
    number = np.searchsorted([time for time, _ in states], drive.times, side="right") - 1
    borders = np.concatenate(([0], np.flatnonzero(np.diff(number)) + 1, [len(number) - 1]))
    seen: Dict[str, Line2D] = {}
    for begin, end in zip(borders[:-1], borders[1:]):
        name = states[number[begin]][1] if number[begin] >= 0 else "unknown"
        here = slice(begin, end + 1)
        line, = axes.plot(drive.x[here], drive.y[here], color=STATE_COLOURS.get(name, OTHER_COLOUR), linewidth=2.6,
                          solid_capstyle="round", zorder=5)
        if np.sum(np.hypot(np.diff(drive.x[here]), np.diff(drive.y[here]))) > 0.02:
            seen.setdefault(name, line)         # no legend entry for a state in which the robot does not move
    return [Line2D([], [], color=line.get_color(), linewidth=2.6, label=name.replace("_", " "))
            for name, line in seen.items()]


def _draw_line(axes: Axes, log: RunLog) -> List[Artist]:
    if log.start is None or log.goal is None:
        return []
    line, = axes.plot(*zip(log.start, log.goal), color=LINE_COLOUR, linestyle=(0, (6, 4)), linewidth=1.2, zorder=4,
                      label="m-line")
    return [line]


def _draw_robot(axes: Axes, log: RunLog) -> List[Artist]:
    """Draw the robot's outline at the start and the end, and faintly in between."""
    drive = log.drive
    if drive is None or not len(drive.times):
        return []
    for time in np.arange(drive.times[0] + OUTLINE_PERIOD, drive.times[-1], OUTLINE_PERIOD):
        _draw_footprint(axes, drive, int(np.searchsorted(drive.times, time)), alpha=0.4)
    for index in (0, len(drive.times) - 1):
        _draw_footprint(axes, drive, index, alpha=1.0)
    return [Patch(facecolor="none", edgecolor=ROBOT_COLOUR, label="robot, every %g s" % OUTLINE_PERIOD)]


def _draw_footprint(axes: Axes, drive: Drive, index: int, alpha: float) -> None:
    cosine, sine = math.cos(drive.yaw[index]), math.sin(drive.yaw[index])
    turn, place = np.array([(cosine, sine), (-sine, cosine)]), np.array([drive.x[index], drive.y[index]])
    for part in M2WR_FOOTPRINT:
        corners = part.vertices.dot(turn) + place
        shape = Circle(tuple(corners[0]), part.radius) if len(corners) == 1 else Polygon(corners, closed=True)
        shape.set(facecolor="none", edgecolor=ROBOT_COLOUR, linewidth=1.0, alpha=alpha, zorder=6)
        axes.add_patch(shape)


def _draw_marks(axes: Axes, log: RunLog) -> List[Artist]:
    """Draw start, goal, hit and leave points; each kind has a shape of its own, not only a colour."""
    marks = ((log.start, "o", 11, START_COLOUR, "start"), (log.goal, "*", 20, GOAL_COLOUR, "goal"),
             (log.hit_points, "v", 11, HIT_COLOUR, "hit point"), (log.leave_points, "^", 11, LEAVE_COLOUR,
                                                                  "leave point"))
    handles: List[Artist] = []
    for points, marker, size, colour, label in marks:
        if points is None or not len(points):
            continue
        points = np.atleast_2d(points)
        if len(points) == 1 and label in ("start", "goal"):
            label += " (%g, %g)" % tuple(points[0])
        handles += axes.plot(points[:, 0], points[:, 1], linestyle="none", marker=marker, markersize=size,
                             markerfacecolor=colour, markeredgecolor="black", markeredgewidth=0.9, zorder=8,
                             label=label)
    return handles


# ---- view --------------------------------------------------------------------------------------------------------

def _run_points(log: RunLog) -> FloatArray:
    """Return all points (n, 2) of the run that must be in the picture."""
    groups = [np.atleast_2d(points) for points in (log.start, log.goal, log.hit_points, log.leave_points)
              if points is not None and len(points)]
    drive = log.drive
    if drive is not None:
        groups.append(np.column_stack((drive.x, drive.y)))
    return np.concatenate(groups) if groups else np.zeros((1, 2))


def _set_view(axes: Axes, points: FloatArray, obstacles: Sequence[Outline]) -> None:
    """Show the run and its obstacles in a square, with the same scale on both axes."""
    low, high = with_obstacles(points.min(axis=0), points.max(axis=0), obstacles)
    centre, half = 0.5 * (low + high), 0.5 * float(np.max(high - low)) + MARGIN
    axes.set_xlim(centre[0] - half, centre[0] + half)
    axes.set_ylim(centre[1] - half, centre[1] + half)
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=12, steps=(1, 2, 5, 10)))
    axes.set_axisbelow(True)
    axes.grid(True, color="#E6E6E6", linewidth=0.8)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def _title(summary: RunFigures) -> str:
    words = [(summary.final_state or "state not recorded").replace("_", " ")]
    if summary.duration is not None:
        words[0] += " after %.1f s" % summary.duration
    if summary.path_length is not None:
        words.append("%.2f m driven" % summary.path_length)
    if summary.least_clearance is not None and math.isfinite(summary.least_clearance):
        words.append("least clearance %.2f m" % summary.least_clearance)
    if summary.contacts is not None:
        words.append("no contact" if not summary.contacts else "%d contact%s" % (
            summary.contacts, "" if summary.contacts == 1 else "s"))
    return ", ".join(words)
