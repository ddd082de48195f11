"""``<joint>`` of SDF -> Joint, with the axis conventions of the SDF versions."""
import math

from m2wr_sim.geometry import compose, rotate, rotate_inverse
from m2wr_sim.model.safe_xml import child_bool, child_float, child_text, child_vector, fail, line_of, required_name
from m2wr_sim.model.types import Axis, Joint

NO_LIMIT = 1e16

_KINDS = ("revolute", "prismatic", "fixed", "ball", "universal")
_UNUSED_KINDS = ("revolute2", "screw", "gearbox")
_READ = frozenset(("parent", "child", "pose", "axis", "axis2", "physics"))
_DYNAMICS_READ = ("damping", "friction", "spring_stiffness", "spring_reference")
_AXIS_READ = frozenset(("xyz", "use_parent_model_frame", "dynamics", "limit"))


def unit(element, vector):
    """Return a vector scaled to length one; XmlError if it has no length."""
    length = math.sqrt(sum(value * value for value in vector))
    if length < 1e-9:
        fail(element, "the axis has no length", "a direction such as 0 0 1")
    return tuple(value / length for value in vector)


def clamp_limit(value):
    """Return a joint limit with infinity as the +-1e16 that stands for none."""
    return max(-NO_LIMIT, min(NO_LIMIT, value))


def _axis(element, joint, model_from_joint, frames, version, notes):
    """Read one axis; ``model_from_joint`` is the joint frame in the model frame."""
    stop = joint.find("physics/ode/limit")
    defaults = Axis()
    erp, cfm = child_float(stop, "erp", defaults.stop_erp), child_float(stop, "cfm", defaults.stop_cfm)
    if element is None:
        return Axis(stop_erp=erp, stop_cfm=cfm)
    notes.unread(element, _AXIS_READ, ("initial_position",))
    dynamics, limit = element.find("dynamics"), element.find("limit")
    if dynamics is not None:
        notes.unread(dynamics, _DYNAMICS_READ)
    if limit is not None:
        notes.unread(limit, ("lower", "upper", "effort", "velocity"))
    xyz = unit(element, child_vector(element, "xyz", 3, defaults.xyz))
    xyz_element = element.find("xyz")
    expressed_in = None if xyz_element is None else (xyz_element.get("expressed_in") or "").strip()
    in_model_frame = child_bool(element, "use_parent_model_frame", version <= (1, 4))
    if expressed_in:
        xyz = rotate_inverse(model_from_joint[1], rotate(frames.resolve(expressed_in, xyz_element)[1], xyz))
    elif in_model_frame:
        xyz = rotate_inverse(model_from_joint[1], xyz)
    lower = clamp_limit(child_float(limit, "lower", defaults.lower, True))
    upper = clamp_limit(child_float(limit, "upper", defaults.upper, True))
    if lower > upper:
        notes.add("{}: the lower limit {:g} is above the upper limit {:g}; they are exchanged.".format(
            line_of(limit), lower, upper))
        lower, upper = upper, lower
    values = {name: child_float(dynamics, name, 0.0) for name in _DYNAMICS_READ}
    return Axis(xyz=xyz, lower=lower, upper=upper, effort=_no_limit(child_float(limit, "effort", -1.0, True)),
                velocity=_no_limit(child_float(limit, "velocity", -1.0, True)), stop_erp=erp, stop_cfm=cfm, **values)


def _no_limit(value):
    return -1.0 if math.isinf(value) else value


def read_joint(element, links, frames, version, notes):
    """Read one ``<joint>``.

    Parameters
    ----------
    element : lxml element
    links : dict
        Link name -> pose in the model frame; nested links under scoped names.
    frames : Frames
        The model's frames, for ``relative_to`` and ``expressed_in``.
    version : tuple of int
        SDF version; up to 1.4 axes are given in the model frame.
    notes : Notes

    Returns
    -------
    Joint or None
        None for a joint type that has no counterpart here (noted).

    Raises
    ------
    XmlError
        If type, parent or child are missing or name no link, or a value is unusable.
    """
    name, kind = required_name(element), (element.get("type") or "").strip()
    if kind == "continuous":
        kind = "revolute"
    if kind in _UNUSED_KINDS:
        notes.add('{}: joint "{}" of type {} is not supported; its links stay unconnected.'.format(
            line_of(element), name, kind))
        return None
    if kind not in _KINDS:
        fail(element, 'joint type is "{}"'.format(kind), "one of " + ", ".join(_KINDS))
    notes.unread(element, _READ, ("sensor", "gearbox_ratio", "gearbox_reference_body", "thread_pitch"))
    ends = []
    for tag in ("parent", "child"):
        end = child_text(element, tag) or child_text(element.find(tag), "link")
        if not end:
            fail(element, "<{}> is missing".format(tag), "the name of a link there")
        if end not in links and not (end == "world"):
            fail(element.find(tag), '{} "{}" is no link of the model'.format(tag, end),
                 "one of " + ", ".join(sorted(links)) + (" or world" if tag == "parent" else ""))
        ends.append(end)
    parent, child = ends
    if child == parent:
        fail(element, 'parent and child are both "{}"'.format(child), "two different links")
    if child == "world":
        fail(element.find("child"), "child is the world", "the moving link as child and the world as parent")
    pose = frames.pose_in(element, child)
    model_from_joint = compose(links[child], pose)
    axis = _axis(element.find("axis"), element, model_from_joint, frames, version, notes)
    axis2 = None
    if kind == "universal":
        axis2 = _axis(element.find("axis2"), element, model_from_joint, frames, version, notes)
    return Joint(name=name, kind=kind, parent=parent, child=child, pose=pose, axis=axis, axis2=axis2)
