# SPDX-License-Identifier: BSD-3-Clause
"""The world and the robot of the benchmark, as SDF text.

A walled square with boxes and cylinders, by default 60 obstacles in 24 m; a robot of 5.4 kg with two wheels, two
frictionless casters and a laser of 180 degrees, that drives a circle.  The square is larger for more obstacles; many
robots are in a block with space for the circle of each.
"""
from __future__ import annotations

import math
import random
from typing import List, Sequence, Tuple

LINEAR, ANGULAR = 0.5, 1.0                  # m/s, rad/s: a circle of half a metre
WHEEL_RADIUS, TRACK = 0.1, 0.3              # m
SCAN_RATE, RANGE_MAX = 20.0, 10.0           # Hz, m
OBSTACLES, SIDE = 60, 24.0                  # the reference case

_SPACING = 2.2          # m between the circles of two robots
_CLEARANCE = 1.0        # m round the middle of a circle that no obstacle reaches into
_TRIES = 1000

_INERTIAL = ("<inertial><mass>%g</mass><inertia><ixx>%g</ixx><iyy>%g</iyy><izz>%g</izz>"
             "<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>")
_COLLISION = '<collision name="%s"><pose>%g %g %g 0 0 0</pose><geometry>%s</geometry>%s</collision>'
_BOX = "<box><size>%g %g %g</size></box>"
_CYLINDER = "<cylinder><radius>%g</radius><length>%g</length></cylinder>"
_SLIPPERY = "<surface><friction><ode><mu>0</mu><mu2>0</mu2></ode></friction></surface>"
_QUARTER_TURN = 0.5 * math.pi

_DRIVE = """
  <plugin name="drive" filename="libgazebo_ros_diff_drive.so">
    <leftJoint>left</leftJoint><rightJoint>right</rightJoint>
    <wheelSeparation>%g</wheelSeparation><wheelDiameter>%g</wheelDiameter><wheelTorque>5</wheelTorque>
    <updateRate>30</updateRate><commandTopic>cmd_vel</commandTopic><odometryTopic>odom</odometryTopic>
    <odometrySource>world</odometrySource>
  </plugin>
  <plugin name="joints" filename="libgazebo_ros_joint_state_publisher.so">
    <jointName>left, right</jointName><updateRate>30</updateRate>
  </plugin>"""


def robot_sdf(beams: int = 720) -> str:
    """Return the robot as an SDF document with its plugins; the laser is in front, low enough to hit other robots."""
    scan = ('<sensor name="laser" type="ray"><pose>0.27 0 0.02 0 0 0</pose><update_rate>%g</update_rate><ray><scan>'
            "<horizontal><samples>%d</samples><min_angle>%r</min_angle><max_angle>%r</max_angle></horizontal></scan>"
            "<range><min>0.1</min><max>%g</max></range>"
            "<noise><type>gaussian</type><mean>0</mean><stddev>0.01</stddev></noise></ray>"
            '<plugin name="scan" filename="libgazebo_ros_laser.so"><topicName>scan</topicName>'
            "<frameName>laser</frameName></plugin></sensor>"
            % (SCAN_RATE, beams, -_QUARTER_TURN, _QUARTER_TURN, RANGE_MAX))
    casters = "".join(_COLLISION % (name, x, 0.0, -0.05, "<sphere><radius>0.05</radius></sphere>", _SLIPPERY)
                      for name, x in (("front", 0.2), ("back", -0.2)))
    chassis = ('<link name="chassis">%s%s%s%s</link>'
               % (_INERTIAL % (5.0, 0.0395, 0.1062, 0.1417),
                  _COLLISION % ("body", 0.0, 0.0, 0.0, _BOX % (0.5, 0.3, 0.07), ""), casters, scan))
    wheels = "".join(
        '<link name="%s"><pose>0 %g 0 %r 0 0</pose>%s%s</link><joint name="%s" type="revolute"><parent>chassis</parent>'
        "<child>%s</child><axis><xyz>0 0 1</xyz></axis></joint>"
        % (name, y, -_QUARTER_TURN, _INERTIAL % (0.2, 0.000527, 0.000527, 0.001),
           _COLLISION % ("rim", 0.0, 0.0, 0.0, _CYLINDER % (WHEEL_RADIUS, 0.04), ""), name, name)
        for name, y in (("left", 0.5 * TRACK), ("right", -0.5 * TRACK)))
    return ('<sdf version="1.6"><model name="robot">%s%s%s</model></sdf>'
            % (chassis, wheels, _DRIVE % (TRACK, 2.0 * WHEEL_RADIUS)))


def robot_places(robots: int) -> List[Tuple[float, float, float]]:
    """Return the start positions ``[(x, y, z), ...]`` [m]: heading +x, with space for a circle on the left."""
    columns = math.ceil(math.sqrt(robots))
    rows = -(-robots // columns)
    return [((index % columns - 0.5 * (columns - 1)) * _SPACING,
             (index // columns - 0.5 * (rows - 1)) * _SPACING - LINEAR / ANGULAR, WHEEL_RADIUS)
            for index in range(robots)]


def side_of(obstacles: int, robots: int) -> float:
    """Return the side [m] of a square for some obstacles and robots, at the density of the reference.

    Parameters
    ----------
    obstacles : int
        Their number, the four walls included.
    robots : int
        Their number.
    """
    block = math.ceil(math.sqrt(robots)) * _SPACING
    return max(SIDE * math.sqrt(max(obstacles, 1) / OBSTACLES), block + 6.0)


def _model(name: str, pose: Tuple[float, float, float, float], geometry: str) -> str:
    return ('<model name="%s"><static>true</static><pose>%r %r %r 0 0 %r</pose><link name="link">'
            '<collision name="shape"><geometry>%s</geometry></collision></link></model>'
            % ((name,) + pose + (geometry,)))


def world_sdf(obstacles: int = OBSTACLES, robots: int = 1, seed: int = 1) -> str:
    """Return the world as an SDF document, without the robots.

    Parameters
    ----------
    obstacles : int
        How many, the four walls included.
    robots : int
        Their number; their places are left free, see :func:`robot_places`.
    seed : int
        Of the places and sizes.

    Raises
    ------
    ValueError
        If the robots leave no place for the obstacles.
    """
    draw, side = random.Random(seed), side_of(obstacles, robots)
    half = 0.5 * side
    centres = [(x, y + LINEAR / ANGULAR) for x, y, _ in robot_places(robots)]
    wall_x, wall_y = _BOX % (0.2, side, 2.0), _BOX % (side, 0.2, 2.0)
    models = [_model("wall%d" % index, (x, y, 1.0, 0.0), box) for index, (x, y, box) in enumerate(
        ((half, 0.0, wall_x), (-half, 0.0, wall_x), (0.0, half, wall_y), (0.0, -half, wall_y)))][:obstacles]
    for index in range(len(models), obstacles):
        if index % 2:
            radius = draw.uniform(0.1, 0.5)
            shape = _CYLINDER % (radius, 1.0)
        else:
            size = draw.uniform(0.2, 1.5), draw.uniform(0.2, 1.5)
            radius, shape = 0.5 * math.hypot(*size), _BOX % (size + (1.0,))
        x, y = _free_place(draw, half, centres, radius)
        models.append(_model("obstacle%d" % index, (x, y, 0.5, draw.uniform(-math.pi, math.pi)), shape))
    return ('<sdf version="1.6"><world name="benchmark"><model name="ground"><static>true</static><link name="link">'
            '<collision name="plane"><geometry><plane><normal>0 0 1</normal><size>%g %g</size></plane></geometry>'
            "</collision></link></model>%s</world></sdf>" % (side, side, "".join(models)))


def _free_place(draw: random.Random, half: float, centres: Sequence[Tuple[float, float]],
                radius: float) -> Tuple[float, float]:
    reach = (radius + _CLEARANCE) ** 2
    for _ in range(_TRIES):
        x, y = draw.uniform(-half, half), draw.uniform(-half, half)
        if all((x - cx) ** 2 + (y - cy) ** 2 > reach for cx, cy in centres):
            return x, y
    raise ValueError("no free place for an obstacle of %.2f m radius among %d robots in %.1f m"
                     % (radius, len(centres), 2.0 * half))
