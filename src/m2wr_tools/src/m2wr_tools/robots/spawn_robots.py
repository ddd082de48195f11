# SPDX-License-Identifier: BSD-3-Clause
"""The command ``spawn_robots``: adds N copies of a robot to a running simulation, each in its own namespace."""
from __future__ import annotations

import argparse
import os
import time
from typing import List, Optional, Sequence, Tuple

import rospkg
import rospy
from geometry_msgs.msg import Pose, TransformStamped
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage

from gazebo_msgs.srv import GetWorldProperties, SpawnModel
from m2wr_node.ros.starting import start_node
from m2wr_sim.errors import WorldError
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.ros.convert import write_pose
from m2wr_sim.ros.shared_files import find_world, model_folders
from m2wr_sim.ros.spawn_client import SpawnError, wait_for_service
from m2wr_tools.robots.free_places import LAYOUTS, find_places


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="spawn_robots", formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        description="Add copies of a robot to a running simulation: NAME1, NAME2, ... in namespaces of these names.")
    parser.add_argument("--robots", type=int, default=3, metavar="N", help="number of robots")
    parser.add_argument("--name", default="robot", help="name of the robots, without their numbers")
    parser.add_argument("--first", type=int, default=1, metavar="K", help="number of the first robot")
    parser.add_argument("--param", default="robot_description", help="parameter with their description")
    parser.add_argument("--world", default="", help="world file to find free places; default: the simulation's")
    parser.add_argument("--layout", choices=LAYOUTS, default="grid", help="square grid, rings, or random places")
    parser.add_argument("--x", type=float, default=0.0, help="centre of the robots [m]")
    parser.add_argument("--y", type=float, default=0.0, help="centre of the robots [m]")
    parser.add_argument("--z", type=float, default=0.1, help="height of the robots' frames [m]")
    parser.add_argument("--yaw", type=float, default=0.0, help="heading, for the grid [rad]")
    parser.add_argument("--spacing", type=float, default=1.2, help="minimum distance between two robots [m]")
    parser.add_argument("--radius", type=float, default=0.45, help="radius without obstacles around each robot [m]")
    parser.add_argument("--seed", type=int, default=0, help="seed of the random layout")
    parser.add_argument("--odom-frame", default="odom", help="robots' odometry frame, without prefix")
    parser.add_argument("--world-frame", default="none", help="fixed frame, parent of the odometry frames, or none")
    parser.add_argument("--unpause", action="store_true", help="continue the simulation when all are spawned")
    parser.add_argument("--gazebo-namespace", default="/gazebo", help="where the simulation's services are")
    return parser


def places_in(arguments: argparse.Namespace) -> List[Tuple[float, float, float]]:
    """Find the robots' places in the world that the simulation has loaded.

    Raises
    ------
    SpawnError
        If the world cannot be read, or has too few places.
    """
    parameter = arguments.gazebo_namespace.rstrip("/") + "/world"
    name = arguments.world or rospy.get_param(parameter, "")
    if not name:
        raise SpawnError("parameter %s is not set: name the world file with --world" % parameter)
    folder = rospkg.RosPack().get_path("m2wr_sim")
    folders = model_folders(folder)
    try:
        world = load_world(find_world(name, os.path.join(folder, "worlds")), resolve_model=folders)
        return find_places(world, arguments.robots, arguments.layout, (arguments.x, arguments.y), arguments.spacing,
                           arguments.radius, arguments.yaw, arguments.seed)
    except (ValueError, WorldError) as error:
        raise SpawnError("no places for the robots: %s" % error) from error


def spawn_all(arguments: argparse.Namespace, names: List[str], places: Sequence[Tuple[float, float, float]]) -> None:
    """Add the robots to the simulation.

    Parameters
    ----------
    arguments : argparse.Namespace
        The parsed command line.
    names : list of str
        Of the robots.
    places : sequence of (float, float, float)
        x, y [m] and yaw [rad] of each robot in world.

    Raises
    ------
    SpawnError
        If there is no description, a name is taken, or the simulation refuses.
    """
    text = rospy.get_param(arguments.param, None)
    if not isinstance(text, str) or not text.strip():
        raise SpawnError("parameter %s holds no description; load it first" % arguments.param)
    root = arguments.gazebo_namespace.rstrip("/")
    wait_for_service(root + "/spawn_urdf_model")
    kind = "urdf" if "<robot" in text else "sdf"
    taken = set(names) & set(rospy.ServiceProxy(root + "/get_world_properties", GetWorldProperties)().model_names)
    if taken:
        raise SpawnError("already in the world: %s; choose another --name or --first" % ", ".join(sorted(taken)))
    service = rospy.ServiceProxy("%s/spawn_%s_model" % (root, kind), SpawnModel, persistent=True)
    try:
        for name, (x, y, yaw) in zip(names, places):
            pose = Pose()
            write_pose(pose, (x, y, arguments.z), quaternion_from_rpy(0.0, 0.0, yaw))
            answer = service(name, text, "/" + name, pose, "")
            if not answer.success:
                raise SpawnError("%s was not spawned: %s" % (name, answer.status_message))
    finally:
        service.close()


def hang_on(world_frame: str, odom_frame: str, names: List[str]) -> rospy.Publisher:
    """Publish the world as parent of each robot's odometry frame; Gazebo's odometry is a pose in the world.

    Parameters
    ----------
    world_frame : str
        Name of the world's frame.
    odom_frame : str
        Name of the odometry frames, without prefix.
    names : list of str
        Of the robots.

    Returns
    -------
    rospy.Publisher
        Of the latched topic.
    """
    transforms = []
    for name in names:
        transform = TransformStamped()
        transform.header.stamp, transform.header.frame_id = rospy.Time.now(), world_frame
        prefix = rospy.get_param("/%s/tf_prefix" % name, "").strip("/")
        transform.child_frame_id = "/".join(part for part in (prefix, odom_frame) if part)
        transform.transform.rotation.w = 1.0
        transforms.append(transform)
    publisher = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    publisher.publish(TFMessage(transforms))
    return publisher


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return the exit code. If it publishes frames, it runs until it is stopped."""
    arguments = make_parser().parse_args(rospy.myargv(argv)[1:])
    start_node("spawn_robots", anonymous=True, disable_rostime=True)
    rospy.rostime.switch_to_wallclock()     # must not hang while the simulation is paused
    names = ["%s%d" % (arguments.name, arguments.first + k) for k in range(arguments.robots)]
    try:
        places = places_in(arguments)
        started = time.monotonic()
        spawn_all(arguments, names, places)
        rospy.loginfo("%d robots (%s ... %s) added within %.1f s", len(names), names[0], names[-1],
                      time.monotonic() - started)
        wanted = arguments.world_frame not in ("", "none")
        frames = hang_on(arguments.world_frame, arguments.odom_frame, names) if wanted else None
        if arguments.unpause:
            rospy.ServiceProxy(arguments.gazebo_namespace.rstrip("/") + "/unpause_physics", Empty)()
    except (SpawnError, rospy.ServiceException) as error:
        if not rospy.is_shutdown():
            rospy.logfatal("%s", error)
        return 1
    except rospy.ROSException as error:
        if not rospy.is_shutdown():
            rospy.logfatal("the simulation does not answer: %s", error)
        return 1
    if frames is not None:
        rospy.spin()
    return 0
