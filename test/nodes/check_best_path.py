#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""best_path.launch explores, remembers, chooses and drives; what people see of it is published."""
import json
import os
import shutil
import sys
import tempfile
import unittest

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import OccupancyGrid, Path
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import Launched  # noqa: E402
from m2wr_navigation.best_path.candidates import PLANNERS  # noqa: E402
from m2wr_navigation.compare.comparison import Comparison  # noqa: E402
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402

PATIENCE = 240.0            # s of wall time for a run, also on a busy machine
CLEARANCE = 0.075           # m of score for half a cell of clearance: maps of different runs differ by it


class BestPath(unittest.TestCase):
    """The checks share one memory; each run begins with what the one before has left."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def launch(self, *words):
        """Run the launch file to its end; return its output."""
        with Launched(["m2wr_sim", "best_path.launch", "gui:=false", "real_time_factor:=0", "exit_on_goal:=true",
                       "memory:=" + self.folder] + list(words)) as run:
            wait_until(lambda: run.process.poll() is not None, "the end of the run", PATIENCE)
            return run.text

    def runs(self):
        """Return the runs of the memory."""
        with open(os.path.join(self.folder, "world02", "experience.json"), encoding="utf-8") as stream:
            return json.load(stream)["runs"]

    def test_1_without_a_map_bug_2_explores_and_all_is_kept(self):
        text = self.launch()
        self.assertIn("no map, 0 runs", text)
        self.assertIn("state changed: wall following", text)
        run, = self.runs()
        self.assertEqual((run["how"], run["outcome"]), ("Bug 2", "reached"), text)
        self.assertTrue(25.0 < run["amounts"]["length"] < 35.0, run["amounts"])
        self.assertTrue(os.path.getsize(os.path.join(self.folder, "world02", "map.pgm")) > 10000)

    def test_2_with_a_map_the_best_candidate_is_shown_and_driven(self):
        scores, markers = Recorder("/best_path/scores", DiagnosticArray), Recorder("/best_path/candidates", MarkerArray)
        maps, plans = Recorder("/map", OccupancyGrid), Recorder("/best_path/plan", Path)
        paths = [Recorder("/best_path/plans/ThetaStar_short", Path)]
        text = self.launch()
        self.assertIn("there is a map, nothing has to be explored", text)
        for recorder in [scores, markers, maps, plans] + paths:
            self.assertTrue(recorder.messages, recorder)
        rows = scores.messages[0].status
        driven = [row for row in rows if row.level == DiagnosticStatus.OK]
        self.assertEqual([row.message for row in driven], ["driven"])
        self.assertTrue({planner for planner in PLANNERS} <= {row.name.split(",")[0] for row in rows}, rows)
        totals = [float(row.values[0].value) for row in rows if row.values]
        self.assertEqual(totals, sorted(totals))
        self.assertEqual([value.key for value in driven[0].values],
                         ["score [m]", "length [m]", "time [s]", "clearance [m]", "turning [rad]", "energy [J]"])
        texts = [marker.text for marker in markers.messages[0].markers if marker.type == Marker.TEXT_VIEW_FACING]
        self.assertTrue(any(driven[0].name in words for words in texts), texts)
        self.assertTrue(0 in maps.messages[0].data and 100 in maps.messages[0].data)
        self.assertGreater(len(paths[0].messages[0].poses), 10)
        before, after = self.runs()
        self.assertEqual((after["how"], after["outcome"]), (driven[0].name, "reached"), text)
        self.assertLess(after["total"], 0.6 * before["total"])

    def test_3_three_runs_get_no_worse_and_end_near_the_optimum(self):
        while len(self.runs()) < 3:
            before = len(self.runs())
            text = self.launch()
            self.assertEqual(len(self.runs()), before + 1, text)
        runs = self.runs()
        self.assertEqual({run["outcome"] for run in runs}, {"reached"})
        totals = [run["total"] for run in runs]
        for before, after in zip(totals, totals[1:]):
            self.assertLessEqual(after, before + CLEARANCE, totals)
        start, goal = runs[-1]["track"][0][1:], runs[-1]["goal"]
        optimum = Comparison("world02.world", start, goal[:2]).optimum.length
        self.assertLessEqual(runs[-1]["amounts"]["length"], 1.05 * optimum)

    def test_4_damaged_experience_is_named_and_the_goal_reached(self):
        path = os.path.join(self.folder, "world02", "experience.json")
        best = min(run["total"] for run in self.runs())
        with open(path, "a", encoding="utf-8") as stream:
            stream.write("}")
        text = self.launch("seed:=7")
        self.assertIn("experience.json.damaged: it is no JSON", text)
        run, = self.runs()
        self.assertEqual(run["outcome"], "reached", text)
        self.assertLessEqual(run["total"], best + CLEARANCE)
        self.assertTrue(os.path.exists(path + ".damaged"))

    def test_5_a_goal_in_a_wall_is_told(self):
        text = self.launch("des_pos_x:=0", "des_pos_y:=4.73")
        self.assertIn("unreachable", text)
        self.assertIn("the goal (", text)


if __name__ == "__main__":
    rospy.init_node("best_path_check")
    run_checks("best_path_launch", BestPath)
