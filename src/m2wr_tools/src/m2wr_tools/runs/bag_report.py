# SPDX-License-Identifier: BSD-3-Clause
"""What is in a recorded bag: topics, rates, gaps, and how the run ended."""
from __future__ import annotations

import argparse
import os
import sys
from collections import OrderedDict
from typing import TYPE_CHECKING, Dict, List, Optional, Tuple

import numpy as np

from m2wr_tools.runs.summary import format_table, summarise_log
from m2wr_view.bag_file import open_bag, topic_types
from m2wr_view.errors import ViewError
from m2wr_view.run_log import read_run
from m2wr_view.run_series import MARKERS, read_footprint, read_world

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

GAP, LEAST_GAP = 3.0, 0.1        # a gap is a pause longer than this number of median periods, and than this time [s]
PERIODIC = 20           # least number of messages for a rate
#: Topics that another program needs to show a run, and what is missing without them.
WANTED = OrderedDict((("/clock", "simulated time"), ("/odom", "the path"), ("/tf", "frames"), ("/tf_static", "frames"),
                      ("/m2wr/laser/scan", "the laser"), (MARKERS, "the world"),
                      ("/robot_description", "the robot's shape"), ("/bug2/state", "the outcome")))


class Topic:
    """One topic in numbers.

    Parameters
    ----------
    name, kind : str
        Topic and message type.
    times : (n,) float64
        The recorder's times [s], in the order of recording.

    Attributes
    ----------
    rate : float or None
        Messages a second between the first and the last [Hz]; None for less than ``PERIODIC`` of them.
    gaps : int
        How many pauses are longer than ``GAP`` median periods and ``LEAST_GAP`` [s].
    longest, longest_at : float or None
        The longest pause and when it began [s].
    """

    def __init__(self, name: str, kind: str, times: FloatArray) -> None:
        self.name, self.kind, self.count = name, kind, len(times)
        self.rate: Optional[float] = None
        self.longest: Optional[float] = None
        self.longest_at: Optional[float] = None
        self.gaps = 0
        pauses = np.diff(times)
        if self.count < PERIODIC or not times[-1] > times[0]:
            return
        self.rate = (self.count - 1) / float(times[-1] - times[0])
        most = int(np.argmax(pauses))
        self.longest, self.longest_at = float(pauses[most]), float(times[most])
        usual = float(np.median(pauses))
        if usual > 0.0:
            self.gaps = int(np.count_nonzero(pauses > max(GAP * usual, LEAST_GAP)))


def read_topics(path: str) -> Tuple[List[Topic], float, float]:
    """Return the :class:`Topic` of each topic of a bag, by name, and first and last time [s].

    Raises
    ------
    ViewError
        If the bag cannot be read or is empty.
    """
    with open_bag(path) as bag:
        if not bag.get_message_count():
            raise ViewError("bag %s: there is no message in it; expected a recorded run" % path)
        kinds = topic_types(bag)
        times: Dict[str, List[float]] = {}
        for topic, _, recorded in bag.read_messages(raw=True):
            times.setdefault(topic, []).append(recorded.to_sec())
    begin, end = (choose(choose(entry) for entry in times.values()) for choose in (min, max))
    return [Topic(name, kinds[name], np.array(times[name])) for name in sorted(times)], begin, end


def format_topics(topics: List[Topic]) -> str:
    """Return a table with a line for each topic."""
    rows = [("topic", "type", "messages", "rate", "longest pause", "gaps")]
    for topic in topics:
        rate = "%.1f Hz" % topic.rate if topic.rate is not None else "-"
        pause = "-"
        if topic.longest is not None and topic.longest_at is not None:
            pause = "%.2f s at %.1f s" % (topic.longest, topic.longest_at)
        rows.append((topic.name, topic.kind, "%d" % topic.count, rate, pause, "%d" % topic.gaps if topic.rate else "-"))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(width) if column < 2 else cell.rjust(width)
                               for column, (cell, width) in enumerate(zip(row, widths))).rstrip() for row in rows)


def report(path: str) -> str:
    """Return the whole report of a bag as text; ViewError if the bag cannot be read."""
    topics, begin, end = read_topics(path)
    names = {topic.name for topic in topics}
    lines = ["%s: %.1f MB, %d messages, %.1f s (%.3f to %.3f)" % (
        path, os.path.getsize(path) * 1e-6, sum(topic.count for topic in topics), end - begin, begin, end),
        "", format_topics(topics), ""]
    lost = ["%s (%s)" % (name, what) for name, what in WANTED.items() if name not in names]
    lines.append("not in the bag: " + ", ".join(lost) if lost else
                 "self-contained: world, robot and frames are in the bag")
    log = read_run(path)
    if log.times is not None or log.states is not None:
        solids = read_world(path)
        lines += ["", format_table(summarise_log(log, solids.blocking if solids else None, read_footprint(path)))]
    return "\n".join(lines)


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; 0 if the bag could be read."""
    parser = argparse.ArgumentParser(prog="bag_report", description=__doc__)
    parser.add_argument("bag", nargs="+", help="recorded bags")
    code = 0
    for path in parser.parse_args(sys.argv[1:] if argv is None else argv).bag:
        try:
            print(report(path), flush=True)
        except ViewError as error:
            sys.stderr.write("bag_report: %s\n" % error)
            code = 1
    return code
