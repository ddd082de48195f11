# SPDX-License-Identifier: BSD-3-Clause
"""Every program ends without a traceback when it is interrupted, and when its pipe is closed (``... | head``)."""
import glob
import os
import re
import subprocess
import sys

import pytest

import workspace_tree as tree

IMPORT = re.compile(r"^ *(?:import|from) (\S+)", re.M)
PROGRAMS = sorted(path for place in (("nodes", "*"), ("scripts", "*"), ("scripts", "*", "*"))
                  for path in glob.glob(os.path.join(tree.ROOT, "src", "*", *place)) if os.path.isfile(path))
#: Programs with arguments for a long output, and their exit codes.
PRINTING = (("m2wr_tools/scripts/m2wr_sim/doctor", ("-h",), 0),
            ("m2wr_tools/scripts/m2wr_sim/bag_report", ("test/data/turn_and_go.bag",) * 2, 0),
            ("m2wr_course/scripts/exercise", ("5", "test/data/boxes.world"), 1),
            ("m2wr_gmapping/nodes/slam_gmapping_replay", ("-h",), 0))


@pytest.mark.parametrize("path", PROGRAMS, ids=tree.relative)
def test_a_program_ends_cleanly_without_a_reader(path):
    with open(path, encoding="utf-8") as stream:
        text = stream.read()
    nodes = "motion_plan.ros" in text                       # run_node does it
    assert nodes or "\n    ignore_closed_pipes(" in text


STAND_INS = sorted(glob.glob(os.path.join(tree.ROOT, "dropin", "*", "scripts", "*")))


@pytest.mark.parametrize("path", PROGRAMS + STAND_INS, ids=tree.relative)
def test_an_interrupt_of_the_imports_prints_nothing(path):
    quick = {"os", "sys"}                                   # already imported by Python
    imports = [name for name in IMPORT.findall(tree.read(path)) if name not in quick]
    assert imports[0] == "m2wr_node.interrupts", "%s is imported before the handler of Ctrl-C" % imports[0]


def test_programs_are_found():
    assert len(PROGRAMS) > 30 and len(STAND_INS) > 8


@pytest.mark.parametrize("name, words, code", PRINTING, ids=[row[0] for row in PRINTING])
def test_no_message_about_a_closed_pipe(name, words, code):
    reading, writing = os.pipe()
    os.close(reading)                                       # closed before the first output
    try:
        done = subprocess.run([sys.executable, os.path.join(tree.ROOT, "src", name)] + list(words), stdout=writing,
                              stderr=subprocess.PIPE, cwd=tree.ROOT, timeout=120)
    finally:
        os.close(writing)
    assert done.returncode == code and b"Broken" not in done.stderr and b"Traceback" not in done.stderr, done.stderr
