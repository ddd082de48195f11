# SPDX-License-Identifier: BSD-3-Clause
"""gzserver, debug and perf: the simulation node of m2wr_sim with Gazebo's command line."""
from __future__ import annotations

import cProfile
import faulthandler
import os
import pstats
import signal
import sys
import tempfile
from typing import List, Optional, Sequence

from gazebo_ros.command_line import ServerCommand, UsageError, parse, usage
from gazebo_ros.stacks import show_stacks_on
from gazebo_ros.worlds import find

_VERSION = 'gzserver of m2wr_sim, in place of Gazebo classic 11 (gazebo_ros 2.9.2)\n'
_PROFILE_ROWS = 30


def say(text: str, program: str = 'gzserver') -> None:
    """Print a line for the user, before ROS is initialised.

    Parameters
    ----------
    text : str
    program : str
        Name of the program, printed before the text.
    """
    sys.stderr.write('%s: %s\n' % (program, text))
    sys.stderr.flush()


def node_arguments(command: ServerCommand, world: str) -> List[str]:
    """Return the words for the simulation node.

    Parameters
    ----------
    command : gazebo_ros.command_line.ServerCommand
    world : str
        Path or name of the world file.

    Returns
    -------
    list of str
        Private parameters as ``_name:=value``; the user's arguments are last, because ROS keeps the last.
    """
    words = ['_world:=' + world, '_paused:=' + ('true' if command.paused else 'false'),
             '_fallback_world:=empty.world']
    if command.seed is not None:
        words.append('_seed:=%d' % command.seed)
    return words + command.remaps


def resolve_world(name: str) -> str:
    """Return the path of the world; if it does not exist, print a message and return the empty one, as Gazebo does."""
    path, searched = find(name)
    if path is None:
        say('Could not open file[%s]: there is no such world; the empty world is used in its place. Searched: %s'
            % (name, ', '.join(searched)))
        path, searched = find('worlds/empty.world', environment={}, folders=('/',))
    return path or 'empty.world'


def prepare(words: Sequence[str]) -> Optional[int]:
    """Turn a command line into that of the simulation node and put it into ``sys.argv``.

    Returns
    -------
    int or None
        Exit code if the program ends here.
    """
    try:
        command = parse(words)
    except UsageError as error:
        say(str(error))
        sys.stderr.write(usage())
        return 255              # Gazebo's exit code for a wrong command line
    if command.wants:
        sys.stdout.write(usage() if command.wants == 'help' else _VERSION)
        return 0
    for note in command.notes:
        say(note)
    sys.argv = [sys.argv[0]] + node_arguments(command, resolve_world(command.world or 'worlds/empty.world'))
    return None


def run_node() -> int:
    """Run the simulation; returns its exit code.  rospy reads ``sys.argv`` when it is imported, so that comes last."""
    from m2wr_sim.ros.node import main
    return main()


def gzserver_main(words: Optional[Sequence[str]] = None) -> int:
    """Entry point of ``gzserver``; returns the exit code."""
    code = prepare(sys.argv[1:] if words is None else words)
    return run_node() if code is None else code


def debug_main(words: Optional[Sequence[str]] = None) -> int:
    """Entry point of ``debug``: no debugger, but a crash or SIGUSR1 prints the stack of every thread."""
    faulthandler.enable()
    show_stacks_on(signal.SIGUSR1)
    say('a crash prints the stack of every thread, and so does `kill -USR1 %d`; to attach a debugger: gdb -p %d'
        % (os.getpid(), os.getpid()), 'debug')
    return gzserver_main(words)


def perf_main(words: Optional[Sequence[str]] = None) -> int:
    """Entry point of ``perf``: profiles the simulation's own thread and prints its most expensive functions."""
    code = prepare(sys.argv[1:] if words is None else words)
    if code is not None:
        return code
    profile = cProfile.Profile()
    try:
        return profile.runcall(run_node)
    finally:
        handle, path = tempfile.mkstemp(prefix='gazebo_perf_', suffix='.prof')
        os.close(handle)
        profile.dump_stats(path)
        pstats.Stats(profile, stream=sys.stdout).sort_stats('tottime').print_stats(_PROFILE_ROWS)
        say('the whole profile is in %s; read it with: python3 -m pstats %s' % (path, path), 'perf')
