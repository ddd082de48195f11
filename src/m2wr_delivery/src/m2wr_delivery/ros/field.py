# SPDX-License-Identifier: BSD-3-Clause
"""Puts a field into the simulator: ground, walls, parcels and robots."""
from __future__ import annotations

from typing import TYPE_CHECKING

import rospy
from geometry_msgs.msg import Pose
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from gazebo_msgs.srv import SpawnModel
from m2wr_campaign.ros.ground import spawn_ground
from m2wr_delivery.scenario import CHARGER_REACH, WALL
from m2wr_delivery.study.run import DROP, wall_poses
from m2wr_sim.geometry import quaternion_from_rpy

if TYPE_CHECKING:
    from m2wr_delivery.scenario import Scenario

PARCEL = 0.2                # m, of a side
_BOX = """<sdf version="1.6"><model name="{name}"><static>true</static><link name="link">{collision}
<visual name="visual"><geometry><box><size>{size}</size></box></geometry>
<material><ambient>{colour} 1</ambient><diffuse>{colour} 1</diffuse></material></visual></link></model></sdf>"""
_COLLISION = "<collision name=\"collision\"><geometry><box><size>{}</size></box></geometry></collision>"


def pose_of(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    """Return a message of a pose.

    Parameters
    ----------
    x, y, z, yaw : float
        [m], [rad]
    """
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = x, y, z
    turn = quaternion_from_rpy(0.0, 0.0, yaw)
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = turn
    return pose


def _spawn(kind: str, name: str, text: str, pose: Pose, namespace: str = "") -> None:
    done = rospy.ServiceProxy("/gazebo/spawn_{}_model".format(kind), SpawnModel)(name, text, namespace, pose, "world")
    if not done.success:
        raise ValueError("{} was not spawned: {}".format(name, done.status_message))


def spawn(scenario: Scenario, description: str) -> None:
    """Put everything into a simulation that is paused.

    Parameters
    ----------
    scenario : Scenario
    description : str
        URDF of the robots, with topics relative to their namespaces.

    Raises
    ------
    ValueError
        If something was not spawned.
    """
    spawn_ground(scenario.grid, scenario.heights, "ground")
    for number, (wall, (place, _)) in enumerate(zip(scenario.walls, wall_poses(scenario))):
        size = "{:g} {:g} {:g}".format(wall.length, WALL[0], 2.0 * WALL[1])
        _spawn("sdf", "wall%d" % (number + 1), _BOX.format(
            name="wall", size=size, colour="0.6 0.35 0.2", collision=_COLLISION.format(size)),
            pose_of(place[0], place[1], place[2], wall.yaw))
    for parcel in scenario.parcels:
        size = "{0:g} {0:g} {0:g}".format(PARCEL)
        _spawn("sdf", parcel.name, _BOX.format(name="parcel", size=size, colour="0.9 0.6 0.1", collision=""),
               pose_of(*parcel.pick_up, scenario.height_at(parcel.pick_up) + 0.5 * PARCEL))
    for name, (x, y, yaw) in scenario.starts.items():
        _spawn("urdf", name, description, pose_of(x, y, DROP, yaw), name)


def markers(scenario: Scenario) -> MarkerArray:
    """Return the places with their names, and the charger, for rviz.

    Parameters
    ----------
    scenario : Scenario
    """
    found = MarkerArray()
    places = dict(scenario.places, base=(0.0, 0.0))
    for number, (name, (x, y)) in enumerate(sorted(places.items())):
        high = scenario.height_at((x, y))
        radius = CHARGER_REACH if name == "base" else 0.5
        disc = Marker(ns="places", id=number, type=Marker.CYLINDER, pose=pose_of(x, y, high),
                      color=ColorRGBA(0.2, 0.5, 0.9, 0.4))
        disc.scale.x = disc.scale.y = 2.0 * radius
        disc.scale.z = 0.02
        text = Marker(ns="names", id=number, type=Marker.TEXT_VIEW_FACING, text=name, pose=pose_of(x, y, high + 0.9),
                      color=ColorRGBA(1.0, 1.0, 1.0, 1.0))
        text.scale.z = 0.5
        found.markers += [disc, text]
    for marker in found.markers:
        marker.header.frame_id = "world"
    return found
