# SPDX-License-Identifier: BSD-3-Clause
"""rviz in a window, as a node that never ends a run: a missing display or a crash of rviz is reported."""
from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from typing import Callable, List, Mapping, Optional

from m2wr_node.ros.is_there import who_is_there
from m2wr_node.tie import tied

_PATIENCE = 10.0            # s for a display to answer; over a broken connection it never does
# in another process, because Xlib waits without a limit
_TRY_DISPLAY = "import ctypes, sys; sys.exit(0 if ctypes.CDLL('libX11.so.6').XOpenDisplay(None) else 3)"
_CURE = "the run continues without a window (virtual_display:=true saves pictures of rviz without a display)"


def say(text: str) -> None:
    """Print a line for the user."""
    sys.stderr.write("rviz: %s\n" % text)
    sys.stderr.flush()


def display_problem(environment: Mapping[str, str], run: Callable[..., int] = subprocess.call) -> Optional[str]:
    """Return why no window can be opened, or None.

    Parameters
    ----------
    environment : mapping
        Of the process.
    run : callable
        As subprocess.call.
    """
    name = environment.get("DISPLAY")
    if not name:
        return "there is no display (DISPLAY is not set)"
    try:
        code = run([sys.executable, "-c", _TRY_DISPLAY], env=dict(environment), timeout=_PATIENCE,
                   stderr=subprocess.DEVNULL)
    except subprocess.TimeoutExpired:
        return "display %s (DISPLAY) has not answered within %g s" % (name, _PATIENCE)
    # any other code: Xlib could not be loaded; rviz will report it
    return "display %s (DISPLAY) cannot be opened" % name if code == 3 else None


def chosen(words: List[str], look: Callable[[str], Optional[str]] = who_is_there) -> List[str]:
    """Return the options for rviz.

    Of ``--simulation A -d B`` these are ``-d A`` where something publishes /clock, otherwise ``-d B``.

    Parameters
    ----------
    words : list of str
        Options of this program.
    look : callable
        Returns the publisher of a topic, or None.
    """
    if words[:1] != ["--simulation"] or words[2:3] != ["-d"] or len(words) < 4:
        return words
    return ["-d", words[1] if look("/clock") else words[3]] + words[4:]


def main(words: Optional[List[str]] = None) -> int:
    """Entry point; returns 0 also if rviz fails."""
    words = sys.argv[1:] if words is None else words
    if "-h" in words or "--help" in words:
        sys.stdout.write("usage: rviz_window [--simulation CONFIG -d CONFIG] [OPTION OF RVIZ ...]\n\n%s\n" % __doc__)
        return 0
    problem = display_problem(os.environ)
    program = shutil.which("rviz")
    if problem is None and program is None:
        problem = "there is no program rviz (apt install rviz)"
    if problem is not None or program is None:
        say("%s; %s" % (problem, _CURE))
        return 0
    told: List[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):      # roslaunch signals the whole group, rviz too
        signal.signal(number, lambda received, _: told.append(received))
    child = subprocess.Popen(tied([program] + chosen(words)))
    signal_sent = False
    while True:
        try:
            code = child.wait(0.5 if not signal_sent else 5.0)
            break
        except subprocess.TimeoutExpired:
            if signal_sent:
                child.kill()
            elif told:
                child.send_signal(signal.SIGINT)        # after SIGTERM its name would stay on the master
                signal_sent = True
    if code and not told:
        say("ended with %s; the run continues. If the display's OpenGL is the cause: export LIBGL_ALWAYS_SOFTWARE=1"
            % ("signal %d" % -code if code < 0 else "code %d" % code))
    return 0
