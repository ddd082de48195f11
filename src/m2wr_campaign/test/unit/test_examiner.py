# SPDX-License-Identifier: BSD-3-Clause
"""A ROS program drives the robot by its topics, in a simulation that it cannot reach otherwise."""
import os
import signal
import tempfile
import threading
import time

import pytest

from m2wr_campaign.programs.examination import EXAMINER
from m2wr_campaign.runner.one_run import RunError, perform
from m2wr_campaign.study.expansion import all_tasks
from m2wr_campaign.study.study_file import read_study

STUDY = "study: one\nlimit: 20\ntime_limit: 100\nworlds: [{file: world02, start: [0, 8], goal: [0, 7]}]\n" \
    "methods: [{launch: mine/launch/go.launch}]\n"
LAUNCH = '<launch><arg name="des_y"/><node pkg="motion_plan" type="bug2.py" name="bug2" required="true">' \
    '<param name="to" value="$(arg des_y)"/></node></launch>'
#: Drives towards -y, as the goal lies, one command for each scan.
NODE = """#!/usr/bin/env python
import math, rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import SetModelState
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
rospy.init_node("bug2")
assert rospy.get_param("~to") == rospy.get_param("/des_pos_y") == 7.0
rospy.wait_for_service("/gazebo/set_model_state")
state = ModelState(model_name="m2wr")
state.pose.position.y = 7.0
rospy.ServiceProxy("/gazebo/set_model_state", SetModelState)(state)
odometry = []
pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
def scan(message):
    assert len(message.ranges) == 720 and message.header.frame_id == "sensor_laser"
    command = Twist()
    if odometry:
        pose = odometry[-1].pose.pose
        yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        command.angular.z = 2.0 * (-math.pi / 2 - yaw)
        command.linear.x = 0.4 if abs(command.angular.z) < 0.5 else 0.0
    pub.publish(command)
rospy.Subscriber("odom", Odometry, odometry.append)
rospy.Subscriber("/m2wr/laser/scan", LaserScan, scan)
rospy.spin()
"""


@pytest.fixture
def task(tmp_path):
    (tmp_path / "mine" / "launch").mkdir(parents=True)
    (tmp_path / "mine" / "scripts").mkdir()
    (tmp_path / "mine" / "package.xml").write_text("<package><name>motion_plan</name></package>")
    (tmp_path / "mine" / "launch" / "go.launch").write_text(LAUNCH)
    (tmp_path / "s.yaml").write_text(STUDY)

    def made(node):
        (tmp_path / "mine" / "scripts" / "bug2.py").write_text(node)
        return all_tasks(read_study(str(tmp_path / "s.yaml")))[0]
    return made


def test_a_program_reaches_the_goal_by_its_own_commands(task):
    row = perform(task(NODE))
    assert row["outcome"] == "reached", (row["reason"], row["log"])
    assert row["success"] == 1 and 1.0 < row["time"] < 10.0        # it was not put there
    assert row["length"] == pytest.approx(1.0, abs=0.2) and row["method"] == "mine"


def test_a_launch_file_that_spawns_the_robot_is_answered(task):
    row = perform(task(NODE.replace('state = ModelState(', """from gazebo_msgs.srv import SpawnModel
for name in ("/gazebo/spawn_urdf_model", "/gazebo/spawn_sdf_model"):
    rospy.wait_for_service(name)
    assert rospy.ServiceProxy(name, SpawnModel)(model_name="m2wr").success
state = ModelState(""")))
    assert row["outcome"] == "reached", (row["reason"], row["log"])


def test_a_program_that_fails_has_a_reason_and_its_log(task):
    row = perform(task(NODE.replace("odometry = []", "raise ValueError('a mistake')")))
    assert row["status"] == "failed" and "the program ended" in row["reason"]
    assert row["reason"].endswith("it wrote: ValueError: a mistake (bug2.py, line 14)")
    assert "bug2" in row["log"] and "ValueError: a mistake" in row["log"]


def test_a_command_that_is_not_finite_fails(task):
    row = perform(task(NODE.replace("0.4 if", "float('nan') if")))
    assert row["status"] == "failed" and "command (nan, " in row["reason"]


def test_run_error_is_told_for_a_launch_file_that_cannot_be_read(task):
    from m2wr_campaign.programs.examiner import arguments_of
    one = task(NODE)
    with open(one.method.program.path, "w", encoding="utf-8") as file:
        file.write("<launch>")
    with pytest.raises(RunError, match="go.launch: not well-formed XML"):
        arguments_of(one.method.program, one)


def examiners():
    """Return the process numbers of this process's examiners."""
    found = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open("/proc/%s/cmdline" % name, "rb") as file:
                words = file.read().split(b"\0")
        except OSError:
            continue
        if words[1:4] == [b"-m", EXAMINER.encode(), str(os.getpid()).encode()]:
            found.append(int(name))
    return found


def test_a_killed_examiner_leaves_no_files(task, tmp_path, monkeypatch):
    folder = tmp_path / "temporary"
    folder.mkdir(mode=0o711)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    rows = []
    thread = threading.Thread(target=lambda: rows.append(perform(task(NODE))))
    thread.start()
    until = time.monotonic() + 60.0
    while not (examiners() and list(folder.glob("*/m2wr_program_*/output"))):
        assert time.monotonic() < until and thread.is_alive(), (examiners(), rows)
        time.sleep(0.02)
    os.kill(examiners()[0], signal.SIGKILL)
    thread.join(60.0)
    assert rows[0]["status"] == "failed" and "ended with exit code -9" in rows[0]["reason"]
    assert not list(folder.iterdir())
