# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a run on a page: path against the m-line, clearance, speeds, states, odometry against truth."""
from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from m2wr_view import run_series
from m2wr_view.errors import ViewError
from m2wr_view.run_log import read_run
from m2wr_view.run_picture import OTHER_COLOUR, STATE_COLOURS, draw_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from m2wr_node.array_types import FloatArray
    from m2wr_view.run_log import Drive, RunLog

SIZE = (13.0, 8.6)          # inches
DOTS_PER_INCH = 110
ALONG_COLOUR, ACROSS_COLOUR, TURN_COLOUR, COMMAND_COLOUR = "#0072B2", "#D55E00", "#009E73", "#909090"
KINDS = (".png", ".svg", ".pdf")


def draw_figure(path: str, out: str, robot: str = "m2wr") -> List[str]:
    """Draw the figure of a bag.

    Parameters
    ----------
    path : str
        A finished bag.
    out : str
        File to write: .png, .svg or .pdf.
    robot : str
        Name of the model whose true states are compared.

    Returns
    -------
    list of str
        What is missing because it was not recorded, one sentence each.

    Raises
    ------
    ViewError
        If the bag cannot be read, has no odometry, or the file cannot be written.
    """
    if os.path.splitext(out)[1].lower() not in KINDS:
        raise ViewError("figure %s: its ending is %r; expected one of %s"
                        % (out, os.path.splitext(out)[1], ", ".join(KINDS)))
    figure, missing = run_page(path, robot)
    try:
        figure.savefig(out, dpi=DOTS_PER_INCH)
    except OSError as error:
        raise ViewError("figure %s: %s; expected a file in a folder that can be written to"
                        % (out, error.strerror or error)) from error
    return missing


def run_page(path: str, robot: str = "m2wr") -> Tuple[Figure, List[str]]:
    """Return the figure of a bag, and sentences on what is missing; see :func:`draw_figure`.

    Parameters
    ----------
    path : str
        A finished bag.
    robot : str
        Name of the model whose true states are compared.

    Raises
    ------
    ViewError
        If the bag cannot be read or has no odometry.
    """
    log = read_run(path)
    drive = log.drive
    if drive is None or len(drive.times) < 2:
        raise ViewError("bag %s: no run in topic /odom; expected odometry, so that there is a path to draw" % path)
    solids, missing = run_series.read_world(path), []
    if solids is None:
        missing.append("no topic %s: obstacles and clearance are left out" % run_series.MARKERS)
    blocking = solids.blocking if solids else []
    figure = Figure(figsize=SIZE, dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)         # this figure's own canvas: whatever backend the caller uses stays as it is
    grid = figure.add_gridspec(4, 2, width_ratios=(1.0, 1.05), left=0.055, right=0.985, bottom=0.155, top=0.93,
                               wspace=0.15, hspace=0.28)
    above = figure.add_subplot(grid[:, 0])
    handles = draw_path(above, log, blocking, blocking + (solids.hanging if solids else []))
    panels = [figure.add_subplot(grid[row, 1]) for row in range(4)]
    clearance = run_series.clearance_series(log, blocking, run_series.read_footprint(path))
    _draw_clearance(panels[0], clearance, drive)
    _draw_speeds(panels[1:3], path, drive, missing)
    truth = run_series.truth_against_odometry(path, log, robot)
    _draw_truth(panels[3], truth, above)
    if truth is None:
        missing.append("no states of \"%s\" in topic %s: odometry is not compared with the truth"
                       % (robot, run_series.ROBOT_STATES))
    for panel in panels:
        _draw_states(panel, log, drive)
        panel.set_xlim(drive.times[0], drive.times[-1])
        panel.grid(True, color="#E6E6E6", linewidth=0.8)
        panel.tick_params(labelbottom=panel is panels[-1])
    panels[-1].set_xlabel("simulated time [s]")
    figure.align_ylabels(panels)
    figure.suptitle(_title(path, log, drive, clearance), fontsize=13, y=0.985)
    handles += [Patch(facecolor=STATE_COLOURS.get(name, OTHER_COLOUR), alpha=0.18,
                      label="band: " + name.replace("_", " "))
                for name in dict.fromkeys(name for _, name in log.states or ())]
    figure.legend(handles=handles, loc="lower center", ncol=6, fontsize=9, frameon=False)
    return figure, missing


def _title(path: str, log: RunLog, drive: Drive, clearance: Optional[Tuple[FloatArray, FloatArray]]) -> str:
    words = [os.path.basename(path)]
    if log.states:
        words.append(log.states[-1][1].replace("_", " "))
    words.append("%.2f m in %.1f s" % (float(np.sum(np.hypot(np.diff(drive.x), np.diff(drive.y)))),
                                       drive.times[-1] - drive.times[0]))
    if clearance is not None:
        words.append("least clearance %.2f m" % clearance[1].min())
    return ", ".join(words)


def _nothing(panel: Axes, text: str) -> None:
    panel.text(0.5, 0.5, text, transform=panel.transAxes, ha="center", va="center", color="#606060")


def _draw_states(panel: Axes, log: RunLog, drive: Drive) -> None:
    """Colour the background by state."""
    states = log.states or ()
    ends = [begin for begin, _ in states[1:]] + [drive.times[-1]]
    for (begin, name), end in zip(states, ends):
        panel.axvspan(max(begin, drive.times[0]), max(end, drive.times[0]), linewidth=0.0, alpha=0.18, zorder=0,
                      color=STATE_COLOURS.get(name, OTHER_COLOUR))


def _draw_clearance(panel: Axes, clearance: Optional[Tuple[FloatArray, FloatArray]], drive: Drive) -> None:
    panel.set_ylabel("clearance [m]")
    if clearance is None:
        _nothing(panel, "no obstacles recorded")
        return
    times, distance = clearance
    panel.plot(times, distance, color="#000000", linewidth=1.3)
    least = int(np.argmin(distance))
    panel.plot(times[least], distance[least], "o", color=ACROSS_COLOUR, markersize=6)
    late = times[least] > 0.5 * (drive.times[0] + drive.times[-1])
    panel.annotate("%.2f m" % distance[least], (times[least], distance[least]), fontsize=9,
                   xytext=(-8 if late else 8, 9), textcoords="offset points", ha="right" if late else "left")
    panel.set_ylim(0.0, 1.1 * float(np.max(distance)) + 0.05)


def _draw_speeds(panels: Sequence[Axes], path: str, drive: Drive, missing: List[str]) -> None:
    measured, commanded = run_series.odometry_speeds(path), run_series.commanded_speeds(path)
    if commanded is None:
        missing.append("no topic %s: commands are left out" % run_series.COMMANDS)
    for panel, field, label in zip(panels, ("linear", "angular"), ("speed [m/s]", "turn rate [rad/s]")):
        panel.set_ylabel(label)
        if commanded is not None:
            panel.step(commanded.times, getattr(commanded, field), where="post", color=COMMAND_COLOUR, linewidth=1.0,
                       label="commanded")
        if measured is None:
            continue
        panel.plot(measured.times, getattr(measured, field), color=ALONG_COLOUR, linewidth=1.2, label="measured")
        inside = (measured.times >= drive.times[0]) & (measured.times <= drive.times[-1])
        values = getattr(measured, field)[inside]
        if len(values):
            low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
            space = 0.15 * max(high - low, 0.1)
            panel.set_ylim(low - space, high + space)
    panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), fontsize=8, ncol=2, frameon=False)


def _draw_truth(panel: Axes, truth: Optional[run_series.Truth], above: Axes) -> None:
    panel.set_ylabel("odometry - truth")
    if truth is None:
        _nothing(panel, "true states not recorded")
        return
    for values, colour, label in ((1e3 * truth.along, ALONG_COLOUR, "along [mm]"),
                                  (1e3 * truth.across, ACROSS_COLOUR, "across [mm]"),
                                  (1e3 * truth.turn, TURN_COLOUR, "heading [mrad]")):
        panel.plot(truth.times, values, color=colour, linewidth=1.2, label=label)
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), fontsize=8, ncol=3, frameon=False)
    most = max(1.0, *(1.15 * float(np.abs(values).max()) for values in (1e3 * truth.along, 1e3 * truth.across,
                                                                        1e3 * truth.turn)))
    panel.set_ylim(-most, most)
    if max(np.abs(truth.along).max(), np.abs(truth.across).max()) > 0.05:       # else it hides the path
        line, = above.plot(truth.x, truth.y, color="#000000", linewidth=1.0, linestyle=":", zorder=6)
        above.annotate("truth", (truth.x[-1], truth.y[-1]), fontsize=9, xytext=(6, 6), textcoords="offset points")


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point of plot_run; 0 if the figure was written."""
    parser = argparse.ArgumentParser(prog="plot_run", description=__doc__)
    parser.add_argument("bag", help="a recorded run, as bug2.launch record:=FILE makes it")
    parser.add_argument("--out", help="file to write, .png, .svg or .pdf (default: beside the bag, .png)")
    parser.add_argument("--robot", default="m2wr", help="model whose true states are compared (default: %(default)s)")
    options = parser.parse_args(sys.argv[1:] if argv is None else argv)
    out = options.out or os.path.splitext(options.bag)[0] + "_run.png"
    try:
        missing = draw_figure(options.bag, out, options.robot)
    except ViewError as error:
        sys.stderr.write("plot_run: %s\n" % error)
        return 1
    for sentence in missing:
        sys.stderr.write("plot_run: bag %s: %s\n" % (options.bag, sentence))
    print(out)
    return 0
