# SPDX-License-Identifier: BSD-3-Clause
"""``<actor>`` of SDF -> Model with a script. Skin and animation are not drawn: a cylinder stands for the person."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Dict, Iterator, List, Optional, Tuple

from m2wr_sim.geometry import IDENTITY, compose, invert, normalise_quaternion, quaternion_from_rpy, yaw_of
from m2wr_sim.model.sdf.frames import raw_pose
from m2wr_sim.model.sdf.model import SdfContext, read_model
from m2wr_sim.model.types import (
    ActorScript,
    Collision,
    Cylinder,
    Link,
    Mesh,
    MeshFile,
    Model,
    Plane,
    Trajectory,
    Visual,
)
from m2wr_sim.model.xml.safe import XmlError, parse_float
from m2wr_sim.physics.engine import FARTHEST

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.sdf.node import Node

#: Of the cylinder for a person: half the breadth of the shoulders, and the height, of the median man (DIN 33402-2).
RADIUS, HEIGHT = 0.25, 1.75             # m
LONGEST = 1e9                           # s, latest time of a way point: thirty years
MOST_POINTS = 100000                    # way points of an actor


def read_actor(node: Node, context: SdfContext) -> Model:
    """Read one ``<actor>``.

    Parameters
    ----------
    node : Node
    context : SdfContext

    Returns
    -------
    Model
        Static, as in Gazebo, with its ``script``. Without a delay its pose is the first way point.

    Raises
    ------
    XmlError
        If it has no name, or too many way points. A way point, trajectory or link that cannot be used is left out with
        a warning.
    """
    script_node, skin = node.child("script"), node.child("skin")
    script = _read_script(script_node) if script_node else None
    has_skin, has_pose = bool(skin), node.has("pose")
    for tag in ("filename", "scale"):
        skin.text(tag)
    model = read_model(node, context, static=True)
    if model.joints:
        node.notes.add("{}: joints of an <actor> are not simulated: its links keep their places.".format(node.line),
                       ("actor", "joint"))
    pose = model.pose
    if script is not None and script.trajectories and script.auto_start and (script.delay == 0.0 or not has_pose):
        pose = script.trajectories[0].poses[0]
    links = tuple(_with_collisions(link) for link in model.links)
    if has_skin:
        node.notes.add("{}: skin and animation of an <actor> are not drawn; a cylinder, {:g} m wide and {:g} m high, "
                       "stands for it.".format(node.line, 2.0 * RADIUS, HEIGHT), ("actor", "skin"))
        if not any(link.collisions for link in links):
            links += (_stand_in(model.name, pose),)
    return replace(model, links=links, joints=(), pose=pose, script=script)


def _stand_in(name: str, pose: Pose) -> Link:
    """Return an upright cylinder on the ground at a pose of the actor; the link has the name that Gazebo gives it."""
    upright = ((pose[0][0], pose[0][1], 0.5 * HEIGHT), quaternion_from_rpy(0.0, 0.0, yaw_of(pose[1])))
    shape = Cylinder(RADIUS, HEIGHT)
    return Link(name + "_pose", pose=compose(invert(pose), upright), collisions=(Collision("person", shape),),
                visuals=(Visual("person", shape, rgba=(0.8, 0.5, 0.2, 1.0)),))


def _with_collisions(link: Link) -> Link:
    """Return a link whose visuals collide, if it has nothing else that does: lasers here see collisions only."""
    if link.collisions:
        return link
    return replace(link, collisions=tuple(
        Collision(visual.name, visual.geometry, visual.pose) for visual in link.visuals
        if not isinstance(visual.geometry, (Plane, Mesh, MeshFile))))


def _read_script(node: Node) -> Optional[ActorScript]:
    found: List[Tuple[int, Trajectory]] = []
    points = 0
    for number, child in enumerate(node.children("trajectory")):
        points += len(child.children("waypoint"))
        if points > MOST_POINTS:
            node.fail("up to here there are {} way points".format(points), "at most {}".format(MOST_POINTS))
        trajectory = node.notes.attempt("this trajectory", _read_trajectory, child)
        if trajectory is None:
            child.ignore()
        else:
            found.append((_number(child, number), trajectory))
    found.sort(key=lambda pair: pair[0])            # stable, as in Gazebo
    delay = node.number("delay_start", 0.0, least=0.0)
    return ActorScript(tuple(trajectory for _, trajectory in found), node.flag("loop", True), min(delay, LONGEST),
                       node.flag("auto_start", True))


def _number(node: Node, default: int) -> int:
    """Return the attribute ``id``."""
    text = node.attribute("id")
    try:
        return int(text) if text else default
    except ValueError:
        node.notes.add('{}: id is "{}"; expected a whole number; using {}.'.format(node.place, text[:60], default))
        return default


def _read_trajectory(node: Node) -> Trajectory:
    points: Dict[float, Pose] = {}
    times: List[float] = []
    for time, pose in _way_points(node):
        if time in points:
            node.notes.add("{}: two way points at {:g} s; the last one counts.".format(node.place, time))
        points[time] = pose
        times.append(time)
    if times != sorted(times):
        node.notes.add("{}: way points are not sorted by time; they are taken in the order of time.".format(node.place))
    if not points:
        node.fail("there is no usable <waypoint>", "at least one, with <time> and <pose>")
    if len(points) == 1:
        node.notes.add("{}: one way point only: the actor stays there.".format(node.place))
    times = sorted(points)
    return Trajectory(node.attribute("type"), tuple(times), tuple(points[time] for time in times), _tension(node))


def _tension(node: Node) -> float:
    text = node.attribute("tension")
    if not text:
        return 0.0
    try:
        value = parse_float(node.element, text, "tension")
    except XmlError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        node.notes.add('{}: tension is "{}"; expected a number from 0 to 1; using 0.'.format(node.place, text[:60]))
        return 0.0
    return value


def _way_points(node: Node) -> Iterator[Tuple[float, Pose]]:
    """Yield time and pose of the way points that can be used; the others are left out with a warning."""
    for child in node.children("waypoint"):
        found = node.notes.attempt("this way point", _way_point, child)
        if found is None:
            child.ignore()
        else:
            yield found


def _way_point(node: Node) -> Tuple[float, Pose]:
    time, = node.strict_vector("time", 1, (0.0,))
    if not 0.0 <= time <= LONGEST:
        node.fail("time is {:g}".format(time), "0 to {:g} s".format(LONGEST))
    node.strict_vector("pose", 6, (0.0,) * 6)
    pose = raw_pose(node)[0] if node.has("pose") else IDENTITY
    if not all(abs(value) <= FARTHEST for value in pose[0]):
        node.fail("the position is {}".format(pose[0]), "at most {:g} m from the origin".format(FARTHEST))
    return time, (pose[0], normalise_quaternion(pose[1]))
