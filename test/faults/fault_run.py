# SPDX-License-Identifier: BSD-3-Clause
"""A launch file in a folder, with a home and a master of its own; faults in it, and checks of what remains."""
import fnmatch
import glob
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import rosbag
import rosgraph
import yaml
from PIL import Image

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "nodes"))
from check_launch_errors import free_port  # noqa: E402
from sim_probe import Running, marked, wait_until  # noqa: E402
from tracebacks import foreign_tracebacks, interrupts_lost  # noqa: E402

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:       # as a shell does for background jobs; it is inherited
    signal.signal(signal.SIGINT, signal.default_int_handler)

PATIENCE = 300.0        # s of wall time for any event; far above what is needed, because test machines are slow
PASSED_OVER = 30.0      # s of wall time in which roslaunch begins to end its nodes
LOST = 5.0              # s after which an interrupt is repeated, if roslaunch lost it according to its source
ENDING = "killing on exit"
LAST_PATIENCE = 200.0   # s until the end; less than the limit of pytest, whose message lacks the output
SITE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "site")     # for every Python program of the run
NEVER = ("core dumped", "Segmentation", "Aborted")
# roslaunch exits with 1 if it is interrupted while it starts a node and has others to start: it waits 20 s for the
# node that it is starting, and then refuses the next one (``pmon.py``)
_TOO_LATE = "after process monitor has been shut down"
_STARTING = "Fatal Python error: init_"     # Python is interrupted before it runs a program
TEMPORARY = (".whole-*", "*.part", "*.active", "*.orig.active")


class FaultRun:
    """A running launch file; a context manager that ends all remaining processes.

    Parameters
    ----------
    words : list of str
        Of roslaunch.
    environment : dict
        Variables to set; None removes one.
    prefix : list of str
        Command in front of roslaunch; ``{folder}`` and ``{home}`` in it are filled in.
    """

    def __init__(self, words, environment=None, prefix=()):
        self.top = tempfile.mkdtemp(prefix="fault_")
        self.folder, self.home, self._said = (os.path.join(self.top, name) for name in ("run", "home", "said"))
        for folder in (self.folder, self.home, self._said):
            os.mkdir(folder)
        port = free_port()
        self._uri = "http://127.0.0.1:%d" % port
        self._master = Running([shutil.which("rosmaster"), "--core", "-p", str(port)],
                               {"ROS_LOG_DIR": os.path.join(self.top, "log")})
        self.master = rosgraph.Master("/fault_run", self._uri)
        wait_until(self.master_answers, "the master")
        self._words, self._prefix = list(words), [
            word.format(folder=self.folder, home=self.home) for word in prefix]
        self._changes = dict({"ROS_MASTER_URI": self._uri, "ROS_IP": "127.0.0.1", "HOME": self.home, "DISPLAY": "",
                              "ROS_HOME": None, "ROS_LOG_DIR": None, "ROS_HOSTNAME": None,
                              "M2WR_FAULT_STDERR": self._said,
                              "PYTHONPATH": os.pathsep.join([SITE, os.environ.get("PYTHONPATH", "")])},
                             **(environment or {}))
        self._runs = []
        self.begin()

    def begin(self, words=None):
        """Start roslaunch, possibly a second one; returns it (Running)."""
        unset = [word for name, value in self._changes.items() if value is None for word in ("-u", name)]
        given = {name: value for name, value in self._changes.items() if value is not None}
        command = [shutil.which("env"), "-C", self.folder] + unset + self._prefix + [
            shutil.which("roslaunch")] + (words or self._words)
        self._runs.append(Running(command, given))
        return self._runs[-1]

    def master_answers(self):
        """Whether the master answers."""
        try:
            return self.master.getPid() > 0
        except (OSError, rosgraph.MasterException):
            return False

    @property
    def run(self):
        """The roslaunch that was started last."""
        return self._runs[-1]

    @property
    def text(self):
        """The output of the launch files until now, followed by the stderr of each program with its name."""
        return "".join([run.text for run in self._runs] + ["\n" + text for text in self.errors()])

    def errors(self):
        """Return the stderr of each Python program, with its command line in the first line (list of str)."""
        texts = []
        for name in sorted(os.listdir(self._said), key=int):
            with open(os.path.join(self._said, name), encoding="utf-8", errors="replace") as stream:
                texts.append(stream.read())
        return texts

    def wait_for(self, words, patience=PATIENCE):
        """Wait until the run has printed ``words``; AssertionError if it ends earlier."""
        wait_until(lambda: words in self.text or self.run.process.poll() is not None, "%r in\n%s" % (
            words, Later(lambda: self.text)), patience)
        if words not in self.text:
            self.run.wait()
        assert words in self.text, "ended without printing %r:\n%s" % (words, self.text)

    def process(self, part):
        """Return the id of the process of the run with ``part`` in its command line; waits for it.

        Of several, because of launch prefixes, the newest.
        """
        return wait_until(lambda: max((pid for pid, command in marked(self.run.mark).items()
                                       if part in command and "roslaunch" not in command), default=None),
                          "a process with %r" % part, PATIENCE)

    def signal(self, part, number):
        """Send a signal to the process with ``part`` in its command line."""
        os.kill(self.process(part), number)

    def kill_master(self):
        """Kill the master."""
        self._master.process.kill()
        self._master.process.wait()

    def kill_roslaunch(self):
        """Kill roslaunch, then end each of its nodes."""
        self.run.process.kill()
        self.run.process.wait()
        for pid in marked(self.run.mark):
            os.kill(pid, signal.SIGINT)

    def call(self, service):
        """Call a service without arguments."""
        done = subprocess.run([shutil.which("rosservice"), "call", service, "{}"], stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                              env=dict(os.environ, ROS_MASTER_URI=self._uri), timeout=PATIENCE)
        assert done.returncode == 0, done.stdout

    def file(self, name):
        """Return the path of a file of the run."""
        return os.path.join(self.folder, name)

    def wait_for_more(self, words, run):
        """Wait until ``run`` prints ``words`` twice more; the first may have been in transit."""
        count = run.text.count(words)
        wait_until(lambda: run.text.count(words) >= count + 2 or run.process.poll() is not None,
                   Later(lambda: "more of %r in\n%s" % (words, self.text)), PATIENCE)
        assert run.process.poll() is None, self.text

    def end(self, run, by_itself=False):
        """Interrupt ``run``, or wait until it has ended by itself; returns the exit code.

        If it has not begun to end its nodes after a while, it is interrupted again, as by a user.  This is allowed only
        where roslaunch itself has lost the interrupt.
        """
        sent = 0

        def ended():
            return run.process.poll() is not None or ENDING in run.text

        while not (by_itself or ended()):
            run.process.send_signal(signal.SIGINT)
            sent, again = sent + 1, time.monotonic() + LOST
            try:
                wait_until(lambda: ended() or time.monotonic() > again and self.interrupts_lost() >= sent, "",
                           PASSED_OVER)
            except AssertionError:
                raise AssertionError("still running after %d interrupts, the last at %.3f s:\n%s" % (
                    sent, again - LOST, self.text)) from None
        return run.wait(LAST_PATIENCE)

    def interrupts_lost(self):
        """Return how many interrupts roslaunch has lost; after one in an import it may end with an error of its own."""
        return sum(interrupts_lost(text) for text in self.errors() if _program(text).endswith("/roslaunch"))

    # ---- results

    def check_gone(self, names=()):
        """No process runs any more, and no node is registered except ``names``, which were killed."""
        for run in self._runs:
            wait_until(lambda run=run: not marked(run.mark), Later(lambda run=run: "the end of %s\n%s" % (
                marked(run.mark), self.text)), 30.0)
        if self.master_answers():
            wait_until(lambda: not self.names() - set(names), Later(
                lambda: "%s to leave the master\n%s" % (self.names(), self.text)), 10.0)

    def names(self):
        """Return the names of all nodes on the master."""
        return {node for part in self.master.getSystemState() for _, nodes in part for node in nodes}

    def check_said(self, words):
        """All the words were printed, and none of NEVER."""
        for word in words:
            assert word in self.text, "%r is not in\n%s" % (word, self.text)
        for word in NEVER:
            assert word not in self.text, self.text
        found = foreign_tracebacks("".join(run.text for run in self._runs))
        for text in self.errors():
            found += foreign_tracebacks(text, _program(text))
        assert not found, "\n".join(found + ["in", self.text])

    def check_tidy(self, allowed=()):
        """No temporary file remains except the allowed ones."""
        left = {name for name in os.listdir(self.folder)
                if any(fnmatch.fnmatchcase(name, pattern) for pattern in TEMPORARY)}
        assert left <= set(allowed), "%s left; %s" % (left, self.text)

    def check_bag(self, name="run.bag"):
        """The bag can be read to its end; returns the number of messages."""
        with rosbag.Bag(self.file(name)) as bag:
            read = sum(1 for _ in bag.read_messages(raw=True))
        assert read > 0, self.text
        return read

    def check_map(self, name="plan"):
        """The map consists of both files."""
        with open(self.file(name + ".yaml"), encoding="utf-8") as stream:
            described = yaml.safe_load(stream)
        with Image.open(os.path.join(self.folder, described["image"])) as opened:
            assert min(opened.size) > 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for run in self._runs + [self._master]:
            run.__exit__()
        shutil.rmtree(self.top, ignore_errors=True)


def _program(text):
    """Return the program that has written a text of stderr: the first word of its command line except options."""
    words = text.partition("\n")[0].split()[1:]
    return next((word for word in words if not word.startswith("-")), "")


class Later:
    """A text that is made on demand."""

    def __init__(self, make):
        self._make = make

    def __str__(self):
        return self._make()


def interrupt_at(words, delay, environment=None):
    """Start a launch file, interrupt it after ``delay`` seconds [wall], check what remains; return its output."""
    with FaultRun(words, environment) as run:
        time.sleep(delay)               # the delay is the random quantity; no event to wait for
        recording, mapping = os.path.exists(run.file("run.bag.active")), "map against world" in run.text
        code = run.end(run.run)
        assert code in (0, -signal.SIGINT) or code == 1 and (
            _STARTING in run.text or _TOO_LATE in run.text or run.interrupts_lost()), (
            "exit code %d; %s" % (code, run.text))
        run.check_gone()
        run.check_said(())
        run.check_tidy()
        for bag in glob.glob(run.file("*.bag")):
            with rosbag.Bag(bag) as opened:
                opened.get_message_count()
        assert not recording or os.path.exists(run.file("run.bag")) or "nothing was recorded" in run.text, run.text
        assert os.path.exists(run.file("plan.yaml")) == os.path.exists(run.file("plan.pgm"))
        if mapping or os.path.exists(run.file("plan.yaml")):
            run.check_map()
        return run.text


def moments(name, count, longest):
    """Return ``count`` moments [s] up to ``longest``, the same ones for a launch file at each call."""
    draw = random.Random(name)
    return [draw.uniform(0.0, longest) for _ in range(count)]


def refused(command):
    """Return why a command cannot be run here, or None."""
    if shutil.which(command[0]) is None:
        return "there is no program %s" % command[0]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                          universal_newlines=True)
    return None if done.returncode == 0 else "%s: %s" % (" ".join(command), done.stderr.strip() or done.returncode)
