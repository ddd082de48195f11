# SPDX-License-Identifier: BSD-3-Clause
"""Runs the cases of a target in a process of their own, checks them, and records the findings.

A worker is forked from a parent that has imported and compiled everything, so that a crash of a library costs a
millisecond.  Before each case the worker writes the case's number into shared memory: so a case that crashes, hangs or
exhausts the memory is known.
"""
import logging
import mmap
import os
import pickle
import re
import resource
import select
import signal
import struct
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass, field
from typing import Dict, List

import mutations

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
ADDRESS_SPACE = 3 * 2 ** 30     # bytes above the worker's use at its start: beyond it allocations fail
STUCK = 5.0                     # a case is killed after this multiple of its processor time
WORDS_KEPT = 3000               # characters of a library's output before it ended the process
MINIMISING = 20.0               # s of wall time spent on reducing a failing case
AGAIN = 3                       # exit code of a worker whose target must be restarted
EXAMPLES = 3                    # findings of one signature that are kept in full


class Wrong(Exception):
    """The input was handled, but the result is not allowed."""


class Target:
    """One interface under test; subclasses define how a case is made and run.

    Attributes
    ----------
    name : str
        Key in the registry.
    cpu : float
        Processor time that a case may take [s].
    memory : int
        Bytes by which a case may raise the process's peak.
    weight : float
        Share of the time relative to other targets, or of the cases where their number is given.
    dear : float
        Divisor of the number of cases where it is given: for targets that mostly wait.
    broken : bool
        Set by :meth:`run` if no further case can run in this process.
    """

    name = ""
    cpu = 2.0
    memory = 300 * 2 ** 20
    weight = 1.0
    dear = 1.0
    broken = False

    def prepare(self):
        """Import, compile, read the corpus: once, before workers are forked."""

    def begin(self):
        """Called in each worker before its first case."""

    def end(self):
        """Called in a worker that ends normally."""

    def make(self, rng):
        """Return a case, anything that :mod:`case_files` can write."""
        raise NotImplementedError

    def run(self, case):
        """Run a case; exceptions defined for bad input are caught here, all others are findings."""
        raise NotImplementedError

    def smaller(self, case):
        """Yield reduced cases."""
        return mutations.smaller_sequences(case) if isinstance(case, (list, bytes, str)) else iter(())

    def describe(self, case):
        """Return the bytes of the readable file that is written beside the case."""
        return case if isinstance(case, bytes) else case.encode() if isinstance(case, str) else repr(case).encode()


@dataclass
class Finding:
    """One fault found by a case.

    Attributes
    ----------
    kind : str
        ``exception``, ``wrong``, ``slow``, ``memory``, ``died`` or ``stuck``.
    signature : str
        The same for cases with the same cause, as far as it can be determined.
    """

    target: str
    number: int
    kind: str
    signature: str
    text: str
    count: int = 1
    case: object = None


@dataclass
class Tally:
    """Number of cases, and the findings."""

    cases: int = 0
    cpu: float = 0.0
    wall: float = 0.0
    slowest: float = 0.0
    peak: int = 0                       # bytes
    findings: Dict[str, Finding] = field(default_factory=dict)
    numbers: List[int] = field(default_factory=list)

    def add(self, finding):
        """Count a finding; returns whether its signature is new."""
        known = self.findings.get(finding.signature)
        if known is not None:
            known.count += finding.count
            return False
        self.findings[finding.signature] = finding
        return True


def signature_of(error):
    """Return the signature of an exception: its type and the innermost line of this workspace that it came through."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename.startswith(ROOT) and "/test/fuzz/" not in frame.filename
           or "/devel/" in frame.filename]
    place = "%s:%d %s" % (os.path.relpath(own[-1].filename, ROOT), own[-1].lineno, own[-1].name) if own else "outside"
    if isinstance(error, Wrong):
        place = re.sub(r"[-+]?\b\d[\d.e+-]*|\b(?:nan|inf)\b", "N", str(error))[:120]
    return "%s at %s" % (type(error).__name__, place)


class _Listener(logging.Handler):
    """Handles all log lines: they must be formattable, and none may report an unexpected exception."""

    def __init__(self, foreseen):
        super().__init__(logging.INFO)
        self._foreseen, self.caught = foreseen, None

    def emit(self, record):
        record.getMessage()
        if record.exc_info and record.exc_info[1] is not None and not isinstance(record.exc_info[1], self._foreseen):
            self.caught = self.caught or record.exc_info[1]

    def handle(self, record):
        self.emit(record)           # an error in it is a fault of the log call


def _listen(foreseen):
    listener = _Listener(foreseen)
    logging.disable(logging.NOTSET)
    root = logging.getLogger()
    root.handlers, root.level = [listener], logging.INFO
    for name in list(logging.root.manager.loggerDict):
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate, logger.disabled = [], True, False
    return listener


def judge(target, case, listener):
    """Run one case; returns (kind, signature, text), or None without a fault."""
    listener.caught = None
    before, peak = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = None
    try:
        target.run(case)
    except (KeyboardInterrupt, SystemExit) as error:
        found = ("exception", signature_of(error), traceback.format_exc())
    except Wrong as error:
        found = ("wrong", signature_of(error), str(error))
    except BaseException as error:
        found = ("exception", signature_of(error), traceback.format_exc())
    if found is None and listener.caught is not None:
        error = listener.caught
        text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
        found = ("exception", "logged " + signature_of(error), "only logged, but unexpected:\n" + text)
    spent = time.process_time() - before
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak) * 1024
    if found is None and grown > target.memory:
        found = ("memory", "memory", "%d MB more than before; expected at most %d MB" % (
            grown >> 20, target.memory >> 20))
    if found is None and spent > target.cpu:
        found = ("slow", "slow", "%.2f s of processor time; expected at most %g s" % (spent, target.cpu))
    return found, spent


def _limit():
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with open("/proc/self/statm") as stream:
        size = int(stream.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + ADDRESS_SPACE,) * 2)


class _Child:
    """A forked process that runs cases and reports them through a pipe."""

    def __init__(self, work, foreseen):
        self.place = mmap.mmap(-1, 16)              # number of the case that runs, processor time at its start
        self._words = tempfile.TemporaryFile()
        reading, writing = os.pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid:
            os.close(writing)
            self.pipe = os.fdopen(reading, "rb", buffering=0)
            return
        code = 1
        try:
            os.close(reading)
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            os.dup2(self._words.fileno(), 1)
            os.dup2(self._words.fileno(), 2)
            _limit()
            listener = _listen(foreseen)
            with os.fdopen(writing, "wb", buffering=0) as pipe:
                code = AGAIN if work(lambda message: self._send(pipe, message), self._at, listener) else 0
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
        finally:
            os._exit(code)

    def _at(self, number):
        self.place[:16] = struct.pack("<qd", number, time.process_time())

    @staticmethod
    def _send(pipe, message):
        data = pickle.dumps(message)
        pipe.write(struct.pack("<I", len(data)) + data)

    def where(self):
        """Return the number of the case that runs, and the processor time at its start."""
        return struct.unpack("<qd", self.place[:16])

    def spent(self):
        """Return the processor time of the process [s]."""
        try:
            with open("/proc/%d/stat" % self.pid) as stream:
                fields = stream.read().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def words(self):
        """Return the end of the process's output."""
        size = self._words.seek(0, 2)
        self._words.seek(max(0, size - WORDS_KEPT))
        return self._words.read().decode(errors="replace")

    def kill(self):
        os.kill(self.pid, signal.SIGKILL)

    def close(self):
        """Reap the process; returns why it ended."""
        _, status = os.waitpid(self.pid, 0)
        self.pipe.close()
        words = self.words()
        self._words.close()
        self.place.close()
        if os.WIFSIGNALED(status):
            return signal.Signals(os.WTERMSIG(status)).name, words
        return ("exit code %d" % os.WEXITSTATUS(status) if os.WEXITSTATUS(status) else ""), words


def _messages(child, patience, target):
    """Yield the messages of a child until its pipe closes; if a case takes far too long, kill it and yield None."""
    pending, number, since = b"", None, time.monotonic()
    while True:
        ready, _, _ = select.select([child.pipe], [], [], 0.2)
        if ready:
            data = os.read(child.pipe.fileno(), 1 << 16)
            if not data:
                return
            pending += data
            while len(pending) >= 4 and len(pending) - 4 >= struct.unpack_from("<I", pending)[0]:
                size = 4 + struct.unpack_from("<I", pending)[0]
                yield pickle.loads(pending[4:size])
                pending = pending[size:]
        now, (at, began) = time.monotonic(), child.where()
        if at != number:
            number, since = at, now
        if child.spent() - began > STUCK * target.cpu or now - since > patience:
            child.kill()
            yield None
            return


def run_cases(target, seed, numbers, deadline=None, patience=120.0, make=None):
    """Run cases; yields each Finding at once, and finally the Tally.

    Parameters
    ----------
    target : Target
        Prepared.
    numbers : range
        Of the cases.
    deadline : float, optional
        Of ``time.monotonic()``; no case begins after it.
    patience : float
        Wall time [s] after which a case that uses no processor time is stuck.
    make : callable, optional
        Function from a number to a case that replaces the target's own.
    """
    make = make or (lambda number: target.make(mutations.generator(seed, target.name, number)))
    tally, at, began = Tally(), numbers.start, time.monotonic()
    while at < numbers.stop and (deadline is None or time.monotonic() < deadline):
        def work(send, mark, listener, first=at):
            mark(first)
            target.begin()
            cases, slowest, sent = 0, 0.0, {}
            start = time.process_time()
            for number in range(first, numbers.stop):
                if deadline is not None and time.monotonic() > deadline:
                    break
                case = make(number)
                mark(number)
                found, spent = judge(target, case, listener)
                cases, slowest = cases + 1, max(slowest, spent)
                if found is not None:
                    sent[found[1]] = sent.get(found[1], 0) + 1
                    send((number, found[0], found[1], found[2] if sent[found[1]] <= EXAMPLES else ""))
                if target.broken:
                    break
                if cases % 50 == 0:
                    send((cases, slowest, time.process_time() - start))
                    cases, slowest, start = 0, 0.0, time.process_time()
            target.end()
            send((cases, slowest, time.process_time() - start))
            return target.broken

        child, stuck, counted = _Child(work, getattr(target, "foreseen", ())), False, 0
        for message in _messages(child, patience, target):
            if message is None:
                stuck = True
            elif len(message) == 3:
                counted += message[0]
                tally.slowest, tally.cpu = max(tally.slowest, message[1]), tally.cpu + message[2]
            else:
                number, kind, signature, text = message
                finding = Finding(target.name, number, kind, signature, text)
                if tally.add(finding):
                    yield finding
        last, _ = child.where()
        ended, words = child.close()
        if ended == "exit code %d" % AGAIN:
            tally.cases += last - at + 1
            at = last + 1
            continue
        if stuck:
            finding = Finding(target.name, last, "stuck", "stuck",
                              "killed: far beyond %g s of processor time" % target.cpu)
        elif ended:
            line = words.strip().splitlines()[-1] if words.strip() else ""
            finding = Finding(target.name, last, "died", "%s: %s" % (ended, re.sub(r"\d+", "N", line)[:160]), words)
        else:
            tally.cases += counted
            break
        if tally.add(finding):
            yield finding
        tally.cases += max(1, last - at + 1)
        at = last + 1
    tally.wall = time.monotonic() - began
    tally.peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    yield tally


def repeat(target, case):
    """Run one case in a process of its own; returns the Finding or None."""
    for found in run_cases(target, 0, range(1), make=lambda _: case):
        if isinstance(found, Finding):
            return found
    return None


def minimise(target, case, signature, seconds=MINIMISING):
    """Return the smallest case with the same signature found within ``seconds`` of wall time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for smaller in target.smaller(case):
            found = repeat(target, smaller)
            if found is not None and found.signature == signature:
                case = smaller
                break
            if time.monotonic() > end:
                break
        else:
            break
    return case
