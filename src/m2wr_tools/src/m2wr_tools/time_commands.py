# SPDX-License-Identifier: BSD-3-Clause
"""The commands pause, unpause, step and speed of a running simulation. Exit code 0 or 1; 2 for invalid options."""
from __future__ import annotations

import argparse
import math
import sys
from typing import Any, List, Optional, Union

from m2wr_sim.errors import SimError
from m2wr_tools.service_client import CallError, Connection, no_master, without_remappings

_MOST_STEPS = 1000000
_FASTEST = 1000.0           # greatest real-time factor, more than any machine reaches


class TimeError(SimError):
    """The simulation refuses; one sentence for the user."""


def _call(given: argparse.Namespace, name: str, kind: Any, *fields: Any) -> Any:
    try:
        return Connection("%s/%s" % (given.gazebo_namespace.rstrip("/"), name), kind)(*fields)
    except CallError as error:
        raise CallError("no simulation answers: %s" % error) from error


def pause(given: argparse.Namespace) -> None:
    """Pause the simulation; services still answer."""
    from std_srvs.srv import Empty
    _call(given, "pause_physics", Empty)
    print("paused; \"rosrun m2wr_sim step 1\" makes one step, \"rosrun m2wr_sim unpause\" continues")


def unpause(given: argparse.Namespace) -> None:
    """Continue the simulation."""
    from std_srvs.srv import Empty
    _call(given, "unpause_physics", Empty)
    print("running")


def step(given: argparse.Namespace) -> None:
    """Make an exact number of steps while paused; return when they are done."""
    from std_srvs.srv import Trigger
    service = Connection(given.gazebo_namespace.rstrip("/") + "/step", Trigger)
    for number in range(given.steps):
        answer = service()
        if not answer.success:
            raise TimeError("%s (%d of %d steps done)" % (answer.message, number, given.steps))
    print(answer.message)


def speed(given: argparse.Namespace) -> None:
    """Set the real-time factor, or print it if none is given."""
    from gazebo_msgs.srv import GetPhysicsProperties, SetPhysicsProperties
    now = _call(given, "get_physics_properties", GetPhysicsProperties)
    rate = now.max_update_rate
    if given.factor is not None:
        rate = given.factor / now.time_step
        answer = _call(given, "set_physics_properties", SetPhysicsProperties, now.time_step, rate, now.gravity,
                       now.ode_config)
        if not answer.success:
            raise TimeError(answer.status_message)
    print("%s, step %g s%s" % ("%.4g times real time" % (rate * now.time_step) if rate > 0.0 else
                               "as fast as the machine can", now.time_step, ", paused" if now.pause else ""))


COMMANDS = {"pause": (pause, "Pause a running simulation; services still answer."),
            "unpause": (unpause, "Continue a paused simulation."),
            "step": (step, "Make an exact number of physics steps in a paused simulation."),
            "speed": (speed, "Set or show the real-time factor of a running simulation.")}


def _factor(word: str) -> float:
    value = float(word)
    if not (math.isfinite(value) and 0.0 <= value <= _FASTEST):
        raise argparse.ArgumentTypeError("%s; expected 0 to %g" % (word, _FASTEST))
    return value


def _steps(word: str) -> int:
    value = int(word)
    if not 1 <= value <= _MOST_STEPS:
        raise argparse.ArgumentTypeError("%s; expected 1 to %d" % (word, _MOST_STEPS))
    return value


def make_parser(command: str) -> argparse.ArgumentParser:
    """Return the parser of one of ``COMMANDS``."""
    parser = argparse.ArgumentParser(prog=command, description=COMMANDS[command][1])
    parser.add_argument("--gazebo-namespace", default="/gazebo", metavar="NS",
                        help="where the services are (%(default)s)")
    if command == "step":
        parser.add_argument("steps", type=_steps, nargs="?", default=1, help="how many (%(default)s)")
    if command == "speed":
        parser.add_argument("factor", type=_factor, nargs="?",
                            help="simulated seconds per second; 0: as fast as the machine can; without: show it")
    return parser


def main(command: str, argv: Optional[List[str]] = None) -> int:
    """Run a command.

    Parameters
    ----------
    command : str
        One of ``COMMANDS``.
    argv : list of str, optional
        Command line, the program's name first; default: that of this process.

    Returns
    -------
    int
        The exit code.
    """
    given = make_parser(command).parse_args(without_remappings(sys.argv if argv is None else argv)[1:])
    problem: Union[str, SimError, None] = no_master()
    try:
        if problem is None:
            COMMANDS[command][0](given)
    except SimError as error:
        problem = error
    if problem is not None:
        sys.stderr.write("%s: %s\n" % (command, problem))
    return 0 if problem is None else 1
