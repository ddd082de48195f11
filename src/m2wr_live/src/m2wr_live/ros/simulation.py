# SPDX-License-Identifier: BSD-3-Clause
"""What pages ask of a simulation, through Gazebo's services; and commands on topics."""
from __future__ import annotations

import math
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Tuple, TypeVar

import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from std_srvs.srv import Empty, Trigger

from gazebo_msgs.srv import GetPhysicsProperties, SetPhysicsProperties, SpawnModel
from m2wr_live.ros import worlds
from m2wr_live.ros.recorder import Recorder
from m2wr_live.web.actions import PLACEABLE, Actions, ModelPose
from m2wr_live.web.requests import Drive
from m2wr_sim.errors import SimError
from m2wr_sim.ros.shared_files import model_folders, package_folder
from m2wr_tools.obstacles.obstacle import Obstacle
from m2wr_tools.obstacles.world import World
from m2wr_tools.service_client import Connection
from m2wr_view.errors import ViewError

SILENCE = 0.5               # s without a message of the page after which the robot is stopped
CONNECTS = 1.0              # s in which a subscriber that has just started has connected
FASTEST = 1000.0            # greatest real-time factor
SCALES = (0.1, 10.0)        # of placed obstacles
MOST_TOPICS = 100           # on which pages may drive
MOST_MODELS = 300           # in the list of a page
NOT_PLACED = (worlds.GROUND, "sun")     # every world has them
_GOAL = "/move_base_simple/goal"
_Result = TypeVar("_Result")


class Simulation(Actions):
    """A simulation behind Gazebo's services; one call at a time.

    Parameters
    ----------
    namespace : str
        Of the services.
    """

    def __init__(self, namespace: str = "/gazebo") -> None:
        self._root, self._world = namespace.rstrip("/"), World(namespace)
        self._lock = threading.Lock()
        self._goals = rospy.Publisher(_GOAL, PoseStamped, queue_size=1)
        self._paused: Optional[bool] = None
        self._factor: Optional[float] = None
        self._models: Optional[List[str]] = None
        self.recorder = Recorder()

    def _safely(self, action: Callable[[], _Result]) -> _Result:
        try:
            with self._lock:
                return action()
        except SimError as error:
            raise ViewError(str(error)) from error

    def _call(self, name: str, kind: Any, *fields: object) -> Any:
        connection = Connection("%s/%s" % (self._root, name), kind)
        try:
            return connection(*fields)
        finally:
            connection.close()

    def pause(self) -> None:
        self._safely(lambda: self._call("pause_physics", Empty))
        self._paused = True

    def resume(self) -> None:
        self._safely(lambda: self._call("unpause_physics", Empty))
        self._paused = False

    def step(self) -> None:
        answer = self._safely(lambda: self._call("step", Trigger))
        if not answer.success:
            raise ViewError(answer.message)

    def reset(self) -> None:
        self._safely(lambda: self._call("reset_world", Empty))

    def set_factor(self, factor: float) -> None:
        if not 0.0 <= factor <= FASTEST:
            raise ViewError("real-time factor %r; expected 0 to %g" % (factor, FASTEST))

        def change() -> None:
            now = self._call("get_physics_properties", GetPhysicsProperties)
            answer = self._call("set_physics_properties", SetPhysicsProperties, now.time_step, factor / now.time_step,
                                now.gravity, now.ode_config)
            if not answer.success:
                raise ViewError(answer.status_message)
            self._factor = factor
        self._safely(change)

    def factor(self) -> Optional[float]:
        return self._factor

    def place(self, kind: str, position: Tuple[float, float, float], yaw: float, scale: float) -> str:
        if kind not in PLACEABLE or not SCALES[0] <= scale <= SCALES[1]:
            raise ViewError("a %s of size %r; expected one of %s, and %g to %g" % (
                (kind, scale, ", ".join(PLACEABLE)) + SCALES))
        shape, size = PLACEABLE[kind]
        return self._safely(lambda: self._world.add(Obstacle(shape, tuple(scale * side for side in size)),
                                                    position, yaw))

    def models(self) -> List[str]:
        if self._models is None:        # all packages are read for it
            names = model_folders(package_folder()).names(MOST_MODELS)
            self._models = [name for name in names if name not in NOT_PLACED]
        return self._models

    def place_model(self, model: str, position: Tuple[float, float, float], yaw: float) -> str:
        if model not in self.models():
            raise ViewError("model %r; expected one that the list offers" % model[:60])
        return self._safely(lambda: self._world.add_model(model, position, yaw))

    def model_pose(self, name: str) -> ModelPose:
        position, quaternion = self._safely(lambda: self._world.pose(name))
        return ModelPose(position, quaternion)

    def move(self, name: str, x: float, y: float, z: float, yaw: float) -> None:
        self._safely(lambda: self._world.move(name, (x, y, z), yaw))

    def delete(self, name: str) -> None:
        self._safely(lambda: self._world.delete(name))

    def goal(self, x: float, y: float, frame: str) -> None:
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ViewError("goal (%s, %s): expected finite numbers" % (x, y))
        deadline = time.monotonic() + CONNECTS
        while not self._goals.get_num_connections():        # a controller that has just started connects soon
            if time.monotonic() > deadline:
                raise ViewError("nothing listens to %s: start a controller that takes goals, such as bug2.py" % _GOAL)
            time.sleep(0.02)
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = frame, rospy.Time(0)
        message.pose.position.x, message.pose.position.y, message.pose.orientation.w = x, y, 1.0
        self._goals.publish(message)

    def worlds(self) -> List[str]:
        return worlds.names()

    def load_world(self, name: str) -> None:
        models = worlds.models_of(name)

        def replace() -> None:
            self._call("reset_world", Empty)
            for old in self._world.names():
                if old != worlds.GROUND and self._world.kind_of(old)[0] != "robot":
                    self._world.delete(old)
            there = set(self._world.names())
            for model in models:
                if model.name not in there:
                    answer = self._call("spawn_sdf_model", SpawnModel, model.name, model.sdf, "", model.pose, "")
                    if not answer.success:
                        raise ViewError("world %s: %s" % (name, answer.status_message))
        self._safely(replace)

    def record(self) -> None:
        self.recorder.start()

    def stop_recording(self) -> None:
        self.recorder.stop()

    def recording(self) -> Optional[float]:
        return self.recorder.seconds()

    def bag(self) -> bytes:
        return self.recorder.bag()

    def film(self) -> bytes:
        return self.recorder.film()

    def paused(self) -> Optional[bool]:
        return self._paused

    def ask_settings(self) -> None:
        """Ask the simulation whether it is paused, and for its real-time factor; blocks until it answers."""
        def ask() -> None:
            now = self._call("get_physics_properties", GetPhysicsProperties)
            self._paused, self._factor = bool(now.pause), now.max_update_rate * now.time_step
        try:
            self._safely(ask)
        except ViewError:
            self._paused = None


class Driver:
    """Publishes what pages drive, and stops a robot whose page says nothing any more.

    Parameters
    ----------
    linear : float
        Greatest speed [m/s].
    angular : float
        Greatest rate of turn [rad/s].
    """

    def __init__(self, linear: float, angular: float) -> None:
        self._linear, self._angular = linear, angular
        self._publishers: Dict[str, Any] = {}
        self._heard: Dict[str, float] = {}
        self._lock = threading.Lock()
        self.topics: List[str] = []
        self.others: Dict[str, str] = {}        # topic -> another node that publishes on it

    def find(self, node: str) -> None:
        """Look for topics with velocities to which a node other than this one listens.

        Parameters
        ----------
        node : str
            Name of this node.
        """
        master = rosgraph.Master(node)
        try:
            kinds = dict(master.getTopicTypes())
            published, subscribed, _ = master.getSystemState()
        except (rosgraph.MasterException, OSError):
            return
        self.topics = sorted(topic for topic, nodes in subscribed if set(nodes) - {node}
                             and kinds.get(topic) == "geometry_msgs/Twist")[:MOST_TOPICS]
        drivers = {topic: sorted(set(nodes) - {node}) for topic, nodes in published if topic in self.topics}
        self.others = {topic: nodes[0][:60] for topic, nodes in drivers.items() if nodes}
        for topic in self.topics:
            if topic not in self._publishers:
                self._publishers[topic] = rospy.Publisher(topic, Twist, queue_size=1, tcp_nodelay=True)

    def drive(self, asked: Drive) -> None:
        """Publish what a page asks for.

        Raises
        ------
        ViewError
            If nothing listens to the topic.
        """
        publisher = self._publishers.get(asked.topic) if asked.topic in self.topics else None
        if publisher is None:
            raise ViewError("nothing listens to the topic %r; pages may drive on %s" % (
                asked.topic[:100], ", ".join(self.topics) or "no topic"))
        message = Twist()
        message.linear.x, message.angular.z = self._linear * asked.forward, self._angular * asked.left
        with self._lock:
            if asked.forward or asked.left:
                self._heard[asked.topic] = time.monotonic()
            else:
                self._heard.pop(asked.topic, None)
        publisher.publish(message)

    def watch(self) -> None:
        """Stop the robots whose pages have been silent."""
        now = time.monotonic()
        with self._lock:
            silent = [topic for topic, heard in self._heard.items() if now - heard > SILENCE]
            for topic in silent:
                del self._heard[topic]
        for topic in silent:
            self._publishers[topic].publish(Twist())
