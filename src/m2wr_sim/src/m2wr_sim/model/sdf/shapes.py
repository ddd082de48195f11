# SPDX-License-Identifier: BSD-3-Clause
"""``<geometry>``, ``<surface>``, ``<collision>``, ``<visual>`` and ``<inertial>`` of SDF -> plain records."""
from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, Optional, Tuple

import numpy as np

from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Plane, Sphere, Surface, Visual
from m2wr_sim.model.xml.safe import fail

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.mesh.shapes import MeshReader
    from m2wr_sim.model.sdf.node import Node
    from m2wr_sim.model.types import Geometry, VisualGeometry

READABLE = ("box", "cylinder", "sphere", "plane", "mesh", "heightmap", "polyline")
KNOWN_UNUSED = ("image", "capsule", "ellipsoid")
FROM_FILES = ("mesh", "heightmap", "polyline")


def _box(node: Node) -> Box:
    x, y, z = node.extent("size", 3)
    return Box((x, y, z))


def _cylinder(node: Node) -> Cylinder:
    return Cylinder(node.positive("radius"), node.positive("length"))


def _sphere(node: Node) -> Sphere:
    return Sphere(node.positive("radius"))


def _plane(node: Node) -> Plane:
    normal = x, y, z = node.vector("normal", 3, (0.0, 0.0, 1.0))
    length = math.sqrt(sum(value * value for value in normal))
    if length < 1e-9:
        fail(node.child("normal").element, "normal has no length", "a direction such as 0 0 1")
    return Plane((x / length, y / length, z / length), node.vector("size", 2, (1.0, 1.0)))


_READERS: Dict[str, Callable[[Node], Geometry]] = {
    "box": _box, "cylinder": _cylinder, "sphere": _sphere, "plane": _plane}


def read_geometry(parent: Node, files: Optional[MeshReader] = None) -> Optional[Geometry]:
    """Read the ``<geometry>`` of a collision or visual.

    Parameters
    ----------
    parent : Node
        ``<collision>`` or ``<visual>``.
    files : MeshReader or None
        Reads meshes, heightmaps and polylines; None for visuals, of which only simple shapes are kept.

    Returns
    -------
    Box, Sphere, Cylinder, Plane, Mesh, Heightmap or None
        None if the geometry is empty, not supported, or names a file that cannot be used; for the last two a warning is
        added.

    Raises
    ------
    XmlError
        If there is no geometry, it is unknown, or a size is not positive.
    """
    geometry = parent.child("geometry")
    expected = "one of {}".format(", ".join(READABLE))
    if not geometry:
        parent.fail("<geometry> is missing", expected + " in it")
    tags = [tag for tag in geometry.tags() if tag != "empty"]
    geometry.child("empty").ignore()
    if not tags:
        return None
    tag = tags[0]
    if tag not in READABLE and tag not in KNOWN_UNUSED:
        fail(geometry.child(tag).element, 'unknown geometry "{}"'.format(tag), expected)
    if tag == "polyline":
        outlines = geometry.children(tag)
        if files is not None:
            return files.polyline(outlines)
        _ignore(outlines)
        return None
    shape = geometry.child(tag)
    if tag in _READERS:
        return _READERS[tag](shape)
    if tag in FROM_FILES:
        if files is not None:
            return files.mesh(shape) if tag == "mesh" else files.heightmap(shape)
        _ignore([shape])
        return None
    uri = shape.text("uri")
    shape.ignore()
    parent.notes.add("{}: geometry {}{} is not supported; this {} is left out.".format(
        shape.place, tag, " " + uri if uri else "", parent.tag))
    return None


def _visual_geometry(parent: Node, files: Optional[MeshReader]) -> Optional[VisualGeometry]:
    """Return the shape of a visual; a mesh as the name of its file, None for what is not drawn."""
    geometry = parent.child("geometry")
    if files is None or not geometry or [tag for tag in geometry.tags() if tag != "empty"][:1] not in (
            ["mesh"], ["polyline"]):
        return read_geometry(parent)
    geometry.child("empty").ignore()
    if geometry.has("polyline"):
        return files.polyline(geometry.children("polyline"))
    return files.mesh_file(geometry.child("mesh"))


def _ignore(shapes: Iterable[Node]) -> None:
    """Ignore shapes of a visual that only a viewer needs."""
    for shape in shapes:
        shape.ignore()


def _torsion(node: Node) -> None:
    """Report torsional friction if it has an effect in Gazebo, which needs a patch radius."""
    if not node:
        return
    patch, radius = node.number("patch_radius", 0.0), node.number("surface_radius", 0.0)
    given = patch if node.flag("use_patch_radius", True) else radius
    if node.number("coefficient", 1.0) != 0.0 and given > 0.0:
        node.notes.add("{}: unsupported element <torsional> in <friction> ignored; torsional friction is 0.".format(
            node.line), ("unread", "friction", "torsional"))


def read_surface(node: Node, base: Surface = Surface()) -> Surface:     # noqa: B008  (cannot be changed)
    """Read ``<surface>``; values that are missing are those of ``base``.

    Parameters
    ----------
    node : Node
    base : Surface

    Returns
    -------
    Surface
    """
    if not node:
        return base
    friction, contact, bounce = node.child("friction"), node.child("contact"), node.child("bounce")
    ode, contact_ode = friction.child("ode"), contact.child("ode")
    _torsion(friction.child("torsional"))
    if contact.number("elastic_modulus", 0.0) > 0.0:
        node.notes.add("{}: unsupported element <elastic_modulus> in <contact> ignored; use <kp> and <kd>.".format(
            contact.child("elastic_modulus").line), ("unread", "contact", "elastic_modulus"))
    return Surface(
        mu=ode.number("mu", base.mu), mu2=ode.number("mu2", base.mu2), fdir1=ode.vector("fdir1", 3, base.fdir1),
        slip1=ode.number("slip1", base.slip1), slip2=ode.number("slip2", base.slip2),
        restitution=bounce.number("restitution_coefficient", base.restitution),
        restitution_threshold=bounce.number("threshold", base.restitution_threshold),
        kp=contact_ode.number("kp", base.kp), kd=contact_ode.number("kd", base.kd),
        max_vel=contact_ode.number("max_vel", base.max_vel),
        min_depth=contact_ode.number("min_depth", base.min_depth),
        collide_bitmask=_bitmask(contact, base.collide_bitmask),
        collide_without_contact=contact.flag("collide_without_contact", base.collide_without_contact))


def _bitmask(contact: Node, default: int) -> int:
    def parse(element: Any, text: str, what: str) -> int:
        try:
            value = int(text, 0)
        except ValueError:
            value = -1
        if not 0 <= value <= 0xffffffff:
            fail(element, '{} is "{}"'.format(what, text), "a whole number, e.g. 65535")
        return value
    return contact.value("collide_bitmask", default, parse)


def read_collision(node: Node, pose: Pose, files: Optional[MeshReader] = None) -> Optional[Collision]:
    """Read ``<collision>``.

    Parameters
    ----------
    node : Node
    pose : pose
        Of the collision in the link frame.
    files : MeshReader, optional
        See :func:`read_geometry`.

    Returns
    -------
    Collision or None
        None if it has no usable geometry, see :func:`read_geometry`.

    Raises
    ------
    XmlError
        If it has no name or no usable geometry.
    """
    name = node.name()
    surface = read_surface(node.child("surface"))
    retro, contacts = node.number("laser_retro", 0.0), node.whole("max_contacts", 10, 0)
    geometry = read_geometry(node, files)
    return None if geometry is None else Collision(name=name, geometry=geometry, pose=pose, surface=surface,
                                                   laser_retro=retro, max_contacts=contacts)


def read_visual(node: Node, pose: Pose, files: Optional[MeshReader] = None) -> Optional[Visual]:
    """Read ``<visual>``.

    Parameters
    ----------
    node : Node
    pose : pose
        Of the visual in the link frame.
    files : MeshReader, optional
        Finds the files of meshes and materials.

    Returns
    -------
    Visual or None
        None if its geometry is not drawn.

    Raises
    ------
    XmlError
        If it has no name or no usable geometry.
    """
    name, geometry, material = node.name(), _visual_geometry(node, files), node.child("material")
    colour: Optional[Tuple[float, ...]] = None
    script = material.child("script").text("name")
    folders = [uri.own_text() for uri in material.child("script").children("uri")]
    transparency = min(max(node.number("transparency", 0.0), 0.0), 1.0)
    shadows = node.flag("cast_shadows", True)
    for tag in ("ambient", "diffuse"):          # diffuse wins
        count = 3 if len((material.text(tag) or "").split()) == 3 else 4
        colour = material.vector(tag, count, None) or colour
    if geometry is None:
        return None
    rgba = None
    if colour is not None:
        red, green, blue, alpha = (*colour, 1.0)[:4]
        rgba = (red, green, blue, alpha)
    return Visual(name=name, geometry=geometry, pose=pose, rgba=rgba, material=script, transparency=transparency,
                  scripts=() if files is None else files.folders(folders, node.element), cast_shadows=shadows)


def read_inertial(node: Node, pose: Pose) -> Inertial:
    """Read ``<inertial>``; a missing one has mass 1 and the unit tensor.

    Mass and tensor are not checked: see :mod:`m2wr_sim.model.inertials`.

    Parameters
    ----------
    node : Node
    pose : pose
        Frame of the centre of mass in the link frame.

    Returns
    -------
    Inertial
    """
    if not node:
        return Inertial()
    tensor = node.child("inertia")
    return Inertial(node.number("mass", 1.0), pose, (
        tensor.number("ixx", 1.0), tensor.number("ixy", 0.0), tensor.number("ixz", 0.0), tensor.number("iyy", 1.0),
        tensor.number("iyz", 0.0), tensor.number("izz", 1.0)))


def inertia_matrix(inertial: Inertial) -> NDArray[np.float64]:
    """Return the (3, 3) tensor of an Inertial in its own centre of mass frame [kg m^2]."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@lru_cache(maxsize=4096)
def _moments(tensor: Tuple[float, ...]) -> Tuple[float, float, float]:
    if not all(map(math.isfinite, tensor)):         # for instance of bodies lumped over an extreme distance
        return (math.nan, math.nan, math.nan)
    xx, xy, xz, yy, yz, zz = tensor
    low, middle, high = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])).tolist()
    return (low, middle, high)


def inertial_moments(inertial: Inertial) -> Tuple[float, float, float]:
    """Return the three principal moments of an Inertial [kg m^2], the least first; nan if the tensor is not finite."""
    return _moments(tuple(inertial.inertia))


def inertial_doubt(inertial: Inertial) -> Optional[str]:
    """Return a message if no real body has this tensor, because it violates the triangle inequality, else None."""
    low, middle, high = _moments(tuple(inertial.inertia))
    if low > 0.0 and high > (low + middle) * (1.0 + 1e-6):
        return "principal moments {:g}, {:g}, {:g}: the largest exceeds the sum of the others, which no real body " \
               "can have".format(low, middle, high)
    return None
