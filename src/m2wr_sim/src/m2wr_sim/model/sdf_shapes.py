"""``<geometry>``, ``<surface>``, ``<collision>``, ``<visual>`` and ``<inertial>`` of SDF -> plain records."""
import math

import numpy as np

from m2wr_sim.model.safe_xml import (child_bool, child_float, child_int, child_positive, child_text, child_vector, fail,
                                     parse_vector, place, required_name)
from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Plane, Sphere, Surface, Visual

READABLE = ("box", "cylinder", "sphere", "plane", "mesh", "heightmap", "polyline")
KNOWN_UNUSED = ("image", "capsule", "ellipsoid")
FROM_FILES = ("mesh", "heightmap", "polyline")

_OTHER_ENGINES = frozenset(("bullet", "simbody", "dart"))


def _box(element):
    text = child_text(element, "size")
    if text is None:
        fail(element, "<size> is missing", "three positive numbers there")
    size = parse_vector(element.find("size"), text, 3, "size")
    if min(size) <= 0.0:
        fail(element.find("size"), 'size is "{}"'.format(text), "three positive numbers")
    return Box(size)


def _cylinder(element):
    return Cylinder(child_positive(element, "radius"), child_positive(element, "length"))


def _sphere(element):
    return Sphere(child_positive(element, "radius"))


def _plane(element):
    normal = child_vector(element, "normal", 3, (0.0, 0.0, 1.0))
    length = math.sqrt(sum(value * value for value in normal))
    if length < 1e-9:
        fail(element.find("normal"), "normal has no length", "a direction such as 0 0 1")
    return Plane(tuple(value / length for value in normal), child_vector(element, "size", 2, (1.0, 1.0)))


_READERS = {"box": _box, "cylinder": _cylinder, "sphere": _sphere, "plane": _plane}


def read_geometry(parent, notes, files=None):
    """Read the ``<geometry>`` of a collision or visual.

    Parameters
    ----------
    parent : lxml element
        ``<collision>`` or ``<visual>``.
    notes : Notes
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
        If there is no geometry, if it is none that SDF knows, or if a size is not positive.
    """
    geometry = parent.find("geometry")
    expected = "one of {}".format(", ".join(READABLE))
    if geometry is None:
        fail(parent, "<geometry> is missing", expected + " in it")
    shapes = [child for child in geometry if child.tag != "empty"]
    if not shapes:
        return None
    shape = shapes[0]
    if shape.tag in _READERS:
        return _READERS[shape.tag](shape)
    if shape.tag in FROM_FILES:
        if files is None:
            return None
        return files.polyline([child for child in shapes if child.tag == "polyline"]) if shape.tag == "polyline" \
            else getattr(files, shape.tag)(shape)
    if shape.tag not in KNOWN_UNUSED:
        fail(shape, 'unknown geometry "{}"'.format(shape.tag), expected)
    uri = child_text(shape, "uri")
    notes.add("{}: geometry {}{} is not supported; this {} is left out.".format(
        place(shape), shape.tag, " " + uri if uri else "", parent.tag))
    return None


def read_surface(element, notes, base=Surface()):
    """Read ``<surface>`` over the values of ``base``; None returns ``base``."""
    if element is None:
        return base
    notes.unread(element, ("friction", "contact", "bounce"), ("soft_contact",))
    friction, contact, bounce = element.find("friction"), element.find("contact"), element.find("bounce")
    ode, contact_ode = element.find("friction/ode"), element.find("contact/ode")
    if friction is not None:
        idle = child_float(friction.find("torsional"), "patch_radius", 0.0) == 0.0     # without a patch it does nothing
        notes.unread(friction, ("ode",), _OTHER_ENGINES | {"torsional"} if idle else _OTHER_ENGINES)
    if contact is not None:
        notes.unread(contact, ("ode", "collide_bitmask", "collide_without_contact"),
                     _OTHER_ENGINES | {"collide_without_contact_bitmask", "category_bitmask", "poissons_ratio",
                                       "elastic_modulus"})
    return Surface(
        mu=child_float(ode, "mu", base.mu), mu2=child_float(ode, "mu2", base.mu2),
        fdir1=child_vector(ode, "fdir1", 3, base.fdir1),
        slip1=child_float(ode, "slip1", base.slip1), slip2=child_float(ode, "slip2", base.slip2),
        restitution=child_float(bounce, "restitution_coefficient", base.restitution),
        restitution_threshold=child_float(bounce, "threshold", base.restitution_threshold),
        kp=child_float(contact_ode, "kp", base.kp), kd=child_float(contact_ode, "kd", base.kd),
        max_vel=child_float(contact_ode, "max_vel", base.max_vel),
        min_depth=child_float(contact_ode, "min_depth", base.min_depth),
        collide_bitmask=_bitmask(contact, base.collide_bitmask),
        collide_without_contact=child_bool(contact, "collide_without_contact", base.collide_without_contact))


def _bitmask(contact, default):
    text = child_text(contact, "collide_bitmask")
    if not text:
        return default
    try:
        value = int(text, 0)
    except ValueError:
        value = -1
    if not 0 <= value <= 0xffffffff:
        fail(contact.find("collide_bitmask"), 'collide_bitmask is "{}"'.format(text), "a whole number, e.g. 65535")
    return value


def read_collision(element, pose, notes, files=None):
    """Read ``<collision>``; ``pose`` is its pose in the link frame.  None where its geometry has no counterpart.

    ``files`` is the :class:`~m2wr_sim.model.mesh_shapes.MeshReader` of the document.
    """
    name = required_name(element)
    notes.unread(element, ("pose", "geometry", "surface", "laser_retro", "max_contacts"))
    geometry = read_geometry(element, notes, files)
    if geometry is None:
        return None
    return Collision(name=name, geometry=geometry, pose=pose, surface=read_surface(element.find("surface"), notes),
                     laser_retro=child_float(element, "laser_retro", 0.0),
                     max_contacts=child_int(element, "max_contacts", 10, 0))


def read_visual(element, pose, notes):
    """Read ``<visual>``; ``pose`` is its pose in the link frame.  None where its geometry has no counterpart."""
    name = required_name(element)
    geometry = read_geometry(element, notes)
    if geometry is None:
        return None
    material = element.find("material")
    text = child_text(material, "diffuse") or child_text(material, "ambient")
    rgba = None
    if text:
        colour = material.find("diffuse") if child_text(material, "diffuse") else material.find("ambient")
        rgba = parse_vector(colour, text, len(text.split()) if len(text.split()) in (3, 4) else 4, colour.tag)
        rgba = rgba if len(rgba) == 4 else rgba + (1.0,)
    return Visual(name=name, geometry=geometry, pose=pose, rgba=rgba, material=child_text(material, "script/name"))


def read_inertial(element, pose):
    """Read ``<inertial>`` (None: mass 1, unit tensor); ``pose`` is the centre of mass frame in the link frame.

    Raises
    ------
    XmlError
        If the mass is negative or a number is not finite.
    """
    if element is None:
        return Inertial()
    mass, tensor = child_float(element, "mass", 1.0), element.find("inertia")
    if mass < 0.0:
        fail(element.find("mass"), "mass is {:g}".format(mass), "a positive mass in kg")
    unit = (("ixx", 1.0), ("ixy", 0.0), ("ixz", 0.0), ("iyy", 1.0), ("iyz", 0.0), ("izz", 1.0))
    inertia = tuple(child_float(tensor, key, default) for key, default in unit)
    return Inertial(mass, pose, inertia)


def inertia_matrix(inertial):
    """Return the (3, 3) tensor of an Inertial in its own centre of mass frame [kg m^2]."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertial_fault(inertial):
    """Return what makes an inertial unusable for a moving body as (found, expected), or None if it is usable."""
    if inertial.mass <= 0.0:
        return "mass is {:g}".format(inertial.mass), "a positive mass in kg"
    if np.linalg.eigvalsh(inertia_matrix(inertial))[0] <= 0.0:
        return ("the inertia tensor (ixx ixy ixz iyy iyz izz = {}) is not positive definite".format(
            " ".join("{:g}".format(value) for value in inertial.inertia)),
            "three positive principal moments")
    return None


def inertial_doubt(inertial):
    """Return a sentence part if no real body has this tensor (triangle inequality broken), else None."""
    low, middle, high = np.linalg.eigvalsh(inertia_matrix(inertial))
    if high > (low + middle) * (1.0 + 1e-6):
        return "principal moments {:g}, {:g}, {:g}: the largest exceeds the sum of the others, which no real body " \
               "can have".format(low, middle, high)
    return None
