# SPDX-License-Identifier: BSD-3-Clause
"""Run a launch file to its end and return how its nodes ended, which roslaunch itself does not.

``roslaunch`` exits with 0 even if nodes failed.  Here the first node that exits with an error is reported, the run is
stopped, and its code becomes the exit code; a required node that ends without an error ends the run with 0.
"""
from __future__ import annotations

import argparse
import math
import os
import signal
import socket
import sys
import threading
import time
from typing import Any, List, Optional, Sequence, Tuple

import roslaunch
import rospkg
from roslaunch.pmon import ProcessListener

_USAGE = "experiment [--port PORT] [--timeout SECONDS] PACKAGE FILE.launch [ARG:=VALUE ...]"
INTERRUPTED = 130           # exit code of a run that Ctrl-C has ended while it was being started
_STUCK = 5.0                # s of wall time after which a second signal aborts a start that hangs


class _Watch(ProcessListener):
    """Records the first process that ended with an error during the run."""

    def __init__(self) -> None:
        self.failed: Optional[Tuple[str, int]] = None
        self.dead = threading.Event()

    def process_died(self, process_name: str, exit_code: Optional[int]) -> None:
        """Called by roslaunch for each process that ends by itself."""
        if exit_code and self.failed is None:
            self.failed = (process_name, exit_code)
            self.dead.set()


class _Signals:
    """Only records signals, in the list ``noted``, until roslaunch has started all processes.

    roslaunch would shut down inside the signal handler. The interrupted thread may be starting a process; it would wait
    20 s for a lock that it holds, and leave processes behind. roslaunch installs its own handlers again in its loop and
    calls these after them. If the start hangs, the next signal aborts it.
    """

    def __init__(self) -> None:
        self.noted: List[int] = []
        self.starting = True
        self._first: Optional[float] = None
        roslaunch.pmon._init_signal_handlers()          # once; otherwise it would be done during the start
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._note)

    def _note(self, number: int, _: Any) -> None:
        self.noted.append(number)
        self._first = self._first or time.monotonic()
        if self.starting and time.monotonic() - self._first > _STUCK:
            self.starting = False           # once only: started processes are ended gracefully
            raise KeyboardInterrupt


def free_port() -> int:
    """Return a TCP port of the loopback interface that is free at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def resolve(package: str, name: str) -> str:
    """Return the path of a launch file.

    Parameters
    ----------
    package : str
        Name of a package, or path of a folder.
    name : str
        Of the file.

    Raises
    ------
    FileNotFoundError
        If there is no such file in the package.
    """
    try:
        folder = rospkg.RosPack().get_path(package)
    except rospkg.ResourceNotFound:
        raise FileNotFoundError("there is no package \"%s\" in this workspace; is its setup.bash sourced?"
                                % package) from None
    for candidate in (os.path.join(folder, "launch", name), os.path.join(folder, name)):
        if os.path.isfile(candidate):
            return candidate
    raise FileNotFoundError("package %s has no launch file \"%s\"; expected it in %s/launch" % (package, name, folder))


def run(path: str, arguments: Sequence[str], port: Optional[int] = None, timeout: Optional[float] = None) -> int:
    """Run a launch file until it ends, or a node fails, or Ctrl-C.

    Parameters
    ----------
    path : str
        The launch file.
    arguments : list of str
        ``name:=value``.
    port : int, optional
        Port of a master of the run's own; None uses the master of the environment, starting one if there is none.

    timeout : float, optional
        Wall seconds after which the run is ended and counts as failed.

    Returns
    -------
    int
        0, also when it is ended by Ctrl-C; or the exit code of the first node that failed; 1 after the time-out, 130
        after Ctrl-C while it was still being started.
    """
    if port is not None:
        os.environ["ROS_MASTER_URI"] = "http://127.0.0.1:%d" % port
        os.environ.setdefault("ROS_HOSTNAME", "127.0.0.1")
    uuid = roslaunch.rlutil.get_or_generate_uuid(None, False)
    roslaunch.configure_logging(uuid)
    watch = _Watch()
    parent = roslaunch.parent.ROSLaunchParent(uuid, [(path, list(arguments))], port=port, process_listeners=[watch],
                                              sigint_timeout=5, sigterm_timeout=2)
    ends = math.inf if timeout is None else time.monotonic() + timeout
    ended: Optional[int] = None
    signals = _Signals()
    try:
        parent.start()
        signals.starting = False
        while not (signals.noted or parent.pm.is_shutdown or watch.dead.is_set()):
            parent.spin_once()
            parent.pm.join(0.1)
            if not parent.pm.is_alive():
                break
            if timeout is not None and time.monotonic() > ends:
                sys.stderr.write("experiment: not finished after %g s of wall time; ending the run\n" % timeout)
                ended = 1
                break
        if signals.noted and not parent.pm.is_shutdown:
            ended = INTERRUPTED
    except KeyboardInterrupt:
        ended = INTERRUPTED
    except roslaunch.RLException:       # a node that failed to start may have received the signal too
        if not signals.noted:
            raise
        ended = INTERRUPTED
    finally:
        signals.starting = False
        parent.shutdown()
    if watch.failed is None:
        return ended or 0
    name, code = watch.failed
    sys.stderr.write("experiment: node %s ended with code %s, so the run ends with an error\n" % (name, code))
    return code if 0 < code < 128 else 1


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="experiment", usage=_USAGE, description=__doc__.split("\n")[0])
    parser.add_argument("--port", type=int,
                        help="port for a separate ROS master; default: the master of ROS_MASTER_URI")
    parser.add_argument("--timeout", type=float,
                        help="wall seconds after which the run counts as failed; default: none")
    parser.add_argument("package")
    parser.add_argument("launch_file")
    parser.add_argument("arguments", nargs="*", metavar="ARG:=VALUE")
    options = parser.parse_args(sys.argv[1:] if argv is None else argv)
    try:
        return run(resolve(options.package, options.launch_file), options.arguments, options.port,
                   options.timeout)
    except (FileNotFoundError, roslaunch.RLException) as error:
        sys.stderr.write("experiment: %s\n" % error)
        return 1
