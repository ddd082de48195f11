# SPDX-License-Identifier: BSD-3-Clause
"""URDF text (or raw xacro) -> Model, converted by the rules of Gazebo.

The document is checked (:mod:`.checks`), read (:mod:`.reader`), its fixed joints are merged away
(:mod:`.lumping`), and the ``<gazebo>`` blocks (:mod:`.gazebo_tags`) are applied to what is left.
"""
from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, NoReturn, Optional, Sequence, Set, Tuple, Union

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY, compose, quaternion_from_rpy, rpy_from_quaternion
from m2wr_sim.model.inertials import usable
from m2wr_sim.model.mesh.shapes import MeshReader
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.types import MIMIC_LIBRARY, Collision, Joint, Link, Model, PluginSpec, Visual
from m2wr_sim.model.urdf.checks import attribute_numbers, check_urdf
from m2wr_sim.model.urdf.gazebo_tags import GazeboTags
from m2wr_sim.model.urdf.lumping import WORLD, children_of, depth_first, lump, part_names
from m2wr_sim.model.urdf.reader import NO_MASS, parse_robot, read_body, read_connection
from m2wr_sim.model.urdf.xacro_text import xacro_in
from m2wr_sim.model.xml.safe import XmlError, errors_as, fail, line_of, parse_xml, place

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.model_folders import ResolveModel, ResolvePackage
    from m2wr_sim.model.urdf.lumping import Body, Connection


def _drop_massless(bodies: Dict[str, Body], connections: List[Connection], order: List[str], root: str,
                   elements: Dict[str, Any], notes: Notes) -> List[str]:
    """Return the names of the remaining links: a link without mass is removed with its joint and all links below it."""
    children = children_of(connections)
    dropped: Set[str] = set()
    for name in order:
        inertial = bodies[name].inertial
        if name in dropped or (name == WORLD and name == root) or (inertial is not None and inertial.mass > NO_MASS):
            continue
        subtree = list(depth_first(name, children))
        dropped.update(subtree)
        with_it = ", and with it " + ", ".join(subtree[1:]) if len(subtree) > 1 else ""
        if inertial is not None and inertial.mass < 0.0:
            mass = _negative_mass(elements, [name])     # None where only merged links make it negative
            notes.add('{}: mass is {:g}; expected a positive mass in kg; link "{}" is dropped, as in Gazebo{}.'.format(
                place(elements[name] if mass is None else mass), inertial.mass, name, with_it))
        else:
            notes.add('{}: link "{}" has no mass and is dropped, as in Gazebo{}; give it an <inertial>.'.format(
                line_of(elements[name]), name, with_it))
    connections[:] = [connection for connection in connections if connection.child not in dropped]
    return [name for name in order if name not in dropped and not (name == WORLD and name == root)]


def _negative_mass(elements: Dict[str, Any], names: Iterable[str]) -> Any:
    """Return the first ``<mass>`` below 0 of these links, or None."""
    for mass in (elements[name].find("inertial/mass") for name in names):
        if mass is not None and float(mass.get("value")) < 0.0:
            return mass
    return None


def _refuse_nothing(root: Any, elements: Dict[str, Any]) -> NoReturn:
    """Raise XmlError: no link is left of the robot."""
    negative = _negative_mass(elements, elements)
    if negative is not None:
        fail(negative, "mass is {}, so nothing is left of the robot".format(negative.get("value")),
             "a positive mass in kg")
    fail(root, "no link has mass, so nothing is left of the robot", "a root link with <inertial>, or one that a link "
         "with <inertial> is fixed to")


def _link(body: Body, pose: Pose, element: Any, tags: GazeboTags, notes: Notes) -> Link:
    """Return the Link of a body that remains."""
    assert body.inertial is not None, "links without mass have been removed"
    inertial, problem = usable(body.inertial, body.collisions)
    if problem is not None:
        notes.add("{}: {}.".format(place(element if element.find("inertial") is None else element.find("inertial")),
                                   problem))
    sources = [body.name] + [name for name, _ in body.lumped]
    tagged = tags.tagged(sources)
    collisions = [tags.collision(Collision(name, part.geometry, part.pose, part.surface), part.origin, body.name,
                                 tagged)
                  for name, part in zip(part_names(body.name, body.collisions, "_collision"), body.collisions)]
    visuals = [Visual(name, part.geometry, part.pose, part.rgba)
               for name, part in zip(part_names(body.name, body.visuals, "_visual"), body.visuals)]
    visuals = [replace(visual, material=tags.material(visual, body.name, tagged)) for visual in visuals]
    return Link(name=body.name, pose=pose, inertial=inertial, collisions=tuple(collisions), visuals=tuple(visuals),
                sensors=tags.sensors(body.name, body.lumped),
                **dict({"self_collide": tags.model_switch("self_collide", False)}, **tags.link_values(sources)))


def _offset(plugin: PluginSpec, tag: str, notes: Notes) -> Vector:
    text = plugin.find(tag)
    try:
        numbers: Tuple[float, ...] = tuple(float(word) for word in text.split()) if text else (0.0, 0.0, 0.0)
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        notes.add('{}: {} is "{}"; expected three numbers; using 0 0 0.'.format(plugin.where, tag, text))
        return (0.0, 0.0, 0.0)
    return (numbers[0], numbers[1], numbers[2])


def _retarget(plugin: PluginSpec, lumped: Dict[str, Tuple[str, Pose]], notes: Notes) -> PluginSpec:
    """Return a model plugin; ``bodyName`` or ``frameName`` of a lumped link is replaced by the carrying link.

    The lumped link's pose in the carrier is composed with ``xyzOffset`` and ``rpyOffset`` [m, rad].
    """
    for tag in ("bodyName", "frameName"):
        target = plugin.find(tag)
        if target is None or target not in lumped:
            continue
        carrier, carrier_from_lumped = lumped[target]
        own = (_offset(plugin, "xyzOffset", notes), quaternion_from_rpy(*_offset(plugin, "rpyOffset", notes)))
        position, orientation = compose(carrier_from_lumped, own)
        kept = tuple((name, carrier if name == tag else text) for name, text in plugin.parameters
                     if name not in ("xyzOffset", "rpyOffset"))
        plugin = replace(plugin, parameters=kept + tuple(
            (name, " ".join(repr(float(value)) for value in values))
            for name, values in (("xyzOffset", position), ("rpyOffset", rpy_from_quaternion(orientation)))))
    return plugin


def _joints(connections: List[Connection], order: List[str], notes: Notes) -> Tuple[Joint, ...]:
    """Return the Joints that are left, in the order of their child links; floating and planar ones have no joint."""
    joints, places = [], {name: place for place, name in enumerate(order)}
    for connection in sorted(connections, key=lambda connection: places[connection.child]):
        if connection.kind in ("floating", "planar"):
            notes.add('joint "{}" of type {} connects nothing here, as in Gazebo: link "{}" moves freely.'.format(
                connection.name, connection.kind, connection.child))
            continue
        joints.append(Joint(connection.name, connection.kind, connection.parent, connection.child, IDENTITY,
                            connection.axis))
    return tuple(joints)


def _followers(root: Any, connections: List[Connection], plugins: Sequence[PluginSpec], elements: Dict[str, Any],
               notes: Notes) -> Tuple[PluginSpec, ...]:
    """Return the plugins that make joints with ``<mimic>`` follow, unless something else in the description does."""
    moving = {connection.name for connection in connections if connection.kind in ("revolute", "prismatic")}
    driven: Set[Optional[str]] = set()
    if any("gazebo_ros_control" in plugin.filename for plugin in plugins):
        driven.update(joint.get("name") for joint in root.iterfind("transmission/joint"))
    driven.update(plugin.find("mimicJoint") for plugin in plugins)
    made = []
    for connection in connections:
        if connection.mimic is None or connection.name in driven or connection.name not in moving:
            continue
        leader, multiplier, offset = connection.mimic
        where = place(elements[connection.name].find("mimic"))
        if leader not in moving or leader == connection.name:
            notes.add('{}: joint "{}" mimics "{}"; expected another joint that moves; it moves freely.'.format(
                where, connection.name, leader))
            continue
        made.append(PluginSpec("mimic_" + connection.name, MIMIC_LIBRARY, (
            ("joint", leader), ("mimicJoint", connection.name), ("multiplier", repr(float(multiplier))),
            ("offset", repr(float(offset)))), where=where))
    return tuple(made)


def _link_poses(order: List[str], connections: List[Connection]) -> Dict[str, Pose]:
    """Return link name -> pose in the model frame with every joint at zero."""
    by_child = {connection.child: connection for connection in connections}
    poses = {WORLD: IDENTITY}
    for name in order:      # parents before their children
        connection = by_child.get(name)
        poses[name] = IDENTITY if connection is None else compose(poses[connection.parent], connection.pose)
    return poses


def _document(text: Union[str, bytes], source: str) -> Any:
    """Return the root element of the URDF; xacro is refused, because it is a program that runs when it is expanded."""
    root = parse_xml(text, source)
    found = xacro_in(root) if root.tag == "robot" else None
    if found:
        raise XmlError("{}: this is xacro, not yet URDF; expected URDF. Expand it first: xacro FILE.xacro > FILE.urdf, "
                       "or spawn the file: rosrun m2wr_sim spawn_model -urdf -file FILE.xacro -model "
                       "NAME".format(found))
    return root


def _origin(element: Any) -> Pose:
    """Return the pose in the xyz and rpy attributes of an ``<origin>``; identity without it."""
    if element is None:
        return IDENTITY
    x, y, z = attribute_numbers(element, "xyz", 3) if element.get("xyz") is not None else (0.0, 0.0, 0.0)
    rpy = attribute_numbers(element, "rpy", 3) if element.get("rpy") is not None else (0.0, 0.0, 0.0)
    return (x, y, z), quaternion_from_rpy(*rpy)


def load_urdf(text: Union[str, bytes], source: str = "robot_description", model_name: Optional[str] = None,
              resolve_package: Optional[ResolvePackage] = None, honour_collision_surface: bool = True,
              resolve_model: Optional[ResolveModel] = None) -> Model:
    """Convert a robot description the way Gazebo does.

    Parameters
    ----------
    text : str or bytes
        URDF. Xacro is refused; see :func:`m2wr_sim.model.urdf.xacro_text.expanded`.
    source : str
        Name of the document for messages.
    model_name : str or None
        Name of the model; None: the name of the robot.
    resolve_package : callable or None
        ``resolve_package(name) -> folder``, for ``package://`` of collision meshes.
    honour_collision_surface : bool
        Apply mu, mu2, slip1 and slip2 of a ``<surface>`` inside a URDF collision, which Gazebo drops.
    resolve_model : callable or None
        For ``model://`` of collision meshes; see :class:`m2wr_sim.model.model_folders.ModelFolders`.

    Returns
    -------
    Model
        Links root first, depth first, siblings in alphabetical order of their joints; ``pose`` from an ``<origin>``
        directly under ``<robot>``; ``notes`` has the warnings about ignored elements.

    Raises
    ------
    ModelError
        If the document is not a usable URDF; names file, line, element, what was found and what was expected.
    """
    with errors_as(ModelError):
        notes = Notes()
        root = _document(text, source)
        elements, joint_elements, root_link = check_urdf(root, notes)
        tags = GazeboTags(root, elements, joint_elements, notes)
        robot = parse_robot(root, source, notes)
        colours = {material.name: material.color for material in robot.materials}
        files = MeshReader(notes, resolve_model, resolve_package)
        bodies = {link.name: read_body(link, elements[link.name], colours, honour_collision_surface, notes, files)
                  for link in robot.links}
        connections = [read_connection(joint, joint_elements[joint.name], tags, notes) for joint in robot.joints]
        order = lump(bodies, connections, root_link)
        order = _drop_massless(bodies, connections, order, root_link, elements, notes)
        if not order:
            _refuse_nothing(root, elements)
        poses = _link_poses(order, connections)
        lumped = {name: (body, pose) for body in order for name, pose in bodies[body].lumped}
        links = tuple(_link(bodies[name], poses[name], elements[name], tags, notes) for name in order)
        plugins = tuple(_retarget(plugin, lumped, notes) for plugin in tags.model_plugins())
        kept = [connection for connection in connections if connection.child in poses]
        plugins += _followers(root, kept, plugins, joint_elements, notes)
        model = Model(name=model_name or root.get("name"), links=links, joints=_joints(connections, order, notes),
                      pose=_origin(root.find("origin")), static=tags.model_switch("static", False),
                      plugins=plugins,
                      lumped=tuple((name, body, pose) for name, (body, pose) in lumped.items()),
                      allow_auto_disable=tags.model_switch("allow_auto_disable", True))
        return replace(model, notes=notes.sentences(), remarks=notes.remarks())
