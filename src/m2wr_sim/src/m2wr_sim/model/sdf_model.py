"""``<model>`` and ``<include>`` of SDF -> Model; nested models are flattened into their outermost one."""
import os
from dataclasses import dataclass, field, replace
from typing import Any, Callable, Dict, Optional, Tuple

from m2wr_sim.geometry import compose
from m2wr_sim.model.mesh_shapes import MeshReader
from m2wr_sim.model.model_folders import NEWEST_SDF, parse_version
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.plugin_spec import read_plugin
from m2wr_sim.model.safe_xml import (child_bool, child_float, child_text, fail, line_of, parse_bool, parse_xml, path_of,
                                     place, read_file, required_name)
from m2wr_sim.model.sdf_frames import Frames, raw_pose
from m2wr_sim.model.sdf_joint import read_joint
from m2wr_sim.model.sdf_light import read_light
from m2wr_sim.model.sdf_sensor import read_sensor
from m2wr_sim.model.sdf_shapes import inertial_doubt, inertial_fault, read_collision, read_inertial, read_visual
from m2wr_sim.model.types import Heightmap, Link, Model, Plane

MAX_NESTING = 32

_MODEL_READ = frozenset(("pose", "static", "self_collide", "allow_auto_disable", "plugin", "link", "joint", "model",
                         "include", "frame"))
_MODEL_SILENT = frozenset(("enable_wind", "description", "author"))
_LINK_READ = frozenset(("pose", "inertial", "collision", "visual", "sensor", "gravity", "self_collide", "kinematic",
                        "velocity_decay"))
_LINK_SILENT = frozenset(("enable_wind", "light", "audio_sink", "audio_source", "must_be_base_link", "projector",
                          "battery", "particle_emitter"))
_INCLUDE_READ = frozenset(("uri", "name", "pose", "static", "plugin"))


@dataclass
class SdfContext:
    """What reading one SDF document carries along: notes, the model finder, and the files being included."""

    notes: Notes
    resolve_model: Optional[Callable[[str], Optional[str]]] = None
    including: Tuple[str, ...] = ()
    roots: Dict[str, Any] = field(default_factory=dict)     # file -> parsed root, each file is parsed once
    models: Dict[Any, Model] = field(default_factory=dict)  # (file, static) -> model as the file has it
    nesting: int = 0


def version_of(element):
    """Return the SDF version of the document an element stands in, (1, 6) where it does not say."""
    return parse_version(element.getroottree().getroot().get("version")) or (1, 6)


def check_root(root, notes):
    """Raise XmlError unless ``root`` is ``<sdf>`` (or ``<gazebo>`` of the first files); note a too new version."""
    if root.tag not in ("sdf", "gazebo"):
        fail(root, "the root element is <{}>".format(root.tag), "<sdf>")
    if version_of(root) > NEWEST_SDF:
        notes.add("{}: SDF version {} is newer than {}.{}; what is new in it is not read.".format(
            line_of(root), root.get("version"), *NEWEST_SDF))


def _read_shapes(element, tag, reader, frames, link_name, notes):
    shapes, names = [], set()
    for child in element.findall(tag):
        shape = reader(child, frames.pose_in(child, link_name), notes)
        if shape is None:
            continue
        if shape.name in names:
            notes.add("{}: the link has another {} of this name; the first is kept.".format(place(child), tag))
            continue
        names.add(shape.name)
        shapes.append(shape)
    return tuple(shapes)


def _read_link(element, frames, static, self_collide, notes, files):
    name = required_name(element)
    notes.unread(element, _LINK_READ, _LINK_SILENT)
    inertial_element = element.find("inertial")
    decay = element.find("velocity_decay")
    inertial_pose = None if inertial_element is None else frames.pose_in(inertial_element, name)
    inertial = read_inertial(inertial_element, inertial_pose)
    if not static:
        fault = inertial_fault(inertial)
        if fault is not None:
            fail(element if inertial_element is None else inertial_element, fault[0], fault[1])
        doubt = inertial_doubt(inertial)
        if doubt is not None:
            notes.add("{}: {}.".format(place(inertial_element), doubt))
    collisions = _read_shapes(element, "collision", lambda *arguments: read_collision(*arguments, files), frames, name,
                              notes)
    if not static and any(isinstance(collision.geometry, (Plane, Heightmap)) for collision in collisions):
        notes.add("{}: a plane or heightmap in a model that is not static stays where the model is loaded.".format(
            place(element)))
    return Link(
        name=name, pose=frames.resolve(name), inertial=inertial, collisions=collisions,
        visuals=_read_shapes(element, "visual", read_visual, frames, name, notes),
        sensors=tuple(read_sensor(child, name, notes, lambda sensor: frames.pose_in(sensor, name))
                      for child in element.findall("sensor")),
        gravity=child_bool(element, "gravity", True), self_collide=child_bool(element, "self_collide", self_collide),
        kinematic=child_bool(element, "kinematic", False),
        linear_damping=child_float(decay, "linear", 0.0), angular_damping=child_float(decay, "angular", 0.0))


def _scoped(prefix, model, model_from_nested):
    """Return links, joints and nested names of a nested model, named and placed as the outer model has them."""
    def scope(name):
        return name if name == "world" else prefix + "::" + name

    links = [replace(link, name=scope(link.name), pose=compose(model_from_nested, link.pose),
                     sensors=tuple(replace(sensor, plugins=tuple(replace(plugin, reference=scope(link.name))
                                                                 for plugin in sensor.plugins))
                                   for sensor in link.sensors)) for link in model.links]
    joints = [replace(joint, name=scope(joint.name), parent=scope(joint.parent), child=scope(joint.child))
              for joint in model.joints]
    return links, joints, [prefix] + [scope(name) for name in model.nested]


def _named_once(elements, kind, notes):
    """Yield (name, element), leaving out later elements of a name already used (noted)."""
    names = set()
    for element in elements:
        name = required_name(element)
        if name in names:
            notes.add('{}: there is another {} "{}" in <{}>; this one is skipped.'.format(
                line_of(element), kind, name, path_of(element.getparent())))
            continue
        names.add(name)
        yield name, element


def _nested_models(element, context, static):
    """Return [(Model, element, relative_to)] of the models inside a model, both inline and included."""
    found, names = [], set()
    for child in element:
        if child.tag == "model":
            model, relative_to = read_model(child, context, static), raw_pose(child)[1]
        elif child.tag == "include":
            model, relative_to = read_include(child, context, static)[0], raw_pose(child)[1]
        else:
            continue
        if model is None:
            continue
        if not static and child_bool(child, "static", False):
            context.notes.add('{}: nested model "{}" is static, but its outermost model is not; it is taken as '
                              'moving.'.format(line_of(child), model.name))
        if model.name in names:
            context.notes.add('{}: there is another nested model "{}"; this one is skipped.'.format(
                line_of(child), model.name))
            continue
        names.add(model.name)
        found.append((model, child, relative_to))
    return found


def _frames_of(element, link_elements, nested, notes):
    """Return the Frames of a model: links, joints, ``<frame>`` elements, nested models and their links."""
    frames = Frames(notes)
    for name, child in link_elements:
        frames.add(name, *raw_pose(child), child)
    for model, child, relative_to in nested:
        frames.add(model.name, model.pose, relative_to, child)
        for link in model.links:
            frames.add(model.name + "::" + link.name, link.pose, model.name, child)
    for child in element.findall("joint"):
        pose, relative_to = raw_pose(child)
        frames.add(required_name(child), pose, relative_to or child_text(child, "child"), child)
    for child in element.findall("frame"):
        pose, relative_to = raw_pose(child)
        frames.add(required_name(child), pose, relative_to or child.get("attached_to") or None, child)
    return frames


def read_model(element, context, static=None):
    """Read one ``<model>``.

    Parameters
    ----------
    element : lxml element
    context : SdfContext
        Receives notes; finds included models.
    static : bool or None
        Given by an include or an outer model, wins over the model's own ``<static>``.

    Returns
    -------
    Model
        ``pose`` is the model's own; links of nested models carry scoped names and poses in this model's frame.

    Raises
    ------
    XmlError
        Where a name, number, geometry, inertia or joint is unusable, or models are nested too deep.
    """
    name, notes = required_name(element), context.notes
    if context.nesting >= MAX_NESTING:
        fail(element, "models are nested deeper than {}".format(MAX_NESTING), "fewer levels")
    notes.unread(element, _MODEL_READ, _MODEL_SILENT)
    if static is None:
        static = child_bool(element, "static", False)
    context.nesting += 1
    nested = _nested_models(element, context, static)
    context.nesting -= 1
    link_elements = list(_named_once(element.findall("link"), "link", notes))
    frames = _frames_of(element, link_elements, nested, notes)
    self_collide = child_bool(element, "self_collide", False)
    files = MeshReader(notes, context.resolve_model)
    links = [_read_link(child, frames, static, self_collide, notes, files) for _, child in link_elements]
    joints, plugins, nested_names = [], [read_plugin(child) for child in element.findall("plugin")], []
    for model, _, _ in nested:
        more_links, more_joints, more_names = _scoped(model.name, model, frames.resolve(model.name))
        links, joints, nested_names = links + more_links, joints + more_joints, nested_names + more_names
        plugins.extend(model.plugins)
    poses = {link.name: link.pose for link in links}
    for _, child in _named_once(element.findall("joint"), "joint", notes):
        joint = read_joint(child, poses, frames, version_of(child), notes)
        if joint is not None:
            joints.append(joint)
    return Model(name=name, links=tuple(links), joints=tuple(joints), pose=raw_pose(element)[0], static=static,
                 plugins=tuple(plugins), nested=tuple(nested_names),
                 allow_auto_disable=child_bool(element, "allow_auto_disable", True))


def _find_included(element, context):
    """Return (path, root) of the file an include names, or None where it is not on this machine (noted)."""
    uri = child_text(element, "uri")
    if not uri:
        fail(element, "<uri> is missing or empty", "model://NAME there")
    path = None if context.resolve_model is None else context.resolve_model(uri)
    if path is None:
        context.notes.add("{}: {} was not found (searched: {}; nothing is downloaded); it is left out.".format(
            line_of(element), uri, context.resolve_model or "no folders"))
        return None
    path = os.path.realpath(path)
    if path in context.including:
        fail(element, "{} includes itself ({})".format(uri, " -> ".join(context.including + (path,))),
             "includes that do not form a ring")
    if path not in context.roots:
        context.roots[path] = parse_xml(read_file(path), path)
        check_root(context.roots[path], context.notes)
    return path, context.roots[path]


def read_include(element, context, static=None):
    """Read one ``<include>``: the named model with the include's own name, pose, static and plugins.

    Returns
    -------
    model : Model or None
        None where the file holds a light, or nothing of use, or is not on this machine (both noted).
    lights : tuple of Light
        The light that the file holds, if any.

    Raises
    ------
    XmlError
        If the file is malformed or includes itself.
    """
    context.notes.unread(element, _INCLUDE_READ)
    found = _find_included(element, context)
    if found is None:
        return None, ()
    path, root = found
    name = child_text(element, "name") or None
    lights = root.findall("light")
    model_element = root.find("model")
    if model_element is None:
        if not lights:
            context.notes.add("{}: {} ({}) holds neither <model> nor <light>; it is left out.".format(
                line_of(element), child_text(element, "uri"), path))
        found = tuple(read_light(light, context.notes) for light in lights[:1])
        return None, tuple(replace(light, name=name or light.name) for light in found)
    static_text = child_text(element, "static")
    if static is None and static_text:
        static = parse_bool(element.find("static"), static_text, "static")
    key = (path, static)
    if key not in context.models:
        outer, context.including = context.including, context.including + (path,)
        context.nesting += 1
        context.models[key] = read_model(model_element, context, static)
        context.nesting -= 1
        context.including = outer
    model = context.models[key]
    pose = model.pose if element.find("pose") is None else raw_pose(element)[0]
    return replace(model, name=name or model.name, pose=pose, plugins=model.plugins + tuple(
        read_plugin(child) for child in element.findall("plugin"))), ()
