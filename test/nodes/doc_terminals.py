# SPDX-License-Identifier: BSD-3-Clause
"""Runs the blocks of a document as a reader would: one terminal for each, in one folder, with one ROS master."""
import contextlib
import glob
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time

import rosgraph

from doc_blocks import LIMIT
from sim_probe import end_marked, marked, marked_environment, wait_until

ENDING = 30.0       # s that a program may take to end after Ctrl-C
FIRST_LINES = "set -eo pipefail\n"


def stacks(mark):
    """End the programs with a mark by SIGQUIT, at which ours print their stacks; returns their command lines."""
    asked = []
    for pid, command in sorted(marked(mark).items()):
        try:
            with open("/proc/%d/status" % pid, encoding="utf-8") as stream:
                caught = int(re.search(r"SigCgt:\s*(\w+)", stream.read()).group(1), 16)
            if caught & 1 << signal.SIGQUIT - 1:
                os.kill(pid, signal.SIGQUIT)
                asked.append(command[:120])
        except OSError:         # ended meanwhile
            continue
    with contextlib.suppress(AssertionError):
        wait_until(lambda: not set(asked) & {command[:120] for command in marked(mark).values()}, "their ends", ENDING)
    return "; these were ended for their stacks: " + ("; ".join(asked) or "none")


class Terminal:
    """One running block; its output is kept.

    Parameters
    ----------
    block : Block
    folder : str
        Where it runs.
    environment : dict
        Of the shell.
    """

    def __init__(self, block, folder, environment):
        self.block, self.text, self.started = block, "", time.monotonic()
        self._uri = environment["ROS_MASTER_URI"]
        self._environment, self._folder = environment, folder
        environment, self._mark = marked_environment(environment)
        language = ["/usr/bin/python3", "-c", block.text] if block.language == "python" else [
            "bash", "-c", FIRST_LINES + block.text]
        self._keyboard = None
        stdin = subprocess.DEVNULL
        if block.how is not None and block.how.keys:
            self._keyboard, stdin = pty.openpty()
        self.process = subprocess.Popen(language, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        cwd=folder, env=environment, start_new_session=True)
        if self._keyboard is not None:
            os.close(stdin)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.text += line.decode(errors="replace")

    def _fail(self, problem):
        if self.process.poll() is None:
            problem = "%s%s" % (problem, stacks(self._mark))
        raise AssertionError("%s: %s\n%s\noutput:\n%s" % (self.block.place, problem, self.block.text, self.text))

    def wait_for(self, what):
        """Wait for a text in the output, a message on ``/NAME``, ``service /NAME``, or ``file GLOB``."""
        try:
            if what.startswith("/"):
                self._wait_for_message(what)
            elif what.startswith("service /"):
                self._wait_for_service(what.split()[1])
                return
            elif what.startswith("file "):
                wait_until(lambda: glob.glob(os.path.join(self._folder, what[5:])) or self.process.poll() is not None,
                           "a " + what, self.block.how.limit)
                return
            else:
                wait_until(lambda: what in self.text or self.process.poll() is not None, '"%s"' % what,
                           self.block.how.limit)
                if self.process.poll() is not None:
                    self._reader.join(ENDING)
        except AssertionError as error:
            self._fail(error)
        if not what.startswith("/") and what not in self.text:
            self._fail('ended with code %s before "%s"' % (self.process.returncode, what))

    def _wait_for_message(self, topic):
        wait_until(lambda: rosgraph.is_master_online(self._uri) or self.process.poll() is not None, "a master",
                   self.block.how.limit)
        echo = subprocess.Popen(["rostopic", "echo", "-n", "1", "--noarr", topic], env=self._environment,
                                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_until(lambda: echo.poll() is not None or self.process.poll() is not None, "a message on " + topic,
                       self.block.how.limit)
            if echo.poll() != 0:
                self._fail("ended before there was a message on " + topic)
        finally:
            if echo.poll() is None:
                echo.kill()
            echo.wait()

    def _wait_for_service(self, name):
        def there():
            if self.process.poll() is not None:
                self._fail("ended before there was a service " + name)
            try:
                return rosgraph.Master("/documents", self._uri).lookupService(name)
            except (rosgraph.MasterException, OSError):     # not registered yet; no master yet
                return None

        wait_until(there, "a service " + name, self.block.how.limit)

    def type(self, keys):
        """Type some keys, with a pause between two."""
        for key in keys:
            os.write(self._keyboard, key.encode())
            time.sleep(0.2)

    def interrupt(self):
        """Press Ctrl-C, again if it has no effect, and wait for the end.

        A shell continues if its command ends by itself just when the key is pressed.
        """
        for _ in range(2):
            if self.process.poll() is None:
                try:
                    os.killpg(self.process.pid, signal.SIGINT)
                    self.process.wait(ENDING)
                except ProcessLookupError:          # ended just now
                    self.process.wait()
                except subprocess.TimeoutExpired:
                    continue
        if self.process.poll() is None:
            self._fail("did not end within %g s after Ctrl-C" % (2 * ENDING))
        self._reader.join(ENDING)

    def finish(self):
        """Wait for the end and check the exit code."""
        how = self.block.how
        limit, code = (how.limit, how.code) if how else (LIMIT, 0)
        try:
            self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self._fail("did not end within %g s" % limit)
        self._reader.join(ENDING)
        if self.process.returncode != code:
            self._fail("ended with code %d, expected %d" % (self.process.returncode, code))

    def check_output(self):
        """Fail if the output lacks an expected text."""
        for words in self.block.how.expect if self.block.how else ():
            if words not in self.text:
                self._fail('"%s" was expected' % words)

    def close(self):
        """End all processes started here, by SIGKILL if needed."""
        end_marked(self._mark)
        self.process.wait()
        self._reader.join(ENDING)
        if self._keyboard is not None:
            os.close(self._keyboard)


def end_all(running):
    """Press Ctrl-C in every terminal of a list, the newest first, and empty it."""
    while running:
        running[-1].interrupt()
        running.pop().close()


def run_block(block, folder, environment, running):
    """Run one block; ``running`` is the list of terminals in the background, which it changes."""
    how = block.how
    if how is not None and how.alone:
        end_all(running)
    terminal = Terminal(block, folder, environment)
    try:
        if how is not None and how.until:
            terminal.wait_for(how.until)
            if how.keys:
                terminal.type(how.keys)
        if how is not None and how.background:
            terminal.check_output()
            running.append(terminal)
            return
        if how is not None and how.until and not how.keys:
            terminal.interrupt()
        else:
            terminal.finish()
        terminal.check_output()
    finally:
        if terminal not in running:
            terminal.close()


def pictures_of(block, folder):
    """Return {name in docs/images: path} of the pictures of a block; AssertionError if one is missing."""
    found = {}
    for pattern, name in block.how.pictures if block.how else ():
        paths = glob.glob(os.path.join(folder, pattern))
        if not paths:
            raise AssertionError("%s: made no %s" % (block.place, pattern))
        found[name] = max(paths, key=lambda path: (os.stat(path).st_mtime_ns, path))
    return found


def run_document(blocks, folder, environment, keep=None):
    """Run all blocks of a document that tests run, in order.

    Parameters
    ----------
    blocks : list of Block
    folder : str
        An empty one; the commands write into it.
    environment : dict
        Of the shells.
    keep : callable, optional
        Called with the name and the path of each picture.  With it the blocks for the gallery are run too, and those
        after the last picture are not.

    Returns
    -------
    list of (str, float)
        File and line of each block, and the wall time it took [s].

    Raises
    ------
    AssertionError
        With the place of the block, what was expected, and its output.
    """
    running, times = [], []
    if keep is not None:
        last = max([number for number, block in enumerate(blocks) if block.how and block.how.pictures], default=-1)
        blocks = blocks[:last + 1]
    try:
        for block in blocks:
            if block.how is not None and block.how.file:
                with open(os.path.join(folder, block.how.file), "w", encoding="utf-8") as stream:
                    stream.write(block.text)
            if not block.runs and not (keep is not None and block.how is not None and block.how.gallery):
                continue
            started = time.monotonic()
            run_block(block, folder, environment, running)
            for name, path in sorted(pictures_of(block, folder).items()):
                if keep is not None:
                    keep(name, path)
            times.append((block.place, time.monotonic() - started))
            sys.stderr.write("%6.1f s  %s\n" % (times[-1][1], block.place))
        end_all(running)
    finally:
        for terminal in running:
            terminal.close()
    return times
