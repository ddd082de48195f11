#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every command block of the documents does what the document says; the argument is `course` or `readmes`."""
import os
import re
import shutil
import sys
import tempfile
import unittest

import rospy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_launch_errors import free_port  # noqa: E402
from doc_terminals import run_document  # noqa: E402
from documents import COURSE, GUIDES, READMES, ROOT, blocks, documents  # noqa: E402
from sim_probe import run_checks  # noqa: E402

SETS = {"course": COURSE, "readmes": GUIDES + READMES}
SEEN_FROM_THE_ROOT = ("devel", "docs", "src", "test", "tools", "Makefile")


def environment(folder):
    """Return the environment of a document's shells: a master of their own, no display, the system's python3."""
    programs = os.path.join(folder, "programs")
    os.mkdir(programs)
    os.symlink("/usr/bin/python3", os.path.join(programs, "python3"))
    return dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:%d" % free_port(), ROS_LOG_DIR=os.path.join(folder, "log"),
                DISPLAY="", WAYLAND_DISPLAY="", PATH=programs + ":" + os.environ["PATH"], MPLBACKEND="Agg")


def work_folder(top):
    """Make and return the writable folder in which commands run; it shows the contents of the workspace's root."""
    folder = os.path.join(top, "work")
    os.mkdir(folder)
    for name in SEEN_FROM_THE_ROOT:
        if os.path.exists(os.path.join(ROOT, name)):
            os.symlink(os.path.join(ROOT, name), os.path.join(folder, name))
    return folder


class Documents(unittest.TestCase):
    """One case for each document that runs something; those of the course share a folder, as for a student."""

    course = None

    @classmethod
    def setUpClass(cls):
        top = tempfile.mkdtemp(prefix="course_")
        cls.addClassCleanup(shutil.rmtree, top, ignore_errors=True)
        cls.course = work_folder(top)

    def run_one(self, path):
        top = tempfile.mkdtemp(prefix="docs_")
        self.addCleanup(shutil.rmtree, top, ignore_errors=True)
        shared = path in documents(COURSE)
        times = run_document(blocks(path), self.course if shared else work_folder(top), environment(top))
        sys.stderr.write("%6.1f s  %s\n" % (sum(seconds for _, seconds in times), path))


def add_cases(patterns):
    """Give the class a method for each document; LookupError when there is nothing to run."""
    names = []
    for path in documents(patterns):
        if any(block.runs for block in blocks(path)):
            names.append("test_" + re.sub(r"\W+", "_", path[:-len(".md")]))
            setattr(Documents, names[-1], lambda self, path=path: self.run_one(path))
    if not names:
        raise LookupError("nothing to run in %s below %s" % (", ".join(patterns), ROOT))


if __name__ == "__main__":
    chosen = [argument for argument in sys.argv[1:] if argument in SETS]
    add_cases([pattern for name in chosen for pattern in SETS[name]])
    rospy.init_node("check_docs", disable_rostime=True, argv=[])
    sys.argv = [argument for argument in sys.argv if argument not in SETS]
    run_checks("docs_" + "_".join(chosen), Documents)
