# SPDX-License-Identifier: BSD-3-Clause
"""A checked URDF document -> bodies and connections, by way of urdf_parser_py.

That parser drops names of collisions and visuals, ``<surface>`` and ``<gazebo>``; they come from the XML itself.
"""
from __future__ import annotations

import copy
import re
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, Optional, Tuple

import urdf_parser_py.urdf as urdf_model
import urdf_parser_py.xml_reflection as xml_reflection
import urdf_parser_py.xml_reflection.core as xml_core

from m2wr_sim.geometry import IDENTITY, quaternion_from_rpy
from m2wr_sim.model.sdf.joint import NO_LIMIT, clamp_limit, unit
from m2wr_sim.model.sdf.node import Node
from m2wr_sim.model.sdf.shapes import inertial_doubt, read_surface
from m2wr_sim.model.types import Axis, Box, Cylinder, Inertial, Sphere, Surface
from m2wr_sim.model.urdf.checks import check_size
from m2wr_sim.model.urdf.lumping import Body, Connection, Part
from m2wr_sim.model.xml.safe import XmlError, line_of, place, shorten

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.mesh.shapes import MeshReader
    from m2wr_sim.model.notes import Notes
    from m2wr_sim.model.types import VisualGeometry
    from m2wr_sim.model.urdf.gazebo_tags import GazeboTags

NO_MASS = 1e-6                # kg; for Gazebo a smaller mass is zero

_LOCK = threading.Lock()      # urdf_parser_py reports through a module global
_UNKNOWN = re.compile(r'Unknown (tag|attribute) "(.+)" in (/\S+)')
_INSTEAD = {
    ("link", "pose"): "the <origin> of the joint to its parent places a link",
    ("joint", "joint_properties"): "<dynamics damping=... friction=...> is read",
    ("joint", "dynamic"): "<dynamics> is read",
    ("collision", "contact_coefficients"): "<mu1> and <mu2> in a <gazebo reference=...> block are read",
    ("collision", "material"): "a <material> belongs in <visual>",
    ("link", "material"): "a <material> belongs in <visual>",
    ("link", "sensor"): "<sensor> is read in a <gazebo reference=...> block",
    ("robot", "plugin"): "<plugin> is read in a <gazebo> block",
    ("robot", "sensor"): "<sensor> is read in a <gazebo reference=...> block",
}


@contextmanager
def _reports_to(report: Callable[[str], None]) -> Iterator[None]:
    """Pass the messages that urdf_parser_py would print to stderr to ``report``."""
    with _LOCK:
        before = xml_core.on_error, xml_reflection.on_error
        xml_core.on_error = xml_reflection.on_error = report
        try:
            yield
        finally:
            xml_core.on_error, xml_reflection.on_error = before


def _for_parser(root: Any) -> Any:
    """Return a copy of the document without the elements that only this package reads."""
    robot = copy.deepcopy(root)
    for tag in ("gazebo", "transmission", "origin", "static"):
        for element in robot.findall(tag):
            robot.remove(element)
    for part in list(robot.iter("collision", "visual")):
        part.attrib.pop("name", None)
        for surface in part.findall("surface"):
            part.remove(surface)
    for joint in robot.findall("joint"):
        for axis in joint.findall("axis"):
            if axis.get("xyz") is None:
                joint.remove(axis)
    return robot


def parse_robot(root: Any, source: str, notes: Notes) -> Any:
    """Return the urdf_parser_py Robot of a checked document; unsupported elements are added to the notes.

    Parameters
    ----------
    root : lxml element
    source : str
        Name of the document for messages.
    notes : Notes

    Returns
    -------
    urdf_parser_py.urdf.Robot

    Raises
    ------
    XmlError
        If that parser rejects the document for a reason that the checks do not know.
    """
    robot = _for_parser(root)

    def report(message: str) -> None:
        match = _UNKNOWN.match(message)
        found = robot.xpath(match.group(3)) if match else []
        if match is None or not found:
            notes.add("{}: {}.".format(source, shorten(message.strip(), 300).rstrip(".")))
            return
        parent, kind, name = found[0], match.group(1), match.group(2)
        instead = _INSTEAD.get((parent.tag, name))
        shown = "<{}>".format(name) if kind == "tag" else "attribute {}".format(name)
        notes.aside("{}: {} in <{}> is not part of URDF and is ignored{}.".format(
            line_of(parent), shown, parent.tag, "; " + instead if instead else ""), (parent.tag, kind, name))

    with _reports_to(report):
        try:
            return urdf_model.URDF.from_xml(robot, xml_core.Path("robot", tree=robot.getroottree()))
        except Exception as error:     # the parser raises bare Exception and AssertionError, too
            raise XmlError("{}: not a URDF that can be read: {}; expected valid URDF".format(
                source, shorten(str(error) or repr(error), 300))) from None


def _pose(origin: Any) -> Pose:
    if origin is None:
        return IDENTITY
    x, y, z = origin.xyz or (0.0, 0.0, 0.0)
    return (x, y, z), quaternion_from_rpy(*(origin.rpy or (0.0, 0.0, 0.0)))


def _geometry(geometry: Any, element: Any, files: MeshReader) -> Optional[VisualGeometry]:
    """Return the shape of a URDF geometry; the file of a visual's mesh; None, after a warning, for a mesh not read.

    Raises
    ------
    XmlError
        If it has no extent.
    """
    check_size(element.find("geometry")[0])
    if isinstance(geometry, urdf_model.Box):
        x, y, z = geometry.size
        return Box((x, y, z))
    if isinstance(geometry, urdf_model.Cylinder):
        return Cylinder(geometry.radius, geometry.length)
    if isinstance(geometry, urdf_model.Sphere):
        return Sphere(geometry.radius)
    if element.tag == "collision":
        return files.urdf_mesh(element.find("geometry/mesh"), geometry.filename, geometry.scale)
    return files.urdf_mesh_file(element.find("geometry/mesh"), geometry.filename, geometry.scale)


def _own_surface(element: Any, honoured: bool, notes: Notes) -> Surface:
    """Return the Surface of a ``<surface>`` in a URDF collision: friction and slip only."""
    surface = element.find("surface")
    if surface is None:
        return Surface()
    if not honoured:
        notes.aside("{}: <surface> in a URDF collision is ignored; <mu1> and <mu2> in a <gazebo reference=...> block "
                    "are.".format(line_of(surface)), ("surface", "ignored"))
        return Surface()
    notes.aside("{}: <surface> in a URDF collision: mu, mu2, slip1 and slip2 are applied here, while Gazebo itself "
                "reads only <mu1> and <mu2> in a <gazebo reference=...> block.".format(line_of(surface)),
                ("surface", "read"))
    node = Node(surface, notes)
    read = read_surface(node)
    node.done()
    return Surface(mu=read.mu, mu2=read.mu2, slip1=read.slip1, slip2=read.slip2)


def read_body(link: Any, element: Any, colours: Dict[str, Any], honour_surface: bool, notes: Notes,
              files: MeshReader) -> Body:
    """Return the Body of one link.

    Parameters
    ----------
    link : urdf_parser_py.urdf.Link
    element : lxml element
        Its element in the document.
    colours : dict
        Name of a material -> colour.
    honour_surface : bool
        Whether a ``<surface>`` in a collision is used.
    notes : Notes
    files : MeshReader

    Returns
    -------
    Body
    """
    body = Body(link.name)
    if link.inertial is not None:
        tensor = link.inertial.inertia
        body.inertial = Inertial(link.inertial.mass, _pose(link.inertial.origin),
                                 (tensor.ixx, tensor.ixy, tensor.ixz, tensor.iyy, tensor.iyz, tensor.izz))
        if body.inertial.mass > NO_MASS and inertial_doubt(body.inertial) is not None:
            notes.add("{}: {}.".format(place(element.find("inertial")), inertial_doubt(body.inertial)))
    # urdf_parser_py keeps the order of the document
    for part, part_element in zip(link.collisions, element.findall("collision")):
        geometry = notes.attempt("this collision", _geometry, part.geometry, part_element, files)
        if geometry is not None:
            body.collisions.append(Part(part_element.get("name") or "", link.name, geometry, _pose(part.origin),
                                        _own_surface(part_element, honour_surface, notes)))
    for part, part_element in zip(link.visuals, element.findall("visual")):
        geometry = notes.attempt("this visual", _geometry, part.geometry, part_element, files)
        if geometry is not None:
            body.visuals.append(Part(part_element.get("name") or "", link.name, geometry, _pose(part.origin),
                                     rgba=_colour(part.material, colours)))
    return body


def _colour(material: Any, colours: Dict[str, Any]) -> Optional[Tuple[float, float, float, float]]:
    if material is None:
        return None
    colour = material.color or colours.get(material.name)
    if colour is None or colour.rgba is None:
        return None
    red, green, blue, alpha = colour.rgba
    return (red, green, blue, alpha)


def _axis(joint: Any, element: Any, notes: Notes) -> Axis:
    """Return the Axis of a moving joint, with URDF's default direction and Gazebo's limits."""
    axis_element = element.find("axis")
    if axis_element is not None and any(word.strip("+-0.") for word in (axis_element.get("rpy") or "").split()):
        notes.aside("{}: attribute rpy of <axis> is not part of URDF and is ignored; the axis is xyz.".format(
            line_of(axis_element)), ("axis", "rpy"))
    xyz = unit(element, joint.axis or (1.0, 0.0, 0.0))
    lower, upper = -NO_LIMIT, NO_LIMIT
    if joint.type in ("revolute", "prismatic"):
        lower, upper = sorted((clamp_limit(joint.limit.lower or 0.0), clamp_limit(joint.limit.upper or 0.0)))
    effort = velocity = -1.0
    if joint.limit is not None:
        effort, velocity = (-1.0 if abs(value) > NO_LIMIT else value
                            for value in (joint.limit.effort, joint.limit.velocity))
    damping = friction = 0.0
    if joint.dynamics is not None:
        damping, friction = joint.dynamics.damping or 0.0, joint.dynamics.friction or 0.0
    return Axis(xyz=xyz, damping=damping, friction=friction, lower=lower, upper=upper, effort=effort, velocity=velocity)


def read_connection(joint: Any, element: Any, tags: GazeboTags, notes: Notes) -> Connection:
    """Return the Connection of one joint; tags may prevent that a fixed joint is removed by merging.

    Parameters
    ----------
    joint : urdf_parser_py.urdf.Joint
    element : lxml element
        Its element in the document.
    tags : GazeboTags
    notes : Notes

    Returns
    -------
    Connection
    """
    kind, axis, reduced = joint.type, Axis(), False
    if kind == "fixed":
        if tags.joint_switch(joint.name, "preserveFixedJoint"):
            pass
        elif tags.joint_switch(joint.name, "disableFixedJointLumping"):
            kind, axis = "revolute", Axis(xyz=(1.0, 0.0, 0.0), lower=0.0, upper=0.0)
        else:
            reduced = True
    elif kind in ("continuous", "revolute", "prismatic"):
        axis = tags.joint_axis(joint.name, _axis(joint, element, notes))
        kind = "prismatic" if kind == "prismatic" else "revolute"
    mimic = None
    if joint.mimic is not None:
        multiplier, offset = joint.mimic.multiplier, joint.mimic.offset
        mimic = (joint.mimic.joint, 1.0 if multiplier is None else multiplier, offset or 0.0)
    return Connection(joint.name, kind, joint.parent, joint.child, _pose(joint.origin), axis, reduced, mimic)
