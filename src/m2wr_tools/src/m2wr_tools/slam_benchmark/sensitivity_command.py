# SPDX-License-Identifier: BSD-3-Clause
"""Varies each tuned constant of the mapper and prints what that does to the errors.

Maps all logs with every constant as it is, then with each one times 1/FACTOR and times FACTOR, every variation in a
process of its own. Logs are bags or CARMEN logs with ground truth beside them, as for 'benchmark'; without any, the
first logs of the development set of 'make_logs' are made.

Compiled kernels hold the values with which they were compiled. A constant that a kernel reads needs kernels of its own
for each variation: about a minute of processor time, with kernels in a temporary folder.

A constant that "moves nothing" has no effect on these logs. One that "breaks" loses a log, or the median error grows
by half. Ctrl-C ends; what is finished is printed, and is in the JSON file.
"""
from __future__ import annotations

import argparse
import glob
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, List, Optional, Sequence, Set, Tuple

from m2wr_files.atomic_files import write_atomically
from m2wr_gmapping import tuning
from m2wr_node import kernel
from m2wr_tools.slam_benchmark import benchmark_command as benchmark
from m2wr_tools.slam_benchmark import laser_logs, log_details, sensitivity_run, sensitivity_table, trajectory_errors
from m2wr_tools.slam_benchmark.tuned_constants import Constant, constants

RUN_LIMIT = 900.0           # of a log [s]
MEMORY = 6 << 30            # address space of a variation [bytes]; kernels and libraries alone map 1 GiB
MADE = 4                    # logs that are made if none are given


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(prog="sensitivity", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)
    add = made.add_argument
    add("logs", nargs="*", metavar="LOG", help="bags, CARMEN logs or folders of them; default: ${}, else {} logs are "
        "made".format(benchmark.FOLDER_VARIABLE, MADE))
    add("--factor", type=_factor, default=2.0, help="%(default)s")
    add("--only", nargs="+", metavar="NAME", help="constants, such as MATCHING.narrow, or whole groups")
    add("--set", choices=list(benchmark.SETS), default="default", help="set of parameters (%(default)s)")
    add("--particles", type=benchmark.whole(1), default=10, metavar="N", help="%(default)s")
    add("--seed", type=benchmark.whole(0), default=1, help="%(default)s")
    add("--jobs", type=benchmark.whole(1), default=1, metavar="N", help="processes at a time (%(default)s)")
    add("--json", metavar="FILE", default="sensitivity.json", help="written after each variation (%(default)s)")
    add("--quiet", action="store_true", help="no progress")
    return made


def _factor(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1.0 < value <= 1000.0:
        raise argparse.ArgumentTypeError("{}: expected a number above 1, at most 1000".format(text))
    return value


def compiled_constants() -> Set[str]:
    """Return the names of the constants on which compiled kernels depend, directly or by a value that follows."""
    sources = []
    for path in glob.glob(os.path.join(os.path.dirname(tuning.__file__), "*", "*.py")):
        if path.endswith(tuning.KERNEL_MODULES):
            with open(path, encoding="utf-8") as stream:
                sources.append(stream.read())
    everything = "\n".join(sources)
    found, before = set(), tuning.read_by(everything)
    for one in constants():
        present = getattr(tuning, one.group)
        sensitivity_run.change(one.group + "." + one.name, 3.0)
        if tuning.read_by(everything) != before:
            found.add(one.group + "." + one.name)
        setattr(tuning, one.group, present)
    return found


def chosen(only: Optional[Sequence[str]]) -> List[Constant]:
    """Return the constants that are varied; raises ValueError for a name that is neither a constant nor a group."""
    everything = list(constants())
    names = {one.group for one in everything} | {one.group + "." + one.name for one in everything}
    unknown = sorted(set(only or ()) - names)
    if unknown:
        raise ValueError("--only {}: no such constant or group; expected some of {}, or GROUP.NAME".format(
            " ".join(unknown), ", ".join(tuning.GROUPS)))
    return [one for one in everything if not only or one.group in only or one.group + "." + one.name in only]


def find_logs(paths: Sequence[str]) -> List[laser_logs.Log]:
    """Return the logs with ground truth of some files and folders; raises LogError if there are none."""
    found: List[laser_logs.Log] = []
    for path in paths:
        if os.path.isdir(path):
            found += laser_logs.find(path)
        else:
            name = os.path.basename(path)
            for ending in laser_logs.PACKED[1:] + (".bag", ".clf"):
                name = name[:-len(ending)] if name.endswith(ending) else name
            found += laser_logs.find(os.path.dirname(os.path.abspath(path)), [name])
    found = [log for log in found if log.truth]
    if not found:
        raise laser_logs.LogError("{}: no log with ground truth (NAME.relations, NAME.graph or NAME.ref)".format(
            " ".join(paths)))
    return found


class Sensitivity:
    """All variations.

    Parameters
    ----------
    options : argparse.Namespace
    logs : list of Log
    scratch : str
        Folder for files.
    """

    def __init__(self, options: argparse.Namespace, logs: Sequence[laser_logs.Log], scratch: str) -> None:
        self._options, self._logs, self._scratch = options, logs, scratch
        self._compiled, self._lock, self._stopped = compiled_constants(), threading.Lock(), False
        self._running: Set[subprocess.Popen[bytes]] = set()
        self._constants = chosen(options.only)
        self.base: sensitivity_table.Errors = {}
        self._found: Dict[Tuple[str, float], sensitivity_table.Errors] = {}

    @property
    def factors(self) -> List[float]:
        """Factors of each constant."""
        return [1.0 / self._options.factor, self._options.factor]

    def run(self) -> None:
        """Run everything; raises LogError if the logs cannot be mapped with the values as they are."""
        for log in self._logs:
            if not log.is_bag or not log.path.endswith(".bag"):
                laser_logs.write_bag(log, self._bag(log))
        self.base = self._vary("", 1.0)
        if not any(error is not None for error in self.base.values()):
            raise laser_logs.LogError("no log could be mapped with the constants as they are; --set and the logs must "
                                      "fit, see the messages of slam_gmapping_replay")
        names = [one.group + "." + one.name for one in self._constants]
        tasks = [(name, factor) for name in names for factor in self.factors]
        pool = ThreadPoolExecutor(self._options.jobs)
        try:
            for done, _ in enumerate(pool.map(lambda task: self._one(*task), tasks), 1):
                if not self._options.quiet:
                    sys.stderr.write("{} of {} variations\n".format(done, len(tasks)))
        finally:
            self.stop()
            pool.shutdown()

    def stop(self) -> None:
        """End all variations that run, and begin no other one."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                process.kill()

    def _one(self, name: str, factor: float) -> None:
        if self._stopped:
            return
        errors = self._vary(name, factor)
        with self._lock:
            if not self._stopped:
                self._found[name, factor] = errors
                self._save()

    def _bag(self, log: laser_logs.Log) -> str:
        return log.path if log.path.endswith(".bag") else os.path.join(self._scratch, log.name + ".bag")

    def _vary(self, name: str, factor: float) -> sensitivity_table.Errors:
        """Map all logs with one constant changed; return their errors."""
        with tempfile.TemporaryDirectory(dir=self._scratch) as folder:
            runs = []
            for log in self._logs:
                out = os.path.join(folder, log.name)
                parameters = dict(benchmark.SETS[self._options.set], particles=self._options.particles, threads=1)
                runs.append(["--bag_filename", self._bag(log), "--seed", str(self._options.seed), "--tracked",
                             out + ".txt", "--quiet"] + ["_{}:={}".format(*item) for item in parameters.items()])
            task = dict(constant=name, factor=factor, memory=MEMORY, runs=runs)
            environment = dict(os.environ)
            if name in self._compiled:
                environment["NUMBA_CACHE_DIR"] = os.path.join(folder, "kernels")
                environment[kernel.SWITCH] = "0"        # a library has the constants of the source
            self._call(task, environment)
            return {log.name: self._error(log, os.path.join(folder, log.name + ".txt")) for log in self._logs}

    def _call(self, task: Dict[str, Any], environment: Dict[str, str]) -> None:
        """Run a variation, with a time limit; a log that is not mapped then counts as lost."""
        with self._lock:
            if self._stopped:
                return
            process = subprocess.Popen([sys.executable, "-m", "m2wr_tools.slam_benchmark.sensitivity_run"],
                                       stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                       env=environment, start_new_session=True)
            self._running.add(process)
        try:
            _, told = process.communicate(json.dumps(task).encode(), timeout=RUN_LIMIT * len(task["runs"]))
            if process.returncode and not self._stopped:
                sys.stderr.write("sensitivity: {} x {:g}: {}\n".format(
                    task["constant"] or "as it is", task["factor"], told.decode(errors="replace").strip()[-500:]))
        except subprocess.TimeoutExpired:
            sys.stderr.write("sensitivity: {} x {:g}: no end in time\n".format(task["constant"], task["factor"]))
        finally:
            process.kill()
            process.wait()
            with self._lock:
                self._running.discard(process)

    @staticmethod
    def _error(log: laser_logs.Log, path: str) -> Optional[float]:
        """Return the error at loop closures [m], of relative poses if there are none; None without a trajectory."""
        if not os.path.isfile(path):
            return None
        found = trajectory_errors.score(log, path, base=log_details.read(log).base_correction())
        return None if found is None else float(found.get("again_metres", found["metres"]))

    def rows(self) -> List[Dict[str, Any]]:
        """Return the finished constants as ``sensitivity_table.markdown`` takes them."""
        made = []
        for one in self._constants:
            name = one.group + "." + one.name
            errors = {factor: self._found[name, factor] for factor in self.factors if (name, factor) in self._found}
            if errors:
                made.append(dict(constant=name, value=one.value, unit=one.unit, errors=errors))
        return made

    def _save(self) -> None:
        found = dict(factor=self._options.factor, set=self._options.set, particles=self._options.particles,
                     seed=self._options.seed, base=self.base, constants=self.rows())
        write_atomically((self._options.json, [json.dumps(found, indent=1).encode()]))


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Entry point; returns the exit code."""
    made = parser()
    options = made.parse_args(arguments)
    folder = os.path.dirname(os.path.abspath(options.json))
    if not os.path.isdir(folder):
        made.error("--json {}: no folder {}".format(options.json, folder))
    try:
        chosen(options.only)
    except ValueError as error:
        made.error(str(error))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(benchmark.INTERRUPTED))
    with tempfile.TemporaryDirectory(prefix="m2wr_gmapping_sensitivity_") as scratch:
        paths = options.logs or [path for path in [os.environ.get(benchmark.FOLDER_VARIABLE)] if path]
        measured, code = None, 0
        try:
            if not paths:
                from m2wr_tools.slam_logs import make_command  # the simulator is slow to import
                paths = [os.path.join(scratch, "logs")]
                if make_command.main([paths[0], "--set", "development", "--count", str(MADE)]):
                    return benchmark.FAILED
            measured = Sensitivity(options, find_logs(paths), scratch)
            measured.run()
        except (laser_logs.LogError, OSError) as error:
            sys.stderr.write("sensitivity: {}\n".format(error))
            code = benchmark.FAILED
        except KeyboardInterrupt:
            code = benchmark.INTERRUPTED
    if measured is not None and measured.rows():
        sys.stdout.write(sensitivity_table.markdown(measured.base, measured.rows(), measured.factors))
    return code


if __name__ == "__main__":
    sys.exit(main())
