#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Topics and services in docs/reference.md are exactly those of the running nodes."""
import os
import sys
import unittest

import rospy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from documents import ROOT  # noqa: E402
from sim_probe import run_checks, run_program  # noqa: E402


class Reference(unittest.TestCase):
    """Starts the nodes of rostest/reference_base.launch."""

    def test_the_running_nodes_have_what_the_reference_says(self):
        done = run_program(["/usr/bin/python3", os.path.join(ROOT, "tools", "reference.py"), "--check", "--graph"],
                           patience=240.0)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    rospy.init_node("check_reference", disable_rostime=True)
    run_checks("reference", Reference)
