# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a soak run."""
import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402 (after the choice of a back end that needs no display)

import slopes  # noqa: E402

_ROWS = (("memory", "resident memory [MB]", "MB"), ("descriptors", "open file descriptors", "descriptors"),
         ("threads", "threads", "threads"))


def _levels_label(slope, unit):
    """Return the text for the levels, one between two resets; the slope and its bounds are given a unit."""
    return "median of each stretch" if slope is None else "medians; slope in %s: %s" % (unit, slope)


def draw(path, title, runs, shift_seconds, told):
    """Draw the figure.

    Parameters
    ----------
    path : str
    title : str
    runs : dict
        Name of a process -> list of watch.Sample.
    shift_seconds : float
        Length of a shift [s, simulated].
    told : dict
        (process, quantity) -> text for the legend.
    """
    figure, axes = pyplot.subplots(len(_ROWS), len(runs), figsize=(11, 7.5), sharex=True, squeeze=False)
    for column, (process, samples) in enumerate(runs.items()):
        for row, (name, label, unit) in enumerate(_ROWS):
            panel = axes[row][column]
            panel.plot([sample.hours for sample in samples], [getattr(sample, name) for sample in samples], ".",
                       color="0.65", markersize=2, label="samples")
            hours, values = slopes.levels(samples, name, shift_seconds)
            panel.plot(hours, values, "-o", color="C%d" % row, markersize=3, linewidth=1,
                       label=_levels_label(told.get((process, name)), unit))
            panel.set_ylim(0.0, 1.3 * max((getattr(sample, name) for sample in samples), default=1.0))
            panel.grid(alpha=0.3)
            panel.legend(loc="lower right", fontsize=8)
            if column == 0:
                panel.set_ylabel(label)
        axes[0][column].set_title(process)
        axes[-1][column].set_xlabel("simulated hours")
    figure.suptitle(title)
    figure.tight_layout()
    figure.savefig(path, dpi=90)
    pyplot.close(figure)
