# SPDX-License-Identifier: BSD-3-Clause
"""The spawn_model command: the simulation spawns a model from a description. Exit code 2: invalid options."""
import argparse
import math
import os
import re
import sys
import time
from html import escape  # faster to import than xml.sax.saxutils, which imports urllib
from typing import List, Optional

import rospkg
import rospy
from geometry_msgs.msg import Pose
from lxml import etree
from std_srvs.srv import Empty

from gazebo_msgs.msg import ModelStates
from gazebo_msgs.srv import DeleteModel, SetModelConfiguration, SpawnModel
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.user_folder import from_user
from m2wr_sim.angles import quaternion_from_rpy
from m2wr_sim.command_line import without_exponent
from m2wr_sim.model.urdf.xacro_text import expanded
from m2wr_sim.model.xml.lenient import root_tag
from m2wr_sim.model.xml.safe import XmlError

_DATABASE_WORLD = ('<sdf version="1.4"><world name="default"><include><uri>model://%s</uri></include></world></sdf>')
_LONG_WAIT = 60.0          # s of wall time after which waiting for a service is logged as a warning
_NOT_CONFIGURED = "SetModelConfiguration service failed. Exiting."


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(prog="spawn_model", description="Spawn a URDF or SDF model in the simulation.",
                                     add_help=True)
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("-urdf", action="store_true", help="the description is URDF")
    kind.add_argument("-sdf", action="store_true", help="the description is SDF")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("-file", metavar="FILE", help="read the description from a file")
    source.add_argument("-param", metavar="PARAM", help="read the description from a ROS parameter")
    source.add_argument("-database", metavar="MODEL", help="a model found through GAZEBO_MODEL_PATH")
    source.add_argument("-stdin", action="store_true", help="read the description from standard input")
    parser.add_argument("-model", required=True, metavar="NAME", help="name of the model in the simulation")
    parser.add_argument("-reference_frame", default="", metavar="FRAME", help="frame of the initial pose")
    parser.add_argument("-gazebo_namespace", default="/gazebo", metavar="NS",
                        help="namespace of the simulation's services")
    parser.add_argument("-robot_namespace", default=None, metavar="NS", help="namespace of the robot's topics")
    for option, text in (("-x", "position [m]"), ("-y", "position [m]"), ("-z", "position [m]"), ("-R", "roll [rad]"),
                         ("-P", "pitch [rad]"), ("-Y", "yaw [rad]")):
        parser.add_argument(option, type=float, default=0.0, metavar="NUMBER", help=text)
    parser.add_argument("-J", dest="joints", nargs=2, action="append", default=[], metavar=("JOINT", "POSITION"),
                        help="initial joint position; may be repeated")
    parser.add_argument("-package_to_model", action="store_true", help="write model:// for package:// in mesh names")
    parser.add_argument("-b", dest="bond", action="store_true", help="delete the model when this program ends")
    parser.add_argument("-unpause", action="store_true", help="unpause the physics afterwards")
    parser.add_argument("-wait", metavar="MODEL", help="first wait for another model")
    return parser


def parse(argv: List[str]) -> argparse.Namespace:
    """Parse the command line; ``-J`` positions become floats. Invalid options end the program with code 2."""
    parser = make_parser()
    arguments = parser.parse_args([without_exponent(word) for word in argv])
    try:
        arguments.joints = [(name, float(position)) for name, position in arguments.joints]
    except ValueError as error:
        parser.error("-J takes a joint and a number: %s" % error)
    for name in "xyzRPY":
        if not math.isfinite(getattr(arguments, name)):
            parser.error("-%s takes a finite number" % name)
    if arguments.database and not arguments.sdf:
        parser.error("-database goes with -sdf")
    return arguments


class SpawnError(Exception):
    """A request failed; the message says why, ``last_words`` names the failed step."""

    def __init__(self, message: str, last_words: str = "Spawn service failed. Exiting.") -> None:
        super().__init__(message)
        self.last_words = last_words


def read_description(arguments: argparse.Namespace) -> str:
    """Return the text of the description from the source given on the command line.

    Raises
    ------
    SpawnError
        If the source is missing, empty or unreadable.
    """
    if arguments.file:
        if not os.path.exists(arguments.file):      # roslaunch starts this program in another folder
            arguments.file = from_user(arguments.file)
        rospy.loginfo("Loading model XML from file %s", arguments.file)
        try:
            with open(arguments.file, encoding="utf-8") as stream:
                text = stream.read()
            if not text.strip():
                raise SpawnError("Error: file %s is empty" % arguments.file)
            if root_tag(text) == "robot":       # not in the simulator: xacro executes code
                text = expanded(text, arguments.file, rospkg.RosPack().get_path)
        except XmlError as error:
            raise SpawnError("Invalid XML: %s" % error) from error
        except (OSError, UnicodeDecodeError) as error:
            raise SpawnError("Error: cannot read file %s: %s" % (arguments.file, error)) from error
    elif arguments.param:
        rospy.loginfo("Loading model XML from ros parameter %s", arguments.param)
        text = rospy.get_param(arguments.param, None)
        if text is None:
            raise SpawnError("Error: parameter %s is not set; load the description first, for example with "
                             "<param name=\"%s\" command=\"...\"/> in a launch file"
                             % (arguments.param, arguments.param))
        if not isinstance(text, str) or not text.strip():
            raise SpawnError("Error: parameter %s is empty" % arguments.param)
    elif arguments.database:
        rospy.loginfo("Loading model XML from Gazebo Model Database")
        text = _DATABASE_WORLD % escape(arguments.database)
    else:
        rospy.loginfo("Loading model XML from stdin")
        text = sys.stdin.read()
        if not text.strip():
            raise SpawnError("Error: standard input is empty")
    return normalise(text, arguments.package_to_model)


def normalise(text: str, package_to_model: bool = False) -> str:
    """Return XML in ASCII, without declaration and comments.

    Parameters
    ----------
    text : str
        XML.
    package_to_model : bool
        Replace ``package://`` by ``model://`` in the names of meshes.

    Raises
    ------
    SpawnError
        If the text is not well-formed or declares a document type.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=True)
    try:
        root = etree.fromstring(text.encode("utf-8"), parser)
    except etree.XMLSyntaxError as error:
        raise SpawnError("Invalid XML: %s" % error) from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise SpawnError("Invalid XML: it declares a document type; entities are not expanded")
    if package_to_model:
        for mesh in root.iter("mesh"):
            if mesh.get("filename"):
                mesh.set("filename", re.sub(r"^package://", "model://", mesh.get("filename")))
    return etree.tostring(root, encoding="us-ascii").decode("ascii")


def wait_for_model(name: str, namespace: str) -> bool:
    """Wait until a model is in the world.

    Parameters
    ----------
    name : str
        Name of the model.
    namespace : str
        Namespace of the simulation.

    Returns
    -------
    bool
        False if ROS shuts down before.
    """
    seen: List[str] = []

    def store(message: ModelStates) -> None:
        seen[:] = message.name

    topic = namespace.rstrip("/") + "/model_states"
    subscriber = rospy.Subscriber(topic, ModelStates, store)
    try:
        rospy.loginfo("Waiting for model %s before proceeding.", name)
        while name not in seen and not rospy.is_shutdown():
            rospy.logwarn_throttle(5, "no model %s on %s yet" % (name, topic))
            time.sleep(0.05)
    finally:
        subscriber.unregister()
    return name in seen


def wait_for_service(name: str) -> None:
    """Wait for a service; log its name every few seconds."""
    rospy.loginfo("Waiting for service %s", name)
    began = time.monotonic()
    while not rospy.is_shutdown():
        try:
            rospy.wait_for_service(name, timeout=5.0)
            return
        except rospy.ROSException:
            if not rospy.is_shutdown():
                # the simulation may take long to start on a slow machine
                write = rospy.loginfo if time.monotonic() - began < _LONG_WAIT else rospy.logwarn
                write("still waiting for service %s: is the simulation running?", name)
    raise SpawnError("interrupted while waiting for %s" % name)


def spawn(arguments: argparse.Namespace, text: str) -> None:
    """Call the spawn service.

    Parameters
    ----------
    arguments : argparse.Namespace
        Parsed command line.
    text : str
        Description of the model.

    Raises
    ------
    SpawnError
        If the call fails or the simulation refuses the model.
    """
    service = arguments.gazebo_namespace.rstrip("/") + ("/spawn_urdf_model" if arguments.urdf else "/spawn_sdf_model")
    wait_for_service(service)
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = arguments.x, arguments.y, arguments.z
    quaternion = quaternion_from_rpy(arguments.R, arguments.P, arguments.Y)
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = quaternion
    namespace = rospy.get_namespace() if arguments.robot_namespace is None else arguments.robot_namespace
    rospy.loginfo("Calling service %s", service)
    try:
        response = rospy.ServiceProxy(service, SpawnModel)(
            arguments.model, text, namespace, pose, arguments.reference_frame)
    except (rospy.ServiceException, rospy.ROSException) as error:
        raise SpawnError("Service call failed: %s" % error) from error
    rospy.loginfo("Spawn status: %s", response.status_message)
    if not response.success:
        raise SpawnError("Spawn service failed. Exiting.")


def _configure(arguments: argparse.Namespace) -> None:
    """Set the joint positions of ``-J``."""
    time.sleep(1.0)         # as Gazebo's spawn_model: the model's plugins start first
    service = arguments.gazebo_namespace.rstrip("/") + "/set_model_configuration"
    try:
        rospy.wait_for_service(service, timeout=5.0)
        response = rospy.ServiceProxy(service, SetModelConfiguration)(
            arguments.model, "", [name for name, _ in arguments.joints], [position for _, position in arguments.joints])
    except (rospy.ServiceException, rospy.ROSException) as error:
        raise SpawnError("Service call failed: %s" % error, _NOT_CONFIGURED) from error
    rospy.loginfo("Set model configuration status: %s", response.status_message)
    if not response.success:
        raise SpawnError("joint positions were not set: %s" % response.status_message, _NOT_CONFIGURED)


def _unpause(arguments: argparse.Namespace) -> None:
    """Continue the simulation, for ``-unpause``."""
    rospy.loginfo("Unpausing physics")
    service = arguments.gazebo_namespace.rstrip("/") + "/unpause_physics"
    try:
        rospy.wait_for_service(service, timeout=5.0)
        rospy.ServiceProxy(service, Empty)()
    except (rospy.ServiceException, rospy.ROSException) as error:
        raise SpawnError("Unpause physics service call failed: %s" % error, "") from error


def _keep_bond(arguments: argparse.Namespace) -> None:
    """Wait for shutdown, then delete the model."""
    service = arguments.gazebo_namespace.rstrip("/") + "/delete_model"
    proxy = rospy.ServiceProxy(service, DeleteModel)

    def delete() -> None:
        rospy.loginfo("Deleting model %s", arguments.model)
        try:
            proxy(arguments.model)
        except (rospy.ServiceException, rospy.ROSException) as error:
            rospy.logwarn("could not delete %s: %s", arguments.model, error)

    at_shutdown(delete)
    rospy.loginfo("Waiting for shutdown to delete model %s", arguments.model)
    rospy.spin()


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return the exit code."""
    arguments = parse(rospy.myargv(argv)[1:])
    # without ROS time: this program must not block while the simulation is paused or has not started
    start_node("spawn_model", anonymous=True, disable_rostime=True)
    rospy.rostime.switch_to_wallclock()
    try:
        if arguments.wait and not wait_for_model(arguments.wait, arguments.gazebo_namespace):
            return 0
        spawn(arguments, read_description(arguments))
        if arguments.joints:
            _configure(arguments)
        if arguments.unpause:
            _unpause(arguments)
    except SpawnError as error:
        for words in dict.fromkeys((str(error), error.last_words)):
            if words:
                rospy.logerr("%s", words)
        return 1
    except rospy.ROSInterruptException:
        return 1
    if arguments.bond:
        _keep_bond(arguments)
    return 0
