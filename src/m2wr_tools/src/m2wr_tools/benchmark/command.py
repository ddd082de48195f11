# SPDX-License-Identifier: BSD-3-Clause
"""Implementation of the command ``benchmark``: measures the speed of the simulation in one case or in all."""
from __future__ import annotations

import json
import os
import statistics
import sys
import tempfile
from typing import TYPE_CHECKING, Any, Dict, List, Optional, TextIO

from m2wr_sim.errors import SimError
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.types import World
from m2wr_sim.ros.shared_files import find_world, model_folders, package_folder
from m2wr_tools.benchmark import c_loop, hardware, in_process, others, reference, table
from m2wr_tools.benchmark.arguments import parser
from m2wr_tools.runs.experiment import free_port

if TYPE_CHECKING:
    import argparse


_C_STEPS = 20000                # robot steps in a run


class Progress:
    """Prints the progress of a long measurement, on a terminal only."""

    def __init__(self, name: str, stream: Optional[TextIO] = None) -> None:
        self._name, self._stream = name, stream or sys.stderr
        self._shown: Optional[int] = None

    def __call__(self, share: float) -> None:
        percent = int(100.0 * share)
        if self._stream.isatty() and percent != self._shown:
            self._shown = percent
            self._stream.write("\r%s: %3d %%%s" % (self._name, percent, "\n" if percent == 100 else ""))
            self._stream.flush()


def world_text_or_path(options: argparse.Namespace, folder: str) -> str:
    """Return the world to load: the path of the requested world, or the text of the default one.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed command line.
    folder : str
        Of the package m2wr_sim.
    """
    if options.world:
        return find_world(options.world, os.path.join(folder, "worlds"))
    return reference.world_sdf(options.obstacles, options.robots)


def _load(options: argparse.Namespace, folder: str) -> World:
    folders = model_folders(folder)
    return load_world(world_text_or_path(options, folder), resolve_model=folders)


def _case(options: argparse.Namespace, world: World) -> in_process.Case:
    return in_process.Case(world, options.robots, options.step, options.beams, options.duration, options.engine)


def measure_node(options: argparse.Namespace, folder: str) -> Dict[str, Any]:
    """Return the figures of the whole node; see :class:`~m2wr_tools.benchmark.whole_node.WholeNode`.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed command line.
    folder : str
        Of the package m2wr_sim.
    """
    from m2wr_tools.benchmark.whole_node import WholeNode  # needs ROS, the rest does not
    found = world_text_or_path(options, folder)
    with tempfile.TemporaryDirectory(prefix="m2wr_sim_benchmark_") as scratch:
        if not options.world:
            path = os.path.join(scratch, "benchmark.world")
            with open(path, "w") as stream:
                stream.write(found)
            found = path
        with WholeNode(found, _case(options, World()), options.clients, options.factor, free_port()) as node:
            if options.soak:
                return node.soak(options.soak, Progress("node"))
            if options.calls:
                return node.call_times(options.calls)
            result = node.measure(options.duration, Progress("node"))
    if not options.factor:
        alone = table.run_case(_arguments(options))
        result["message_share"] = max(0.0, 1.0 - result["factor"] / alone["factor"])
    return result


def _arguments(options: argparse.Namespace) -> List[str]:
    """Return the command line of the same case without ROS."""
    arguments = ["--world", options.world] if options.world else ["--obstacles", str(options.obstacles)]
    return arguments + ["--robots", str(options.robots), "--step", repr(options.step), "--beams", str(options.beams),
                        "--duration", repr(min(options.duration, 20.0)), "--engine", options.engine]


def compare_with_c(options: argparse.Namespace, folder: str) -> Dict[str, Any]:
    """Return the medians of alternating runs of the engine's loop and the loop in C [us per step], and their ratio.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed command line.
    folder : str
        Of the package m2wr_sim.

    Raises
    ------
    SimError
        If the loops differ in their results, or the loop in C cannot be compiled.
    """
    world, robot = _load(options, folder), in_process.robot_model(options.beams)
    steps = max(100, _C_STEPS // options.robots)
    pairs, progress = [], Progress("comparison")
    with c_loop.temporary_folder() as scratch:
        program = c_loop.compile_loop(c_loop.source(), scratch)
        for repeat in range(options.repeats):
            bounded_us = in_process.time_engine(_case(options, world), steps)[0]
            engine_us, position, settings = in_process.time_engine(_case(options, world), steps, bounds=False)
            text = c_loop.world_text(world, robot, reference.robot_places(options.robots), in_process.motor_rates(),
                                     in_process.FORCE, settings, 1, steps)
            (c_us,), c_position = c_loop.run_loop(program, text)
            if position != c_position:
                raise SimError("the results of the two loops differ: the first robot ended at %s here and at %s in C"
                               % (position, c_position))
            pairs.append((engine_us, c_us, bounded_us))
            progress((repeat + 1) / options.repeats)
    engine_us, c_us, bounded_us = (statistics.median(column) for column in zip(*pairs))
    return {"step_us": engine_us, "c_step_us": c_us, "bounded_us": bounded_us,
            "ratio": statistics.median(one / two for one, two, _ in pairs),
            "steps": steps, "repeats": options.repeats}


def compare_with_other(options: argparse.Namespace) -> Dict[str, Any]:
    """Return the medians of alternating runs with another simulator; each run is a process of its own."""
    arguments, pairs, progress = _arguments(options), [], Progress("comparison")
    for repeat in range(options.repeats):
        pairs.append([table.run_case(arguments + extra) for extra in ([], ["--simulator", options.compare])])
        progress((repeat + 1) / options.repeats)
    return {"factor": statistics.median(ours["factor"] for ours, _ in pairs),
            "other_factor": statistics.median(theirs["factor"] for _, theirs in pairs),
            "faster": statistics.median(ours["factor"] / theirs["factor"] for ours, theirs in pairs),
            "speed": pairs[0][1]["speed"], "turn_rate": pairs[0][1]["turn_rate"], "repeats": options.repeats}


def run(options: argparse.Namespace, folder: str) -> Dict[str, Any]:
    """Return the figures of the requested measurement, by name.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed command line.
    folder : str
        Of the package m2wr_sim.
    """
    if options.compare == "c":
        return compare_with_c(options, folder)
    if options.compare:
        return compare_with_other(options)
    if options.simulator:
        return others.measure(options.simulator, _case(options, _load(options, folder)), Progress(options.simulator))
    if options.clients or options.node or options.soak or options.calls:
        return measure_node(options, folder)
    return in_process.measure(_case(options, _load(options, folder)), Progress("physics and scans"))


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code."""
    return perform(parser().parse_args(sys.argv[1:] if argv is None else argv))


def perform(options: argparse.Namespace) -> int:
    """Do the requested measurement and print it; return the exit code."""
    try:
        if options.table:
            sys.stdout.write(table.make(options.repeats, Progress("table")))
            return 0
        if options.gym:
            from m2wr_tools.benchmark import gym_speed  # needs gymnasium, the rest does not
            sys.stdout.write(gym_speed.report(options.gym))
            return 0
        if options.controllers:
            from m2wr_tools.benchmark import controllers_speed
            sys.stdout.write(controllers_speed.report())
            return 0
        if options.ground:
            from m2wr_tools.benchmark import ground_speed
            sys.stdout.write(ground_speed.report())
            return 0
        if options.contacts:
            from m2wr_tools.benchmark import wheel_contacts
            sys.stdout.write(wheel_contacts.report())
            return 0
        if options.cameras:
            from m2wr_tools.benchmark import sensors_speed
            sys.stdout.write(sensors_speed.report())
            return 0
        result = run(options, package_folder())
    except (SimError, ValueError) as error:
        sys.stderr.write("benchmark: %s\n" % error)
        return 1
    except KeyboardInterrupt:
        return 130
    if options.json:
        asked = {name: getattr(options, name) for name in ("world", "obstacles", "robots", "step", "beams", "duration",
                                                           "engine", "clients", "factor", "soak", "calls")}
        sys.stdout.write(json.dumps({"asked": asked, "machine": hardware.describe(), "result": result}) + "\n")
    else:
        sys.stdout.write(table.lines(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
