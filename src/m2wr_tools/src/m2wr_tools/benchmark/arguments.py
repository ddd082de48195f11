# SPDX-License-Identifier: BSD-3-Clause
"""The command line of ``benchmark``; what measures is imported after it has been read."""
from __future__ import annotations

import argparse
import sys
from typing import Callable

from m2wr_sim.engine_names import ENGINES
from m2wr_tools.benchmark import reference

#: Other simulators, by the names of :data:`m2wr_tools.benchmark.others.MAKERS`.
OTHERS = ("mujoco", "mujoco-tuned", "pybullet")
_PURPOSE = "Measure the speed of the simulation, in one case or in a table of cases."
_LONGEST_STEP = 0.02            # s


def _whole(least: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        value = int(text)
        if value < least:
            raise argparse.ArgumentTypeError("%s: expected a whole number of at least %d" % (text, least))
        return value
    return read


def _seconds(least: float, most: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        value = float(text)
        if not least < value <= most:
            raise argparse.ArgumentTypeError("%s: expected seconds above %g and up to %g" % (text, least, most))
        return value
    return read


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    made = argparse.ArgumentParser(prog="benchmark", description=_PURPOSE)
    made.add_argument("--world", help="world file or name of a world; default: a walled square with obstacles")
    made.add_argument("--obstacles", type=_whole(0), default=reference.OBSTACLES,
                      help="in the default world (default: %(default)s)")
    made.add_argument("--robots", type=_whole(1), default=1, help="default: %(default)s")
    made.add_argument("--step", type=_seconds(0.0, _LONGEST_STEP), default=0.001, help="[s], default: %(default)s")
    made.add_argument("--beams", type=_whole(1), default=720, help="of each scanner (default: %(default)s)")
    made.add_argument("--duration", type=_seconds(0.0, 1e6), default=20.0,
                      help="simulated seconds (default: %(default)s)")
    made.add_argument("--engine", choices=ENGINES, default="auto", help="default: %(default)s")
    made.add_argument("--clients", type=int, choices=(0, 1), default=0,
                      help="1: the whole node with a subscriber of all topics of the robots, /clock and /tf")
    made.add_argument("--node", action="store_true", help="the whole node, without a subscriber")
    made.add_argument("--soak", type=_whole(1), metavar="MINUTES",
                      help="run the whole node for this simulated time and print its memory after each minute")
    made.add_argument("--calls", type=_whole(1), metavar="NUMBER",
                      help="run the whole node and time so many calls of /gazebo/get_model_state over one connection")
    made.add_argument("--factor", type=float, default=0.0,
                      help="requested real-time factor of the node; 0: as fast as possible (default)")
    made.add_argument("--simulator", choices=sorted(OTHERS), help="measure another simulator in the same case")
    made.add_argument("--compare", choices=["c"] + sorted(OTHERS),
                      help="c: time the physics loop against the same loop written in C; others: alternating runs of "
                      "physics and scans with that simulator (install it from PyPI)")
    made.add_argument("--json", action="store_true", help="print one line of JSON")
    made.add_argument("--table", action="store_true",
                      help="measure the cases of docs/explanation/performance.md and print its tables")
    made.add_argument("--gym", type=_whole(1), nargs="?", const=64, metavar="WORLDS",
                      help="print the steps per second of the Gymnasium environments, also of so many batched worlds "
                      "(%(const)s), and of f1tenth_gym, ir-sim and MuJoCo where they are installed")
    made.add_argument("--controllers", action="store_true",
                      help="print the processor time of the controllers of ros_control in a step")
    made.add_argument("--ground", action="store_true",
                      help="print the processor time of a physics step on heightmaps, and its ratio to that on a plane")
    made.add_argument("--contacts", action="store_true",
                      help="print what wheels do on planes, steps, ramps and slopes of boxes, meshes and heightmaps, "
                      "beside closed forms: speeds, energy, drift and creep at steps of 1, 2, 5 and 10 ms")
    made.add_argument("--cameras", action="store_true",
                      help="print the processor time of cameras and of a laser with 16 layers, messages included")
    made.add_argument("--repeats", type=_whole(1), default=5,
                      help="of a comparison, and of the table's cases (default: %(default)s)")
    return made


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    options = parser().parse_args(sys.argv[1:])
    from m2wr_tools.benchmark.command import perform  # slow to import, and not needed for --help
    return perform(options)
