# SPDX-License-Identifier: BSD-3-Clause
"""Recordings that pages start, stop and download: rosbag's recorder, and a film of its bag."""
from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import List, Optional

import roslib.packages

from m2wr_tools.runs.record_run import NOT_OF_ALL, RecordError, find_recorder
from m2wr_view.errors import ViewError

LONGEST = 600.0             # s of wall time after which a recording is ended
LARGEST = 200 << 20         # bytes of a bag after which it is ended; a page must hold it in memory
_CLOSING = 15.0             # s for the recorder to write its index
_STARTING = 10.0            # s for it to open the file
_FILMING = 180.0            # s for drawing a film
_MOST_PICTURES = 400        # of a film


def draw_film(bag: str, path: str) -> None:
    """Draw a film of a bag, seen from above.

    Parameters
    ----------
    bag : str
        Its path.
    path : str
        Of the film, which ends in ``.gif``.

    Raises
    ------
    ViewError
        If it cannot be drawn.
    """
    program: List[str] = roslib.packages.find_node("m2wr_view", "image_dump")
    if not program:
        raise ViewError("there is no command \"image_dump\" in m2wr_view; make build makes it")
    try:
        done = subprocess.run(
            ["nice", sys.executable, program[0], "--bag", bag, "--out", path, "--max-pictures", str(_MOST_PICTURES)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=_FILMING, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ViewError("the film cannot be drawn: %s" % error) from error
    if done.returncode or not os.path.exists(path):
        last = done.stdout.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no message"]
        raise ViewError("the film cannot be drawn: %s" % last[0][:200])


class Recorder:
    """One recording at a time, in a folder of its own that :meth:`close` deletes."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._folder: Optional[str] = None
        self._process: Optional[subprocess.Popen[bytes]] = None
        self._began = 0.0

    @property
    def _bag(self) -> str:
        return os.path.join(self._folder or "", "run.bag")

    def seconds(self) -> Optional[float]:
        """Return for how long it has been recording [s of wall time], or None if it is not."""
        return time.monotonic() - self._began if self._process is not None else None

    def start(self) -> None:
        """Begin a new recording; the one before is dropped.

        Raises
        ------
        ViewError
            If it is recording already, or the recorder does not start.
        """
        with self._lock:
            if self._process is not None:
                raise ViewError("a recording runs already; stop it first")
            self._folder = self._folder or tempfile.mkdtemp(prefix="m2wr_live_")
            for name in os.listdir(self._folder):
                os.remove(os.path.join(self._folder, name))
            self._began = time.monotonic()          # before there is a process: watch() may look at any time
            try:
                recorder = find_recorder()
                self._process = subprocess.Popen(
                    [recorder, "-a", "-x", NOT_OF_ALL, "--buffsize=64", "-O", self._bag], stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
            except (RecordError, OSError) as error:
                raise ViewError("the recording cannot begin: %s" % error) from error
            while not os.path.exists(self._bag + ".active"):
                if self._process.poll() is not None or time.monotonic() - self._began > _STARTING:
                    self._end()
                    raise ViewError("the recording cannot begin: rosbag's recorder has ended or makes no file in %s"
                                    % self._folder)
                time.sleep(0.05)

    def stop(self) -> None:
        """End the recording and keep its bag.

        Raises
        ------
        ViewError
            If it is not recording, or there is no bag.
        """
        with self._lock:
            if self._process is None:
                raise ViewError("no recording runs; press \"record\" first")
            self._end()
            if not os.path.exists(self._bag):
                raise ViewError("the recording has no bag: the recorder ended early")

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for number in (signal.SIGINT, signal.SIGKILL):
            if process.poll() is None:
                process.send_signal(number)
                try:
                    process.wait(_CLOSING)
                except subprocess.TimeoutExpired:
                    continue

    def watch(self) -> None:
        """End a recording that is too long or too large; called now and then."""
        process = self._process
        if process is None:
            return
        try:
            size = os.path.getsize(self._bag + ".active")
        except OSError:                     # it is not made yet, or has its last name already
            size = 0
        if process.poll() is not None or (self.seconds() or 0.0) > LONGEST or size > LARGEST:
            with self._lock:
                if self._process is process:        # and not the next recording
                    self._end()

    def bag(self) -> bytes:
        """Return the newest bag.

        Raises
        ------
        ViewError
            If there is none.
        """
        with self._lock:
            return self._read(self._bag)

    def film(self) -> bytes:
        """Return a film of the newest bag, a GIF; drawn at the first call.

        Raises
        ------
        ViewError
            If there is no bag, or it cannot be drawn.
        """
        with self._lock:
            self._read(self._bag)
            path = os.path.join(self._folder or "", "run.gif")
            if not os.path.exists(path):
                draw_film(self._bag, path)
            return self._read(path)

    def _read(self, path: str) -> bytes:
        if self._process is not None or not os.path.exists(path):
            raise ViewError("there is no finished recording; press \"record\", then \"stop\"")
        with open(path, "rb") as stream:
            return stream.read()

    def close(self) -> None:
        """End the recording and delete the files."""
        with self._lock:
            self._end()
            if self._folder is not None:
                shutil.rmtree(self._folder, ignore_errors=True)
                self._folder = None
