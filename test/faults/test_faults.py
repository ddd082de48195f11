# SPDX-License-Identifier: BSD-3-Clause
"""For every fault, a run reports what happened, loses no results, and leaves no process running.

``make test`` takes a few cases; ``make faults`` takes all, and MOMENTS interrupts of every launch file.
"""
import os

import pytest
import roslaunch.config
import rospkg

import m2wr_node
import m2wr_tools.doctor
from fault_cases import CASES, LAUNCH_FILES
from fault_run import FaultRun, interrupt_at, moments, refused
from tracebacks import foreign_tracebacks, interrupts_lost

LONG = os.environ.get("M2WR_FAULTS") == "all"
MOMENTS = int(os.environ.get("MOMENTS") or "100") if LONG else 1
LONGEST = 12.0          # the latest interrupt after the start [s], wall; by then every launch file is running
SHORT = ("m2wr_sim/mapping.launch", "m2wr_gmapping/gmapping.launch")     # of the launch files, in make test


@pytest.mark.parametrize("case", [case for case in CASES if LONG or not case.long], ids=lambda case: case.name)
def test_fault(case):
    reason = refused(list(case.needs)) if case.needs else None
    if reason:
        pytest.skip("this fault cannot be injected here: %s" % reason)
    with FaultRun(case.launch, case.environment, case.prefix) as run:
        if case.ready:
            run.wait_for(case.ready)
        first = run.run
        if case.fault is not None:
            case.fault(run)
        if case.repeats:
            run.wait_for_more(case.repeats, first)
        run.end(first, case.ends)
        run.check_gone(case.killed)
        run.check_said(case.said)
        run.check_tidy(case.stray)
        if "bag" in case.left:
            run.check_bag()
        if "map" in case.left:
            run.check_map()


@pytest.mark.parametrize("name, number", [(name, number) for name, words in sorted(LAUNCH_FILES.items())
                                          if words is not None and (LONG or name in SHORT)
                                          for number in range(MOMENTS)])
def test_interrupted_at_any_moment(name, number):
    interrupt_at(name.split("/") + LAUNCH_FILES[name], moments(name, MOMENTS if LONG else 100, LONGEST)[number])


PROGRAM = os.path.join(rospkg.RosPack().get_path("m2wr_node"), "scripts", "is_there")
with open(PROGRAM, encoding="utf-8") as _stream:
    _FIRST = next(number for number, line in enumerate(_stream, 1) if "m2wr_node.interrupts" in line)
FIRST_IMPORT, SECOND_IMPORT = "%s:%d" % (PROGRAM, _FIRST), "%s:%d" % (PROGRAM, _FIRST + 1)
CHAIN = "\nDuring handling of the above exception, another exception occurred:\n\n"


def frames(*files, last="KeyboardInterrupt"):
    """Return a traceback through these files; ``FILE:LINE`` selects a line other than the first."""
    return "Traceback (most recent call last):\n%s%s\n" % ("".join(
        '  File "%s", line %s, in <module>\n    import something\n' % (name, line or 1)
        for name, _, line in (place.partition(":") for place in files)), last)


@pytest.mark.parametrize("program, text, foreign", [
    ("/usr/bin/roslaunch", frames("/usr/bin/roslaunch", rospkg.__file__, "<frozen importlib._bootstrap>"), False),
    ("/usr/bin/roslaunch", frames("/usr/bin/roslaunch", "_generator.pyx", "<frozen importlib._bootstrap>"), False),
    ("/usr/bin/roslaunch", frames("/usr/bin/roslaunch", m2wr_tools.doctor.__file__), True),
    ("/usr/bin/roslaunch", frames("/usr/bin/roslaunch", __file__), True),
    ("/usr/bin/roslaunch", frames(pytest.__file__, last="IndexError: x") + CHAIN + frames("/usr/bin/roslaunch"), False),
    ("/usr/bin/rosversion", frames("/usr/bin/rosversion", rospkg.__file__), False),     # roslaunch runs it
    (PROGRAM, frames(FIRST_IMPORT, m2wr_node.__file__, os.__file__), False),
    (PROGRAM, frames(os.__file__, last="KeyError: x") + CHAIN + frames(FIRST_IMPORT, os.__file__), False),
    (PROGRAM, frames(FIRST_IMPORT, last="KeyError: x"), True),
    (PROGRAM, frames(SECOND_IMPORT, os.__file__), True),
    (PROGRAM, frames(FIRST_IMPORT, m2wr_tools.doctor.__file__), True),
    (PROGRAM, frames("<frozen site>", os.__file__), False),
    (PROGRAM, frames(os.path.join(os.path.dirname(__file__), "bug2.py"), os.__file__), True),
    (None, "Fatal Python error: init_import_site\n" + frames("<frozen site>", "<string>", os.__file__), False),
    (None, "Fatal Python error: init_import_site\n" + frames("<frozen site>", m2wr_tools.doctor.__file__), True)],
    ids=["in roslaunch", "in its Cython", "ours in roslaunch", "a test in roslaunch", "chained in roslaunch",
         "in rosversion", "first import", "chained first import", "another error", "second import",
         "ours imported first", "Python starts", "ours begins", "Python starts, no file", "Python starts, ours"])
def test_only_tracebacks_outside_our_control_are_ignored(program, text, foreign):
    assert bool(foreign_tracebacks("before\n" + text + "after\n", program)) == foreign


STACK = 'Stack (most recent call first):\n  File "%s", line %d in inner\n  File "/usr/bin/roslaunch", line 34 in x\n'


@pytest.mark.parametrize("words, passed", [("DEFAULT_MASTER_PORT", 2), ("import Master", 0)])
def test_an_interrupt_in_a_bare_except_of_roslaunch_is_lost(words, passed):
    with open(roslaunch.config.__file__, encoding="utf-8") as stream:
        line = next(number for number, text in enumerate(stream, 1) if words in text)
    assert interrupts_lost(2 * (STACK % (roslaunch.config.__file__, line))) == passed


def test_an_interrupt_in_a_callback_is_lost():
    assert interrupts_lost("Exception ignored in: <function cb>\nTraceback (most recent call last):\n"
                           '  File "<frozen importlib._bootstrap>", line 1, in cb\nKeyboardInterrupt: \n') == 1
    assert not interrupts_lost("")


def test_every_launch_file_is_interrupted():
    pack, found = rospkg.RosPack(), set()
    for package in {name.split("/")[0] for name in LAUNCH_FILES}:
        folder = os.path.join(pack.get_path(package), "launch")
        found.update("%s/%s" % (package, name) for name in os.listdir(folder) if name.endswith(".launch"))
    worlds = {name for name in found if name.startswith("gazebo_ros/") and name.endswith("_world.launch")}
    assert found - worlds == set(LAUNCH_FILES) - worlds       # the worlds of gazebo_ros include its empty_world.launch
