# SPDX-License-Identifier: BSD-3-Clause
"""One run of a ROS program: a ROS master of its own, and a simulation in this process that waits for its commands.

The program sees /clock, /odom, the laser and tf, and the parameters and the service by which the report's ``bug2`` gets
its start and goal; it commands /cmd_vel. The simulation is out of its reach: no service moves the robot.
"""
from __future__ import annotations

import math
import os
import sys
import threading
import time
import xml.etree.ElementTree as ElementTree
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Dict, List, Tuple

import rospy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from rosmaster.master import Master
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from gazebo_msgs.srv import SetModelState, SetModelStateResponse, SpawnModel, SpawnModelResponse
from m2wr_campaign.programs.containment import ContainedProgram
from m2wr_campaign.programs.output import last_error
from m2wr_campaign.programs.patience import Patience
from m2wr_campaign.runner.one_run import FAILED, RunError, perform_here
from m2wr_campaign.runner.pool import end_with_parent
from m2wr_navigation.methods.method import REACHED, Decision

if TYPE_CHECKING:
    from m2wr_campaign.study.factors import RunTask
    from m2wr_campaign.study.programs import Program
    from m2wr_sim.api import StepResult

COMMANDS, SCANS, ODOMETRY = "/cmd_vel", "/m2wr/laser/scan", "/odom"
SPAWNING = "/gazebo/spawn_urdf_model", "/gazebo/spawn_sdf_model"
FRAMES = "odom", "link_chassis", "sensor_laser"
ARRIVED = 0.35              # m: the report's go_to_point stops 0.3 m before its goal
STARTING = 60.0             # s of wall time until the program has to be connected
SHARE = 0.9                 # of time_limit: then the run ends itself, and keeps its path and log
LARGEST_LAUNCH = 1_000_000  # bytes


class RosSide:
    """Topics, parameters and services of a run.

    Parameters
    ----------
    master : str
        Address of the ROS master.
    task : RunTask
    """

    def __init__(self, master: str, task: RunTask) -> None:
        os.environ.update(ROS_MASTER_URI=master, ROS_IP="127.0.0.1")
        os.environ.pop("ROS_HOSTNAME", None)
        self._command, self._count, self._news = (0.0, 0.0), 0, threading.Condition()
        for name, value in parameters_of(task).items():
            rospy.set_param("/" + name, value)
        rospy.set_param("/use_sim_time", True)
        rospy.init_node("simulation", disable_signals=True, disable_rosout=True)
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self._scans = rospy.Publisher(SCANS, LaserScan, queue_size=1, tcp_nodelay=True)
        self._odometry = rospy.Publisher(ODOMETRY, Odometry, queue_size=1, tcp_nodelay=True)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._commands = rospy.Subscriber(COMMANDS, Twist, self._take, queue_size=10, tcp_nodelay=True)
        self._services = [rospy.Service("/gazebo/set_model_state", SetModelState, self._refuse)] + [
            rospy.Service(name, SpawnModel, self._spawned) for name in SPAWNING]

    def _take(self, command: Any) -> None:
        with self._news:
            self._command = (command.linear.x, command.angular.z)
            self._count += 1
            self._news.notify()

    def _refuse(self, request: Any) -> Any:
        """Answer the request by which the report's bug2 puts the robot at its start, where it is already."""
        return SetModelStateResponse(True, "the robot is at its start already; it is not moved")

    def _spawned(self, request: Any) -> Any:
        """Answer the request of a launch file that spawns the robot, too."""
        return SpawnModelResponse(True, "the robot is in the world already; no other model is added")

    @property
    def count(self) -> int:
        """How many commands have come."""
        return self._count

    @property
    def command(self) -> Tuple[float, float]:
        """The newest command [m/s, rad/s]."""
        return self._command

    def connected(self) -> bool:
        """Return whether a program commands the robot and reads something of it."""
        reads = self._scans.get_num_connections() + self._odometry.get_num_connections()
        return self._commands.get_num_connections() > 0 and reads > 0

    def publish(self, result: StepResult) -> None:
        """Publish the time and what the robot measures."""
        stamp = rospy.Time.from_sec(result.time)
        self._clock.publish(Clock(clock=stamp))
        measured, scan = result.odometry, result.scan
        assert measured is not None and scan is not None
        odometry, transform = Odometry(), TransformStamped()
        for message in (odometry, transform):
            message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, FRAMES[0], FRAMES[1]
        for place, orientation in ((odometry.pose.pose.position, odometry.pose.pose.orientation),
                                   (transform.transform.translation, transform.transform.rotation)):
            place.x, place.y, place.z = measured.position
            orientation.x, orientation.y, orientation.z, orientation.w = measured.orientation
        twist = odometry.twist.twist
        twist.linear.x, twist.linear.y, twist.angular.z = measured.linear_x, measured.linear_y, measured.angular_z
        self._tf.publish(TFMessage([transform]))
        self._odometry.publish(odometry)
        sent = LaserScan(angle_min=scan.angle_min, angle_max=scan.angle_max, angle_increment=scan.angle_increment,
                         range_min=scan.range_min, range_max=scan.range_max, ranges=scan.ranges.tolist(),
                         intensities=scan.intensities.tolist())
        sent.header.stamp, sent.header.frame_id = stamp, FRAMES[2]
        self._scans.publish(sent)

    def wait_beyond(self, count: int, patience: float) -> bool:
        """Wait until more commands have come; return whether they have.

        Parameters
        ----------
        count : int
        patience : float
            [s]

        Returns
        -------
        bool
        """
        with self._news:
            return self._news.wait_for(lambda: self._count > count, patience)


class Commands:
    """Decisions of a program, for :func:`m2wr_navigation.compare.drive.drive`.

    Parameters
    ----------
    ros : RosSide
    program : ContainedProgram
    task : RunTask
    """

    def __init__(self, ros: RosSide, program: ContainedProgram, task: RunTask) -> None:
        self._ros, self._program, self._task = ros, program, task
        self._patience, self._until = Patience(), time.monotonic() + SHARE * task.time_limit

    def __call__(self, result: StepResult) -> Decision:
        body, goal = self._task.robot.robot.body, self._task.world.goal
        x, y = body.axle(result.pose)
        away = math.hypot(goal[0] - x, goal[1] - y)
        if away <= ARRIVED:
            return Decision(0.0, 0.0, REACHED, "{:.2f} m from the goal".format(away))
        count = self._ros.count
        self._ros.publish(result)
        # one that answers each scan gets the time that it needs, and so the same result on every machine
        answered = self._ros.wait_beyond(count, self._patience.seconds(count > 0))
        if self._ros.count:
            self._patience.note(answered)
        if time.monotonic() > self._until:
            raise RunError("no result after {:.0f} s of wall time: at {:.2f} s of simulated time it is {:.2f} m from "
                           "the goal".format(SHARE * self._task.time_limit, result.time, away))
        if not self._program.running():
            raise RunError(self._program.problem or "at {:.2f} s: the program ended with exit code {}, {:.2f} m from "
                           "the goal".format(result.time, self._program.exit_code(), away))
        return Decision(*self._ros.command)


def parameters_of(task: RunTask) -> Dict[str, float]:
    """Return the parameters by which programs get start and goal, with the names of the report."""
    (x, y, yaw), (goal_x, goal_y) = task.world.start, task.world.goal
    return {"initial_x": x, "initial_y": y, "initial_yaw": yaw, "des_pos_x": goal_x, "des_pos_y": goal_y,
            "des_x": goal_x, "des_y": goal_y}


def arguments_of(program: Program, task: RunTask) -> List[Tuple[str, str]]:
    """Return the arguments of a launch file: those of the study, and start and goal where it has such arguments.

    Parameters
    ----------
    program : Program
    task : RunTask

    Returns
    -------
    list of (str, str)

    Raises
    ------
    RunError
        If it cannot be read.
    """
    found = dict(program.arguments)
    if not program.path.endswith(".launch"):
        return sorted(found.items())
    try:
        with open(program.path, "rb") as file:
            text = file.read(LARGEST_LAUNCH + 1)
        if len(text) > LARGEST_LAUNCH or b"<!ENTITY" in text:
            raise RunError("{}: expected a launch file of at most {} bytes without entities".format(
                os.path.basename(program.path), LARGEST_LAUNCH))
        root = ElementTree.fromstring(text)
    except OSError as error:
        raise RunError("{}: {}; the program must be on this machine, too".format(
            program.path, error.strerror)) from None
    except ElementTree.ParseError as error:
        raise RunError("{}: not well-formed XML: {}".format(os.path.basename(program.path), error)) from None
    known = {arg.get("name") for arg in root.findall("arg") if arg.get("value") is None}
    for name, value in parameters_of(task).items():
        if name in known:
            found.setdefault(name, repr(value))
    return sorted(found.items())


def examine(task: RunTask) -> Dict[str, Any]:
    """Return the row of a run of a program.

    Parameters
    ----------
    task : RunTask
    """
    os.environ.update(ROS_IP="127.0.0.1")
    master = Master(port=0)
    master.start()
    ros = RosSide(master.uri, task)
    program: List[ContainedProgram] = []

    def decide_with() -> Commands:
        assert task.method.program is not None
        program.append(ContainedProgram(task.method.program, arguments_of(task.method.program, task), master.uri))
        until = time.monotonic() + min(STARTING, SHARE * task.time_limit)
        while not ros.connected():
            if not program[0].running():
                raise RunError(program[0].problem or "the program ended with exit code {} before it was connected"
                               .format(program[0].exit_code()))
            if time.monotonic() > until:
                raise RunError("within {:.0f} s nothing commanded {} and read {} or {}".format(
                    STARTING, COMMANDS, SCANS, ODOMETRY))
            time.sleep(0.02)
        return Commands(ros, program[0], task)

    try:
        row = perform_here(task, decide_with)
        if program:
            row["cpu"] += program[0].cpu
            if not row["success"]:
                row["log"] = (row["log"] + program[0].tail())[-8000:]
            if row["status"] == FAILED:
                row["reason"] = program[0].problem or row["reason"] + last_error(program[0].tail())
        return row
    finally:
        for one in program:
            one.end()
        with suppress(Exception):
            master.stop()


def main() -> None:
    """Answer one task; in a process of its own."""
    end_with_parent(int(sys.argv[1]))
    pipe: Connection = Connection(int(sys.argv[2]))
    pipe.send(examine(pipe.recv()))
    pipe.close()
    os._exit(0)             # threads of rospy may wait for programs that were killed


if __name__ == "__main__":
    main()
