# SPDX-License-Identifier: BSD-3-Clause
"""Start-up code of every Python program in a run with a fault; without M2WR_FAULT_STDERR it does nothing.

Each program writes its stderr to its own file, so that tracebacks of programs that end together are not mixed up.
roslaunch also records its stack at an interrupt, as long as it has no handler of its own.

With M2WR_FAULT_JUMP the wall clock is wrong by the number of seconds in the file ``clock`` beside that folder, from the
time at which it is written.  This excludes roslaunch, which measures the end of its nodes by that clock and kills them
at a jump.
"""
import os
import signal
import time

LOOK = 0.1              # between two readings of the file [s], monotonic


def _write_apart(folder, words):
    """Write stderr to a file named after the process, unless the program that started this one reads it."""
    ours, now = os.environ.setdefault("M2WR_FAULT_PIPE", os.readlink("/proc/self/fd/2")), os.readlink("/proc/self/fd/2")
    if now != ours and os.path.dirname(now) != folder:
        return
    file = os.open(os.path.join(folder, "%d" % os.getpid()), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    os.dup2(file, 2)
    os.close(file)
    os.write(2, ("program: %s\nbegan: %.3f s\n" % (" ".join(words), time.monotonic())).encode())


def _note_interrupts():
    """Write the stack of an interrupt on stderr, the innermost call first, before it is raised as KeyboardInterrupt."""
    def note(number, frame):
        lines, inner = ["Stack (most recent call first):"], frame
        while inner is not None:
            lines.append('  File "%s", line %d in %s' % (
                inner.f_code.co_filename, inner.f_lineno or 0, inner.f_code.co_name))    # None where it is unknown
            inner = inner.f_back
        os.write(2, ("\n".join(lines) + "\n").encode())
        signal.default_int_handler(number, frame)

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:       # otherwise it is ignored
        signal.signal(signal.SIGINT, note)


def _jump(path):
    clock, clock_ns, monotonic = time.time, time.time_ns, time.monotonic
    known = [0, 0.0]            # error of the clock [s]; time of the next reading

    def wrong():
        if monotonic() >= known[1]:
            known[1] = monotonic() + LOOK
            try:
                with open(path, encoding="ascii") as stream:
                    known[0] = int(stream.read())
            except (OSError, ValueError):
                pass            # not yet there, or not yet written
        return known[0]

    time.time = lambda: clock() + wrong()
    time.time_ns = lambda: clock_ns() + wrong() * 10**9


def _begin(folder):
    with open("/proc/self/cmdline", encoding="utf-8", errors="replace") as stream:
        words = stream.read().split("\0")[1:-1]         # without the interpreter
    _write_apart(folder, words)
    if [os.path.basename(word) for word in words[:1]] == ["roslaunch"]:
        _note_interrupts()
    elif "M2WR_FAULT_JUMP" in os.environ:
        _jump(os.path.join(os.path.dirname(folder), "clock"))


if "M2WR_FAULT_STDERR" in os.environ:
    _begin(os.environ["M2WR_FAULT_STDERR"])
