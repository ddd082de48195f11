# SPDX-License-Identifier: BSD-3-Clause
"""gzclient: rviz in place of Gazebo's window."""
from __future__ import annotations

import os
import shutil
import signal
import socket
import sys
import time
from typing import Any, Callable, List, Optional, Sequence, Tuple

import rosgraph
import rospkg

from gazebo_ros.view import make_view

_WAIT_FOR_ROBOT = 15.0      # s of wall time; robots are spawned right after the world, and rviz is configured once
_WAIT_FOR_REST = 1.0        # s between a robot's first topic and the list of all its topics
_LOOK_EVERY = 0.25          # s
_RVIZ_PLACES = ('/usr/bin/rviz', '/opt/ros/noetic/bin/rviz')
_ROBOT_TYPES = ('sensor_msgs/LaserScan', 'nav_msgs/Odometry')


def say(text: str) -> None:
    """Print a line for the user."""
    sys.stderr.write('gzclient: %s\n' % text)
    sys.stderr.flush()


def published(master: Any) -> List[Tuple[str, str]]:
    """Return (topic, type) of the published topics; none while there is no master (rosgraph.Master)."""
    try:
        return [(topic, kind) for topic, kind in master.getPublishedTopics('')]
    except (rosgraph.MasterException, OSError):
        return []


def descriptions(master: Any) -> List[str]:
    """Return the names of the parameters that hold a robot description."""
    try:
        return [name for name in master.getParamNames() if name.endswith('/robot_description')]
    except (rosgraph.MasterException, OSError):
        return []


def wait_for_robot(master: Any, patience: float = _WAIT_FOR_ROBOT, clock: Callable[[], float] = time.monotonic,
                   sleep: Callable[[float], object] = time.sleep) -> List[Tuple[str, str]]:
    """Wait for a robot's topics.

    Parameters
    ----------
    master : rosgraph.Master
    patience : float
        Longest wall time to wait [s].
    clock, sleep : callable
        Wall time [s], and waiting in it.

    Returns
    -------
    list of (str, str)
        All published topics and their types.
    """
    deadline = clock() + patience
    while clock() < deadline:
        if any(kind in _ROBOT_TYPES for _, kind in published(master)):
            sleep(_WAIT_FOR_REST)
            break
        sleep(_LOOK_EVERY)
    return published(master)


def take_options(words: Sequence[str]) -> Tuple[List[str], bool, Optional[str]]:
    """Split the words into those for rviz (remappings) and the two options of our own.

    Returns
    -------
    remaps : list of str
    stay : bool
        Whether to wait for the end if no window can be opened.
    frame : str or None
        Fixed frame.
    """
    remaps: List[str] = []
    ignored: List[str] = []
    stay, frame = False, None
    for word in words:
        if ':=' in word:
            remaps.append(word)
        elif word == '--stay':
            stay = True
        elif word.startswith('--frame='):
            frame = word.split('=', 1)[1] or None
        elif word not in ('', '--verbose'):
            ignored.append(word)
    if ignored:
        say('no effect here: %s' % ' '.join(ignored))
    return remaps, stay, frame


def no_window(why: str, stay: bool) -> int:
    """Print why there is no window.

    Parameters
    ----------
    why : str
    stay : bool
        Wait for a signal, because a required node must not end.

    Returns
    -------
    int
        Exit code, 0.
    """
    ends = {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, ends)      # for sigwait to get them
    say('%s; the simulation runs without a window%s' % (why, ', waiting for the end' if stay else ''))
    if stay:
        signal.sigwait(ends)
    return 0


def main(words: Optional[Sequence[str]] = None) -> int:
    """Entry point; becomes rviz, or returns the exit code."""
    words = sys.argv[1:] if words is None else words
    if '-h' in words or '--help' in words:
        sys.stdout.write('usage: gzclient [--frame=FIXED_FRAME] [--stay] [name:=value ...]\n\nOpens rviz with a view '
                         'of the running simulation. Without a display it prints a message and ends '
                         'with 0,\nor waits (--stay).\n')
        return 0
    remaps, stay, frame = take_options(words)
    if not (os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')):
        return no_window('there is no display (DISPLAY is not set)', stay)
    rviz = shutil.which('rviz') or next((path for path in _RVIZ_PLACES if os.access(path, os.X_OK)), None)
    if rviz is None:
        return no_window('rviz is not installed', stay)
    socket.setdefaulttimeout(5.0)
    try:
        master = rosgraph.Master('/gzclient_start')
        text = make_view(wait_for_robot(master), descriptions(master), frame)
    except KeyboardInterrupt:
        return 0
    os.makedirs(rospkg.get_ros_home(), exist_ok=True)
    path = os.path.join(rospkg.get_ros_home(), 'gzclient.rviz')
    with open(path, 'w', encoding='utf-8') as stream:
        stream.write(text)
    if not any(word.startswith('__name:=') for word in remaps):
        remaps.append('__name:=gazebo_gui')
    os.execv(rviz, [rviz, '-d', path] + remaps)
