# SPDX-License-Identifier: BSD-3-Clause
"""The command line of ``demo``; what runs and draws is imported after it has been read."""
from __future__ import annotations

import argparse
import sys
from typing import List, Optional

_PURPOSE = ("Run Bug 2 from start to goal without a display; print a table, draw a picture and "
            "keep the bag.")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="demo", description=_PURPOSE)
    parser.add_argument("--world", default="world02.world", help="world file or name (default: %(default)s)")
    parser.add_argument("--start", nargs=2, type=float, default=(0.0, 8.0), metavar=("X", "Y"), help="default: 0 8")
    parser.add_argument("--yaw", type=float, default=0.0, help="heading at the start [rad]")
    parser.add_argument("--goal", nargs=2, type=float, default=(0.0, -4.0), metavar=("X", "Y"), help="default: 0 -4")
    parser.add_argument("--seed", type=int, default=0, help="seed of the laser's noise")
    parser.add_argument("--real-time-factor", type=float,
                        help="simulated seconds per second (default: 0, as fast as possible; with --live 1); the "
                        "result is the same")
    parser.add_argument("--timeout", type=float, default=900.0, help="wall seconds allowed (default: %(default)s)")
    parser.add_argument("--out", default="demo_output", help="folder for bag and picture (default: %(default)s)")
    parser.add_argument("--live", action="store_true", help="live view in web browsers; it shows the recorded run "
                        "afterwards, until Ctrl-C")
    parser.add_argument("--live-port", type=int, default=0, metavar="PORT",
                        help="of the live view; 0: the first free one from 8080 on (default)")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; 0 only if the goal was reached without contact."""
    options = _parser().parse_args(sys.argv[1:] if argv is None else argv)
    from m2wr_tools.runs.demo_run import perform  # slow to import, and not needed for --help
    return perform(options)
