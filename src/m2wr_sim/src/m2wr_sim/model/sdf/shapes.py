# SPDX-License-Identifier: BSD-3-Clause
"""``<geometry>``, ``<surface>``, ``<collision>``, ``<visual>`` and ``<inertial>`` of SDF -> plain records."""
import math
from functools import lru_cache

import numpy as np

from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Plane, Sphere, Surface, Visual
from m2wr_sim.model.xml.safe import fail

READABLE = ("box", "cylinder", "sphere", "plane", "mesh", "heightmap", "polyline")
KNOWN_UNUSED = ("image", "capsule", "ellipsoid")
FROM_FILES = ("mesh", "heightmap", "polyline")


def _box(node):
    return Box(node.extent("size", 3))


def _cylinder(node):
    return Cylinder(node.positive("radius"), node.positive("length"))


def _sphere(node):
    return Sphere(node.positive("radius"))


def _plane(node):
    normal = node.vector("normal", 3, (0.0, 0.0, 1.0))
    length = math.sqrt(sum(value * value for value in normal))
    if length < 1e-9:
        fail(node.child("normal").element, "normal has no length", "a direction such as 0 0 1")
    return Plane(tuple(value / length for value in normal), node.vector("size", 2, (1.0, 1.0)))


_READERS = {"box": _box, "cylinder": _cylinder, "sphere": _sphere, "plane": _plane}


def read_geometry(parent, files=None):
    """Read the ``<geometry>`` of a collision or visual.

    Parameters
    ----------
    parent : Node
        ``<collision>`` or ``<visual>``.
    files : MeshReader or None
        Reads meshes, heightmaps and polylines; None for visuals, of which only plain shapes are kept.

    Returns
    -------
    Box, Sphere, Cylinder, Plane, Mesh, Heightmap or None
        None where the geometry is empty, is one of SDF's that has no counterpart here (noted), or names a file that
        cannot be used (noted).

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
        return _unopened(outlines) if files is None else files.polyline(outlines)
    shape = geometry.child(tag)
    if tag in _READERS:
        return _READERS[tag](shape)
    if tag in FROM_FILES:
        return _unopened([shape]) if files is None else getattr(files, tag)(shape)
    uri = shape.text("uri")
    shape.ignore()
    parent.notes.add("{}: geometry {}{} is not supported; this {} is left out.".format(
        shape.place, tag, " " + uri if uri else "", parent.tag))
    return None


def _unopened(shapes):
    """Pass over shapes of a visual that only a viewer would need."""
    for shape in shapes:
        shape.ignore()


def _torsion(node):
    """Report torsional friction if it has an effect in Gazebo, which needs a patch radius."""
    if not node:
        return
    patch, radius = node.number("patch_radius", 0.0), node.number("surface_radius", 0.0)
    given = patch if node.flag("use_patch_radius", True) else radius
    if node.number("coefficient", 1.0) != 0.0 and given > 0.0:
        node.notes.add("{}: unsupported element <torsional> in <friction> ignored; torsional friction is 0.".format(
            node.line), ("unread", "friction", "torsional"))


def read_surface(node, base=Surface()):     # noqa: B008  (cannot be changed)
    """Read ``<surface>``, a Node, over the values of ``base``; a missing one returns ``base``."""
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


def _bitmask(contact, default):
    def parse(element, text, what):
        try:
            value = int(text, 0)
        except ValueError:
            value = -1
        if not 0 <= value <= 0xffffffff:
            fail(element, '{} is "{}"'.format(what, text), "a whole number, e.g. 65535")
        return value
    return contact.value("collide_bitmask", default, parse)


def read_collision(node, pose, files=None):
    """Read ``<collision>``; ``pose`` is its pose in the link frame.  None where its geometry has no counterpart.

    ``files`` is the :class:`~m2wr_sim.model.mesh.shapes.MeshReader` of the document.

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


def read_visual(node, pose):
    """Read ``<visual>``; ``pose`` is its pose in the link frame.  None where its geometry is not drawn here.

    Raises
    ------
    XmlError
        If it has no name or no usable geometry.
    """
    name, geometry, material = node.name(), read_geometry(node), node.child("material")
    rgba, script = None, material.child("script").text("name")
    for tag in ("ambient", "diffuse"):          # diffuse wins
        count = 3 if len((material.text(tag) or "").split()) == 3 else 4
        rgba = material.vector(tag, count, None) or rgba
    if geometry is None:
        return None
    rgba = None if rgba is None else rgba + (1.0,) * (4 - len(rgba))
    return Visual(name=name, geometry=geometry, pose=pose, rgba=rgba, material=script)


def read_inertial(node, pose):
    """Read ``<inertial>`` (a missing one: mass 1, unit tensor); ``pose`` is the centre of mass frame in the link frame.

    Mass and tensor come as they are: see :mod:`m2wr_sim.model.inertials`.
    """
    if not node:
        return Inertial()
    tensor = node.child("inertia")
    unit = (("ixx", 1.0), ("ixy", 0.0), ("ixz", 0.0), ("iyy", 1.0), ("iyz", 0.0), ("izz", 1.0))
    return Inertial(node.number("mass", 1.0), pose, tuple(tensor.number(key, default) for key, default in unit))


def inertia_matrix(inertial):
    """Return the (3, 3) tensor of an Inertial in its own centre of mass frame [kg m^2]."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@lru_cache(maxsize=4096)
def _moments(tensor):
    if not all(map(math.isfinite, tensor)):         # as of bodies lumped over a distance beyond all measure
        return (math.nan,) * 3
    xx, xy, xz, yy, yz, zz = tensor
    return tuple(np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])))


def inertial_moments(inertial):
    """Return the three principal moments of an Inertial [kg m^2], the least first; nan if the tensor is not finite."""
    return _moments(tuple(inertial.inertia))


def inertial_doubt(inertial):
    """Return a sentence part if no real body has this tensor (triangle inequality broken), else None."""
    low, middle, high = _moments(tuple(inertial.inertia))
    if low > 0.0 and high > (low + middle) * (1.0 + 1e-6):
        return "principal moments {:g}, {:g}, {:g}: the largest exceeds the sum of the others, which no real body " \
               "can have".format(low, middle, high)
    return None
