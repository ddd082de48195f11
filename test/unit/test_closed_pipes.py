"""Every program ends, or goes on, in peace when nobody reads it any more (``... | head``)."""
import glob
import os
import subprocess
import sys

import pytest

import workspace_tree as tree

PROGRAMS = sorted(path for room in ("nodes", "scripts")
                  for path in glob.glob(os.path.join(tree.ROOT, "src", "*", room, "*")) if os.path.isfile(path))
#: Programs with words with which each soon prints a lot, and their exit codes.
PRINTING = (("m2wr_sim/nodes/doctor", ("-h",), 0), ("m2wr_sim/nodes/bag_report", ("test/data/turn_and_go.bag",) * 2, 0),
            ("m2wr_course/scripts/exercise", ("5", "test/data/boxes.world"), 1),
            ("m2wr_gmapping/nodes/slam_gmapping_replay", ("-h",), 0))


@pytest.mark.parametrize("path", PROGRAMS, ids=tree.relative)
def test_a_program_outlives_its_readers(path):
    with open(path, encoding="utf-8") as stream:
        text = stream.read()
    nodes = "motion_plan.ros" in text                       # run_node does it for them
    assert nodes or "\n    go_on_unread(" in text


def test_programs_are_found():
    assert len(PROGRAMS) > 30


@pytest.mark.parametrize("name, words, code", PRINTING, ids=[row[0] for row in PRINTING])
def test_nothing_is_said_of_a_closed_pipe(name, words, code):
    reading, writing = os.pipe()
    os.close(reading)                                       # closed before the first word
    try:
        done = subprocess.run([sys.executable, os.path.join(tree.ROOT, "src", name)] + list(words), stdout=writing,
                              stderr=subprocess.PIPE, cwd=tree.ROOT, timeout=120)
    finally:
        os.close(writing)
    assert done.returncode == code and b"Broken" not in done.stderr and b"Traceback" not in done.stderr, done.stderr
