# SPDX-License-Identifier: BSD-3-Clause
"""The tasks of ten clients during a soak run, paced by simulated time."""
import random
import threading
import time

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from nav_msgs.srv import GetMap
from std_srvs.srv import Empty

from gazebo_msgs import srv
from gazebo_msgs.msg import LinkState, ModelState

_POLL = 0.02                # s of wall time between two readings of the clock
_CRATE = """<sdf version="1.6"><model name="crate"><link name="link"><inertial><mass>1</mass></inertial><collision
name="c"><geometry><box><size>0.3 0.3 0.3</size></box></geometry></collision></link></model></sdf>"""
_TYPES = {
    "get_world_properties": srv.GetWorldProperties, "get_model_state": srv.GetModelState,
    "get_link_state": srv.GetLinkState, "get_model_properties": srv.GetModelProperties,
    "get_link_properties": srv.GetLinkProperties, "get_joint_properties": srv.GetJointProperties,
    "get_physics_properties": srv.GetPhysicsProperties, "set_model_state": srv.SetModelState,
    "set_link_state": srv.SetLinkState, "apply_body_wrench": srv.ApplyBodyWrench,
    "clear_body_wrenches": srv.BodyRequest, "apply_joint_effort": srv.ApplyJointEffort,
    "pause_physics": Empty, "unpause_physics": Empty, "reset_world": Empty, "reset_simulation": Empty,
    "spawn_sdf_model": srv.SpawnModel, "spawn_urdf_model": srv.SpawnModel, "delete_model": srv.DeleteModel,
}


def call(name, *arguments):
    """Call a service of the simulation over a connection of its own; returns the answer."""
    return rospy.ServiceProxy("/gazebo/" + name, _TYPES[name])(*arguments)


class Task(threading.Thread):
    """Calls ``act(turn)`` ``count`` times, spread evenly over the simulated time of the run.

    Attributes
    ----------
    done : int
        Turns that were made.
    failures : list of str
        The first errors.
    """

    def __init__(self, name, act, count, seconds, clock, stopping):
        super().__init__(daemon=True, name=name)
        self._act, self.count, self._seconds = act, count, seconds
        self._clock, self._stopping = clock, stopping
        self.done, self.failed, self.failures = 0, 0, []

    def run(self):
        for turn in range(self.count):
            due = self._seconds * (turn + 0.5) / self.count
            while self._clock.total < due:
                if self._stopping.is_set():
                    return
                time.sleep(_POLL)
            try:
                self._act(turn)
            except (rospy.ServiceException, rospy.ROSException, AssertionError) as error:
                if self._stopping.is_set():
                    return
                self.failed += 1
                if len(self.failures) < 5:
                    self.failures.append("%s %d: %s" % (self.name, turn, error))
            self.done += 1


class Work:
    """The actions of the clients.

    Parameters
    ----------
    urdf : str
        Text of the robot that some of the spawned models are.
    """

    def __init__(self, urdf):
        self._urdf = urdf

    def spawn_and_delete(self, turn):
        """Spawn a crate, or every fifth time a robot with a laser and a drive, outside the arena; delete it again."""
        rng = random.Random(turn)
        name, robot = "guest%d" % (turn % 7), turn % 5 == 4
        pose = Pose(Point(rng.uniform(30.0, 60.0), rng.uniform(-30.0, 30.0), 0.3), Quaternion(0.0, 0.0, 0.0, 1.0))
        kind = "spawn_urdf_model" if robot else "spawn_sdf_model"
        answer = call(kind, name, self._urdf if robot else _CRATE, name, pose, "")
        assert answer.success, answer.status_message
        answer = call("delete_model", name)
        assert answer.success, answer.status_message

    @staticmethod
    def reset_world(_):
        """Reset the robot to its initial pose."""
        call("reset_world")

    @staticmethod
    def ask(turn):
        """Call the query services one after the other."""
        asked = (("get_world_properties",), ("get_model_state", "wanderer", "world"),
                 ("get_link_state", "wanderer::base_link", "world"), ("get_model_properties", "wanderer"),
                 ("get_link_properties", "wanderer::left_wheel"), ("get_joint_properties", "left_joint"),
                 ("get_physics_properties",))
        answer = call(*asked[turn % len(asked)])
        assert answer.success, answer.status_message

    @staticmethod
    def push(turn):
        """Apply a force to the robot, and clear it."""
        call("apply_body_wrench", "wanderer::base_link", "", Point(), Wrench(Vector3(1.0, 0.0, 0.0), Vector3()),
             rospy.Time(), rospy.Duration(0, 500000000))
        call("clear_body_wrenches", "wanderer::base_link")
        call("apply_joint_effort", "left_joint", 0.1, rospy.Time(), rospy.Duration(0, 500000000))

    @staticmethod
    def move(turn):
        """Rotate the robot on the spot."""
        state = call("get_model_state", "wanderer", "world")
        state.pose.position.z = 0.1
        answer = call("set_model_state", ModelState("wanderer", state.pose, Twist(), "world"))
        assert answer.success, answer.status_message
        call("set_link_state", LinkState("wanderer::base_link", state.pose, Twist(), "world"))

    @staticmethod
    def pause(_):
        """Pause briefly."""
        call("pause_physics")
        call("unpause_physics")

    @staticmethod
    def has_map():
        """Return whether the mapper has a map; raises rospy.ServiceException before its first one."""
        return bool(rospy.ServiceProxy("/dynamic_map", GetMap)().map.data)

    @staticmethod
    def get_map(_):
        """Ask the mapper for its map."""
        assert Work.has_map(), "an empty map"
