# SPDX-License-Identifier: BSD-3-Clause
"""Xvfb and rviz as child processes: they end with this process in any case, and report why if they end earlier."""
from __future__ import annotations

import fcntl
import glob
import os
import re
import select
import shutil
import signal
import subprocess
import tempfile
import time
from typing import IO, TYPE_CHECKING, Dict, Optional, Sequence, Tuple

from m2wr_node.tie import tied
from m2wr_view.errors import ViewError
from m2wr_view.framebuffer import read_xwd

if TYPE_CHECKING:
    from PIL import Image

START_PATIENCE = 20.0       # s of wall time for Xvfb to come up
_STOP_PATIENCE = 2.0        # s of wall time to end on a signal
_LAST_LINES = 3             # of a process's output, for messages
_SAME_TRIES = 5             # reads of the screen until two agree: rviz may be drawing
_KILLED_BY = "signal %d"
_FOLDER = "m2wr_display_"   # prefix of the folders of displays
_IN_USE = "in_use"          # file in each, locked by its owner
_COLOUR = re.compile("\x1b\\[[0-9;]*m")


def find_program(name: str, package: str) -> str:
    """Return the path of a program.

    Parameters
    ----------
    name : str
        Of the program.
    package : str
        System package that has it.

    Raises
    ------
    ViewError
        If it is not installed.
    """
    found = shutil.which(name)
    if found is None:
        raise ViewError("there is no program %s; install it (apt install %s)" % (name, package))
    return found


class Child:
    """A process that does not receive our Ctrl-C and is ended when this process ends, even by SIGKILL.

    Parameters
    ----------
    words : list of str
        The command.
    log : str
        File for its output.
    environment : dict
    pass_fds : tuple of int
    """

    def __init__(self, words: Sequence[str], log: str, environment: Dict[str, str],
                 pass_fds: Tuple[int, ...] = ()) -> None:
        self._log = log
        with open(log, "wb") as stream:
            self._process = subprocess.Popen(
                tied(words), stdin=subprocess.DEVNULL, stdout=stream, stderr=stream, env=environment,
                start_new_session=True, pass_fds=pass_fds)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    def end(self) -> str:
        """Return how it ended, with the last lines of its output."""
        code = self._process.poll()
        how = _KILLED_BY % -code if code is not None and code < 0 else "code %s" % code
        try:
            with open(self._log, "r", errors="replace") as stream:
                said = _COLOUR.sub("", stream.read())
            lines = [line.strip() for line in said.splitlines() if line.strip()][-_LAST_LINES:]
        except OSError:
            lines = []
        return how + (": " + " / ".join(lines) if lines else "")

    def stop(self) -> None:
        """End it and wait for that."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):      # SIGTERM leaves rviz's name on the master
            if not self.alive():
                return
            self._process.send_signal(number)
            try:
                self._process.wait(_STOP_PATIENCE)
            except subprocess.TimeoutExpired:
                continue


def make_folder() -> Tuple[str, IO[str]]:
    """Make a folder of our own below that for temporary files, and delete those whose owners were killed.

    Returns
    -------
    str, file
        The folder, and a file that is to stay open as long as the folder is in use.
    """
    for path in glob.glob(os.path.join(tempfile.gettempdir(), _FOLDER + "*", _IN_USE)):
        try:
            with open(path) as stream:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(os.path.dirname(path), ignore_errors=True)
        except OSError:
            continue        # in use, or another user's
    folder = tempfile.mkdtemp(prefix=_FOLDER)
    lock = open(os.path.join(folder, "new"), "w")
    fcntl.flock(lock, fcntl.LOCK_EX)
    os.rename(lock.name, os.path.join(folder, _IN_USE))     # not to be seen before it is locked
    return folder, lock


class Xvfb:
    """A display without a screen, with a free display number.

    Parameters
    ----------
    size : (int, int)
        Width and height [pixels].

    Raises
    ------
    ViewError
        If Xvfb is missing or does not start.
    """

    def __init__(self, size: Tuple[int, int]) -> None:
        program = find_program("Xvfb", "xvfb")
        self._folder, self._lock = make_folder()
        reader, given = os.pipe()
        writer: Optional[int] = given       # None once it is closed
        try:
            # Xvfb itself looks for a free number; a number chosen here could be taken a moment later
            self._child = Child([program, "-displayfd", str(writer), "-screen", "0", "%dx%dx24" % size, "-nolisten",
                                 "tcp", "-nocursor", "-fbdir", self._folder], self.path("Xvfb.log"), dict(os.environ),
                                (given,))
            os.close(given)
            writer = None
            self.name = ":" + self._read_number(reader)
        except (OSError, ViewError) as error:
            if hasattr(self, "_child"):
                self._child.stop()
            self._remove()
            raise ViewError("Xvfb does not start: %s" % error) from error
        finally:
            os.close(reader)
            if writer is not None:
                os.close(writer)

    def _read_number(self, reader: int) -> str:
        """Return the number that Xvfb writes when it is ready to be used."""
        text, deadline = b"", time.monotonic() + START_PATIENCE
        while not text.endswith(b"\n"):
            if time.monotonic() > deadline:
                raise ViewError("it is not ready after %g s" % START_PATIENCE)
            if not select.select([reader], [], [], 0.1)[0]:
                continue
            piece = os.read(reader, 32)
            if not piece:
                self._child.stop()
                raise ViewError("it ended with %s" % self._child.end())
            text += piece
        return text.decode().strip()

    def path(self, name: str) -> str:
        """Return the path of a file in the display's own folder, which is removed with it."""
        return os.path.join(self._folder, name)

    def alive(self) -> bool:
        """Whether the display is running."""
        return self._child.alive()

    def end(self) -> str:
        """Return how Xvfb ended."""
        return self._child.end()

    def picture(self) -> Image.Image:
        """Return what is on the screen, as an RGB picture; ViewError if it cannot be read."""
        path, data = self.path("Xvfb_screen0"), b""
        try:
            for _ in range(_SAME_TRIES):
                with open(path, "rb") as stream:
                    before, data = data, stream.read()
                if data == before:
                    break
        except OSError as error:
            raise ViewError("screen of display %s: %s" % (self.name, error.strerror)) from error
        return read_xwd(data, "of display " + self.name)

    def stop(self) -> None:
        """End the display and remove its folder."""
        self._child.stop()
        self._remove()

    def _remove(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
        self._lock.close()


def start_rviz(display: Xvfb, config_text: str, node_name: str) -> Child:
    """Start rviz on a virtual display.

    Parameters
    ----------
    display : Xvfb
    config_text : str
        Configuration.
    node_name : str
        Name of its node, without namespace.

    Returns
    -------
    Child

    Raises
    ------
    ViewError
        If it is missing or cannot be started.
    """
    program, config = find_program("rviz", "rviz"), display.path("view.rviz")
    # software rendering: the pictures are the same on each machine
    environment = dict(os.environ, DISPLAY=display.name, LIBGL_ALWAYS_SOFTWARE="1", QT_QPA_PLATFORM="xcb")
    environment.pop("WAYLAND_DISPLAY", None)
    runtime = display.path("runtime")
    environment.setdefault("XDG_RUNTIME_DIR", runtime)
    try:
        os.makedirs(runtime, mode=0o700, exist_ok=True)
        with open(config, "w", encoding="utf-8") as stream:
            stream.write(config_text)
        # software rendering takes much CPU time, which must not delay the robot
        words = ["nice", "-n", "5", program, "-d", config, "--fullscreen", "__name:=" + node_name]
        return Child(words, display.path("rviz.log"), environment)
    except OSError as error:
        raise ViewError("rviz does not start: %s" % error) from error
