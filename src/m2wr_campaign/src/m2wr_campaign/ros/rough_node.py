# SPDX-License-Identifier: BSD-3-Clause
"""``rough_drive``: puts rough ground below a robot of a paused simulation, drives it ahead, and says how it ended."""
from __future__ import annotations

import math
import threading
from typing import Any, Dict, Optional

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty

from gazebo_msgs.msg import ModelStates
from m2wr_campaign.ros.ground import spawn_ground, values_of
from m2wr_campaign.rough.drive import OUTCOMES, REACHED, Watch
from m2wr_campaign.terrain.measures import measures_of
from m2wr_campaign.terrain.relief import Grid, heights_of
from m2wr_node.ros.starting import start_node

_SETTLE = 1.0           # s of simulated time, in which the robot comes to rest on the ground
_WORDS = dict(zip(OUTCOMES, ("reached its goal", "tipped over", "slipped: its wheels turn, but it does not move",
                             "is stuck: its wheels cannot turn")))


class RoughDrive:
    """The drive; all parameters are private ones of the node."""

    def __init__(self) -> None:
        self._robot = str(rospy.get_param("~robot", "m2wr_rough"))
        self._distance = float(rospy.get_param("~distance", 5.0))
        self._radius = float(rospy.get_param("~wheel_radius", 0.1))
        self._seed, height = int(rospy.get_param("~seed", 0)), float(rospy.get_param("~roughness", 0.03))
        if not (0.1 <= self._distance <= 8.0 and 0.0 < self._radius < 10.0 and self._seed >= 0):
            raise ValueError("distance {:g}, wheel_radius {:g}, seed {}; expected 0.1 to 8 m, above 0, from 0".format(
                self._distance, self._radius, self._seed))
        self._grid = Grid(513, 20.0)
        names = str(rospy.get_param("~reliefs", "fractal rubble")).split()
        self._heights = heights_of(self._grid, {name: height for name in names}, self._seed)
        self._states: Optional[ModelStates] = None
        self._wheels: Dict[str, float] = {}
        self._changed = threading.Condition()

    def _on_states(self, message: ModelStates) -> None:
        with self._changed:
            self._states = message
            self._changed.notify()

    def _on_joints(self, message: JointState) -> None:
        self._wheels.update(zip(message.name, message.position))

    def run(self) -> int:
        """Return the exit code: 0 if the goal was reached, 1 if not."""
        found = measures_of(self._heights, self._grid.cell)
        rospy.loginfo("ground of seed %d: RMS height %.3f m, 95 %% of slopes below %.0f degrees", self._seed,
                      found["rms_height"], found["slope_95"])
        spawn_ground(self._grid, self._heights, "terrain")
        rospy.Subscriber("/gazebo/model_states", ModelStates, self._on_states, queue_size=1)
        rospy.Subscriber("/joint_states", JointState, self._on_joints, queue_size=1)
        commands = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        while not rospy.is_shutdown() and self._pose() is None:
            self._wait()
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        watch, began = Watch(self._radius, self._distance), None
        while not rospy.is_shutdown():
            self._wait()
            pose, now = self._pose(), rospy.get_time()
            if pose is None or now <= 0.0 or not self._wheels:
                continue
            began = now if began is None else began
            if now - began < _SETTLE:
                continue
            ended = watch.look(now, pose, float(np.mean(list(self._wheels.values()))))
            command = Twist()
            if ended is None:
                command.linear.x, command.angular.z = watch.command(pose)
            commands.publish(command)
            if ended is not None:
                rospy.loginfo("result: %s %s, after %.2f m and %.1f s; greatest tilt %.0f degrees", self._robot,
                              _WORDS[ended.outcome], ended.distance, ended.time, math.degrees(ended.tilt))
                return 0 if ended.outcome == REACHED else 1
        return 1

    def _wait(self) -> None:
        with self._changed:
            self._changed.wait(0.5)

    def _pose(self) -> Any:
        """Return the true pose of the robot, or None if it is not there yet."""
        states = self._states
        if states is None or self._robot not in states.name:
            return None
        return values_of(states.pose[states.name.index(self._robot)])


def main() -> int:
    """Run the node; return the exit code."""
    start_node("rough_drive")
    try:
        return RoughDrive().run()
    except rospy.ROSInterruptException:
        return 1
    except (ValueError, OSError, rospy.ServiceException) as error:
        rospy.logfatal("%s", error)
        return 1
