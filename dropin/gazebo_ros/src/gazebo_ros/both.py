# SPDX-License-Identifier: BSD-3-Clause
"""gazebo: server and window together, as one command."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from typing import List, Optional, Sequence

from gazebo_ros.command_line import UsageError, parse

_PATIENCE = 10.0        # s for a program to end after SIGINT


def program(name: str) -> str:
    """Return the path of another command of this package."""
    return os.path.join(os.path.dirname(os.path.realpath(sys.argv[0])), name)


def main(words: Optional[Sequence[str]] = None) -> int:
    """Entry point; returns the server's exit code.  Closing the window ends the server, as in Gazebo."""
    words = sys.argv[1:] if words is None else list(words)
    try:
        command = parse(words)
        if command.wants:
            return subprocess.call([program('gzserver')] + words)
    except UsageError:
        return subprocess.call([program('gzserver')] + words)       # prints the error
    asked: List[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _: asked.append(received))
    server = subprocess.Popen([program('gzserver')] + words, start_new_session=True)
    remaps = [word for word in command.remaps if not word.startswith('_')]
    client = subprocess.Popen([program('gzclient')] + remaps, start_new_session=True)
    has_window = bool(os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY'))
    while not asked and server.poll() is None and not (has_window and client.poll() is not None):
        time.sleep(0.1)
    return end(server, client)


def end(server: subprocess.Popen[bytes], client: subprocess.Popen[bytes]) -> int:
    """End both programs, by SIGKILL if needed.

    Parameters
    ----------
    server, client : subprocess.Popen

    Returns
    -------
    int
        Exit code of the server; 128 + the number of the signal that ended it.
    """
    for process in (client, server):
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in (client, server):
        try:
            process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    return server.returncode if server.returncode >= 0 else 128 - server.returncode
