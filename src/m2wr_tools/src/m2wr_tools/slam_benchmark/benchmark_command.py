# SPDX-License-Identifier: BSD-3-Clause
"""Maps laser logs with several seeds and prints accuracy, time and memory as a table.

A folder holds NAME.clf or NAME.bag and, for accuracy, NAME.relations, NAME.graph or NAME.ref beside it (as they are or
packed as .xz or .gz): relations as 'stamp stamp x y z roll pitch yaw', poses as 'stamp x y theta'.
"""
from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Sequence, Tuple

from m2wr_files.atomic_files import write_atomically
from m2wr_tools.slam_benchmark import (
    benchmark_table,
    difficulty_table,
    finished_runs,
    laser_logs,
    log_details,
    trajectory_errors,
)

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

FOLDER_VARIABLE = "M2WR_SLAM_LOGS"
SETS = OrderedDict((
    ("default", {}),
    ("report", dict(maxUrange=6.0, maxRange=8.0, minimumScore=50, srr=0.01, srt=0.02, str=0.01, stt=0.02,
                    linearUpdate=0.5, angularUpdate=0.436)),
))
MADE = OrderedDict((("development", 24), ("exam", 100)))        # set of make_logs -> number of logs
FAILED, USAGE, INTERRUPTED = 1, 2, 130
RUN_LIMIT = 3600.0          # time limit of a run [s]


class BenchmarkError(RuntimeError):
    """A run has failed; the message names it and quotes its output."""


def _pair(kind: Callable[[str], Any]) -> Callable[[str], Tuple[str, Any]]:
    def read(text: str) -> Tuple[str, Any]:
        name, found, value = text.partition("=")
        if not (name and found):
            raise argparse.ArgumentTypeError("{}: expected NAME=VALUE".format(text))
        return name, kind(value)
    return read


def whole(least: int) -> Callable[[str], int]:
    """Return a reader of whole numbers of at least ``least``, as a type for argparse."""
    def read(text: str) -> int:
        if not text.isdigit() or int(text) < least:
            raise argparse.ArgumentTypeError("{}: expected a whole number of at least {}".format(text, least))
        return int(text)
    return read


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(prog="benchmark", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)
    add = made.add_argument
    add("folder", nargs="?", default=os.environ.get(FOLDER_VARIABLE), help="default: $" + FOLDER_VARIABLE)
    add("--make", choices=list(MADE), metavar="SET", help="first make the logs of a set in the folder, those that are "
        "not there, and map only them: {}".format(" or ".join(MADE)))
    add("--count", type=whole(1), metavar="N", help="with --make: how many logs, from number 0 on ({})".format(
        ", ".join("{}: {}".format(*item) for item in MADE.items())))
    add("--logs", nargs="+", metavar="NAME", help="default: all of the folder")
    add("--sets", nargs="+", choices=list(SETS), default=list(SETS), help="sets of parameters (all)")
    add("--particles", nargs="+", type=whole(1), metavar="N", default=[30, 80], help="default: 30 80")
    add("--seeds", type=whole(1), default=3, help="runs with different seeds (%(default)s)")
    add("--threads", type=whole(0), default=1, help="of each run; 0: one per core (%(default)s)")
    add("--laser-x", nargs="+", type=_pair(float), default=[], metavar="NAME=X",
        help="how far the laser of a CARMEN log sits in front of the odometry's centre [m] (0)")
    add("--set", nargs="+", type=_pair(str), default=[], dest="more", metavar="PARAMETER=VALUE",
        help="further parameters of every run")
    add("--converter", metavar="SCRIPT", help="makes bags of CARMEN logs: SCRIPT LOG BAG [--laser-x X], stamps "
        "moved by 1000 s; default: built in")
    add("--keep", metavar="FOLDER", help="keep bags, trajectories, maps and statistics there")
    add("--resume", action="store_true", help="with --keep: skip the runs that are finished there")
    add("--json", metavar="FILE", help="write all runs as JSON")
    add("--table", metavar="README.md", help="insert the table between the lines '{}' and '{}' of this file".format(
        benchmark_table.BEGIN, benchmark_table.END))
    add("--quiet", action="store_true", help="no progress")
    return made


def make_logs(options: argparse.Namespace) -> int:
    """Make the logs that ``--make`` names and choose them; returns the exit code."""
    from m2wr_tools.slam_logs import log_sets, make_command  # the simulator is slow to import
    count = options.count or MADE[options.make]
    code = make_command.main([options.folder, "--set", options.make, "--count", str(count)])
    options.logs = [log_sets.recipe(options.make, number).name for number in range(count)]
    return code


def replay_program() -> List[str]:
    """Return the command of slam_gmapping_replay with this interpreter."""
    return [sys.executable, "-c", "import sys; from m2wr_gmapping.replay.replay_command import main; sys.exit(main())"]


class Benchmark:
    """All requested runs.

    Parameters
    ----------
    options : argparse.Namespace
    scratch : str
        Folder for files.
    """

    def __init__(self, options: argparse.Namespace, scratch: str) -> None:
        self._options, self._scratch = options, scratch
        self.results: List[Dict[str, Any]] = []
        self._converted: Optional[str] = None              # log whose bag was written
        self._odometry: Optional[Tuple[FloatArray, FloatArray]] = None      # of that log, with its stamps
        self._program = finished_runs.program_digest()

    def run(self) -> List[Dict[str, Any]]:
        """Run everything, one run at a time; return the results."""
        options = self._options
        found = laser_logs.find(options.folder, options.logs)
        unknown = set(name for name, _ in options.laser_x) - set(log.name for log in found)
        if unknown:
            raise laser_logs.LogError("--laser-x {}: no such log".format(", ".join(sorted(unknown))))
        total = len(found) * len(options.sets) * len(options.particles) * options.seeds
        for log in found:
            bag = os.path.join(self._scratch, log.name + ".bag")
            for name in options.sets:
                for particles in options.particles:
                    for seed in range(1, options.seeds + 1):
                        self._say("{} of {}: {}, {}, {} particles, seed {}".format(
                            len(self.results) + 1, total, log.name, name, particles, seed))
                        self.results.append(self._one(log, bag, name, particles, seed))
            if not options.keep and os.path.exists(bag):
                os.unlink(bag)
            self._converted = None
        return self.results

    def _say(self, text: str) -> None:
        if not self._options.quiet:
            sys.stderr.write(text + "\n")
            sys.stderr.flush()

    def _convert(self, log: laser_logs.Log, bag: str) -> None:
        if self._converted == log.name:
            return
        self._say("{}: writing the bag".format(log.name))
        self._converted, laser_x = log.name, self._laser_x(log)
        if log.is_bag or not self._options.converter:
            laser_logs.write_bag(log, bag, laser_x)
            self._odometry = laser_logs.bag_odometry(bag) if log.is_bag and log.truth else None
            return
        done = subprocess.run([sys.executable, self._options.converter, log.path, bag, "--laser-x", str(laser_x)],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
        if done.returncode or not os.path.isfile(bag):
            raise BenchmarkError("{} {}: {}".format(self._options.converter, log.path, done.stdout.strip()[-1000:]))

    def _laser_x(self, log: laser_logs.Log) -> float:
        return dict(self._options.laser_x).get(log.name, 0.0)

    def _one(self, log: laser_logs.Log, bag: str, name: str, particles: int, seed: int) -> Dict[str, Any]:
        out = os.path.join(self._scratch, "{}_{}_{}_{}".format(log.name, name, particles, seed))
        parameters = dict(SETS[name], particles=particles, threads=self._options.threads)
        parameters.update(self._options.more)
        details = log_details.read(log)
        inputs = [log.path, *sorted(log.truth.values())]
        depends = finished_runs.key(program=self._program, parameters=parameters, seed=seed, laser_x=self._laser_x(log),
                                    files=[finished_runs.file_mark(path) for path in inputs])
        kept = finished_runs.load(out, depends) if self._options.resume else None
        if kept is not None:
            return kept
        self._convert(log, bag)
        command = replay_program() + [
            "--bag_filename", bag, "--seed", str(seed), "--tracked", out + ".txt", "--online",
            out + ".online", "--map", out, "--stats", out + ".json", "--quiet"]
        command += ["_{}:={}".format(*item) for item in parameters.items()]
        try:
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                                  timeout=RUN_LIMIT)
        except subprocess.TimeoutExpired:
            raise BenchmarkError("{}: no end after {:g} s".format(out, RUN_LIMIT)) from None
        if done.returncode:
            raise BenchmarkError("{}: slam_gmapping_replay ended with {}: {}".format(
                out, done.returncode, done.stdout.strip()[-1000:]))
        with open(out + ".json", encoding="utf-8") as stream:
            statistics = json.load(stream)
        found = trajectory_errors.score(log, out + ".txt", out + ".online", self._odometry,
                                        details.base_correction())
        if found is not None:
            found.update(log_details.calibration_errors(details, statistics))
        result = dict(log=log.name, set=name, particles=particles, seed=seed, statistics=statistics, score=found,
                      difficulties=details.difficulties)
        finished_runs.keep(out, depends, result)
        return result


def tell(benchmark: Benchmark, options: argparse.Namespace, put: bool) -> bool:
    """Print the table, insert it into a document and write all runs as JSON, as requested.

    Parameters
    ----------
    benchmark : Benchmark
        Finished runs.
    options : argparse.Namespace
        Command line options.
    put : bool
        Whether the table may be inserted.

    Returns
    -------
    bool
        Whether all files were written.
    """
    text, grouped = benchmark_table.markdown(benchmark.results), difficulty_table.markdown(benchmark.results)
    if grouped is not None:
        text += "\n" + grouped
    sys.stdout.write(text)
    try:
        if options.table and put:
            benchmark_table.put(options.table, text)
        if options.json:
            runs = dict(machine=platform.processor() or platform.machine(), cores=os.cpu_count(),
                        threads=options.threads, further=dict(options.more), runs=benchmark.results)
            write_atomically((options.json, [json.dumps(runs, indent=1, sort_keys=True).encode()]))
    except OSError as error:
        sys.stderr.write("benchmark: {}\n".format(error))
        return False
    return True


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Entry point; returns the exit code."""
    made = parser()
    options = made.parse_args(arguments)
    if not options.folder:
        made.error("no folder: expected one on the command line or in " + FOLDER_VARIABLE)
    if options.resume and not options.keep:
        made.error("--resume: expected --keep FOLDER as well, the folder of the runs to resume")
    if options.make and options.logs:
        made.error("--logs and --make: expected only one of them")
    if not options.make and options.count:
        made.error("--count: expected --make as well")
    if not options.make and not os.path.isdir(options.folder):
        made.error("{}: no such folder".format(options.folder))
    if options.table:
        try:
            benchmark_table.check(options.table)              # before the runs
        except (OSError, ValueError) as error:
            made.error(str(error))
    folder = os.path.dirname(os.path.abspath(options.json or "."))
    if options.json and not os.path.isdir(folder):
        made.error("--json {}: no folder {}".format(options.json, folder))
    if options.keep:
        os.makedirs(options.keep, exist_ok=True)
    if options.make:
        code = make_logs(options)
        if code:
            return code
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(INTERRUPTED))     # child processes end and files are removed
    with tempfile.TemporaryDirectory(prefix="m2wr_gmapping_benchmark_") as scratch:
        benchmark, code = Benchmark(options, options.keep or scratch), 0
        try:
            benchmark.run()
        except (laser_logs.LogError, BenchmarkError, OSError) as error:
            sys.stderr.write("benchmark: {}\n".format(error))
            code = FAILED
        except KeyboardInterrupt:
            code = INTERRUPTED
    if benchmark.results and not tell(benchmark, options, put=not code):
        return FAILED
    return code


if __name__ == "__main__":
    sys.exit(main())
