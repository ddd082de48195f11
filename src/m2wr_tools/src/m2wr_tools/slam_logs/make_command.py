# SPDX-License-Identifier: BSD-3-Clause
"""Make laser logs with ground truth: m2wr drives through generated buildings in the simulator.

For each log NAME.bag (/scan, /tf), NAME.graph (true poses), NAME.json (its difficulties, and all that it was made of)
and NAME.world (the building) are written. `rosrun m2wr_gmapping benchmark FOLDER` maps them. Logs that are there
already are kept.

Tune a mapper on the set `development` only, and judge it by the set `exam`: their random sequences differ.
"""
from __future__ import annotations

import argparse
import os
import signal
import sys
from multiprocessing import Pool
from typing import List, Optional, Sequence, Tuple

import numpy as np

from m2wr_tools.slam_logs import log_files, log_sets
from m2wr_tools.slam_logs.drive import StuckError

FAILED, INTERRUPTED = 1, 130
MOST = 100000               # logs of a set
_FILES = 5                  # word of the random seed of drops and delays, see log_sets.make


def _whole(text: str) -> int:
    if not text.isdigit() or int(text) > MOST:
        raise argparse.ArgumentTypeError("%s: expected a whole number of at most %d" % (text, MOST))
    return int(text)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(prog="make_logs", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("folder", help="where to write; made if it does not exist")
    made.add_argument("--set", choices=sorted(log_sets.SETS), default="development", help="default: %(default)s")
    made.add_argument("--first", type=_whole, default=0, metavar="N", help="number of the first log (%(default)s)")
    made.add_argument("--count", type=_whole, default=24, metavar="N", help="how many (%(default)s)")
    made.add_argument("--jobs", type=_whole, default=os.cpu_count() or 1, metavar="N",
                      help="processes (one per core)")
    return made


def make_one(name: str, number: int, folder: str) -> Tuple[str, str]:
    """Make one log, unless its bag exists.

    Parameters
    ----------
    name : str
        Of the set.
    number : int
        Of the log.
    folder : str
        Where to write it.

    Returns
    -------
    str, str
        Name of the log, and a line about it, which begins with ``failed`` if it could not be made.
    """
    title = log_sets.recipe(name, number).name
    if os.path.exists(os.path.join(folder, title + ".bag")):
        return title, "there already"
    try:
        log = log_sets.make(name, number)
        log_files.write(log, folder, np.random.default_rng([log_sets.SETS[name], number, _FILES]))
    except (StuckError, OSError) as error:
        return title, "failed: %s" % error
    return title, "%.0f m, %.0f s, %d scans, odometry off by %.1f %% at the end" % (
        log.drive.length, log.drive.stamps[-1], len(log.taken), 100.0 * log_files.drift(log))


def _make(job: Tuple[str, int, str]) -> Tuple[str, str]:
    return make_one(*job)


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Entry point; returns the exit code."""
    made = parser()
    options = made.parse_args(arguments)
    if not (options.count and options.jobs):
        made.error("--count and --jobs: expected at least 1")
    try:
        os.makedirs(options.folder, exist_ok=True)
    except OSError as error:
        made.error("%s: no folder can be made: %s" % (options.folder, error.strerror))
    failed: List[str] = []
    jobs = [(options.set, number, options.folder) for number in range(options.first, options.first + options.count)]
    # Ctrl-C reaches all processes of a terminal; the first one ends the others
    with Pool(options.jobs, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        try:
            for done, (title, line) in enumerate(pool.imap_unordered(_make, jobs), 1):
                failed += [title] if line.startswith("failed") else []
                sys.stderr.write("%d of %d: %s: %s\n" % (done, len(jobs), title, line))
        except KeyboardInterrupt:
            return INTERRUPTED
    if failed:
        sys.stderr.write("make_logs: %d of %d logs could not be made: %s\n" % (
            len(failed), len(jobs), ", ".join(failed)))
        return FAILED
    return 0
