# SPDX-License-Identifier: BSD-3-Clause
"""``<model>`` and ``<include>`` of SDF -> Model; nested models are flattened into their outermost one."""
import logging
import os
from dataclasses import dataclass, field, replace
from typing import Any, Callable, Dict, Optional, Tuple

from m2wr_sim.geometry import compose, invert
from m2wr_sim.model.inertials import mass_fault, usable
from m2wr_sim.model.mesh.shapes import MeshReader
from m2wr_sim.model.model_folders import HOW_TO_INSTALL, NEWEST_SDF, parse_version, tell_stand_in
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.plugin_spec import read_plugin
from m2wr_sim.model.sdf.frames import Frames, raw_pose
from m2wr_sim.model.sdf.joint import named_end, read_joint
from m2wr_sim.model.sdf.light import read_light
from m2wr_sim.model.sdf.node import Node
from m2wr_sim.model.sdf.sensor import read_sensor
from m2wr_sim.model.sdf.shapes import inertial_doubt, read_collision, read_inertial, read_visual
from m2wr_sim.model.types import Heightmap, Link, Model, Plane
from m2wr_sim.model.xml.safe import XmlError, fail, line_of, parse_xml, path_of, read_file

log = logging.getLogger(__name__)

MAX_NESTING = 32
_PROGRESS = 10000       # links between two lines about how far reading has come


@dataclass
class SdfContext:
    """What reading one SDF document carries along: notes, the model finder, and the files being included."""

    notes: Notes
    resolve_model: Optional[Callable[[str], Optional[str]]] = None
    including: Tuple[str, ...] = ()
    roots: Dict[str, Any] = field(default_factory=dict)     # file -> parsed root or its XmlError, each is parsed once
    models: Dict[Any, Any] = field(default_factory=dict)    # (file, static) -> model as the file has it, or XmlError
    nesting: int = 0
    most_parts: Optional[int] = None                        # links and collisions together; None: any number
    links: int = 0
    parts: int = 0

    def count(self, node, collisions):
        """Count a link and log the progress from time to time.

        Raises
        ------
        XmlError
            If there are more links and collisions than wanted.
        """
        self.links += 1
        self.parts += 1 + collisions
        if self.links % _PROGRESS == 0:
            log.info("%d links read so far", self.links)
        if self.most_parts is not None and self.parts > self.most_parts:
            node.fail("up to here there are {} links and collisions".format(self.parts),
                      "at most {}".format(self.most_parts))


def version_of(element):
    """Return the SDF version of an element's document, (1, 6) by default."""
    return parse_version(element.getroottree().getroot().get("version")) or (1, 6)


def check_root(root, notes):
    """Raise XmlError unless ``root`` is ``<sdf>`` (or ``<gazebo>`` of the first files); note a too new version."""
    if root.tag not in ("sdf", "gazebo"):
        fail(root, "the root element is <{}>".format(root.tag), "<sdf>")
    if version_of(root) > NEWEST_SDF:
        notes.add("{}: SDF version {} is newer than {}.{}; new elements are ignored.".format(
            line_of(root), root.get("version"), *NEWEST_SDF))


def _read_shapes(node, tag, reader, frames, link_name):
    """Return the collisions or visuals of a link; ``reader(node, pose)`` reads one."""
    shapes, names = [], set()
    for child in node.children(tag):
        shape = node.notes.attempt("this " + tag, reader, child, frames.pose_in(child, link_name))
        if shape is None:
            child.ignore()
        elif shape.name in names:
            child.ignore()
            node.notes.add("{}: the link has another {} of this name; the first is kept.".format(child.place, tag))
        else:
            names.add(shape.name)
            shapes.append(shape)
    return tuple(shapes)


def _inertial(node, name, frames, static, collisions):
    """Return the Inertial of a link; XmlError where a moving one would have no mass."""
    inertial_node = node.child("inertial")
    inertial = read_inertial(inertial_node, frames.pose_in(inertial_node, name) if inertial_node else None)
    if static:
        return inertial
    fault = mass_fault(inertial)
    if fault is not None:
        fail(inertial_node.element, *fault)
    inertial, problem = usable(inertial, collisions)
    for sentence in (problem, inertial_doubt(inertial)):
        if sentence is not None:
            node.notes.add("{}: {}.".format(inertial_node.place, sentence))
    return inertial


def _read_link(node, frames, static, self_collide, files):
    """Read one ``<link>``; XmlError only where it moves and has no mass."""
    name, notes, decay = node.name(), node.notes, node.child("velocity_decay")
    collisions = _read_shapes(node, "collision", lambda *arguments: read_collision(*arguments, files), frames, name)
    inertial = _inertial(node, name, frames, static, collisions)
    if not static and any(isinstance(collision.geometry, (Plane, Heightmap)) for collision in collisions):
        notes.add("{}: a plane or heightmap in a model that is not static stays where the model is loaded.".format(
            node.place))
    sensors = []
    for child in node.children("sensor"):
        sensor = notes.attempt("this sensor", read_sensor, child, name, lambda found: frames.pose_in(found, name))
        if sensor is None:
            child.ignore()
        else:
            sensors.append(sensor)
    raw_pose(node)      # its place is in the frames already
    link = Link(
        name=name, pose=frames.resolve(name), inertial=inertial, collisions=collisions,
        visuals=_read_shapes(node, "visual", read_visual, frames, name), sensors=tuple(sensors),
        gravity=node.flag("gravity", True), self_collide=node.flag("self_collide", self_collide),
        kinematic=node.flag("kinematic", False),
        linear_damping=decay.number("linear", 0.0), angular_damping=decay.number("angular", 0.0))
    node.done()
    return link


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


def _nested_plugins(model, model_from_nested):
    """Return the model plugins of a nested model, which know its links and joints by their own names."""
    return [replace(plugin, scope="::".join(filter(None, (model.name, plugin.scope))),
                    frame=compose(model_from_nested, plugin.frame)) for plugin in model.plugins]


def _named_once(nodes, kind, notes):
    """Return [(name, node)], leaving out those without a name and later ones of a name already used (noted)."""
    found = {}
    for node in nodes:
        name = notes.attempt("this " + kind, node.name)
        if name in found:
            notes.add('{}: there is another {} "{}" in <{}>; this one is skipped.'.format(
                node.line, kind, name, path_of(node.element.getparent())))
        if name is None or name in found:
            node.ignore()
        else:
            found[name] = node
    return list(found.items())


def _nested_models(node, context, static):
    """Return [(Model, node, relative_to)] of the models inside a model, both inline and included."""
    found, names, notes = [], set(), context.notes
    models, includes = iter(node.children("model")), iter(node.children("include"))
    for tag in node.tags():
        if tag not in ("model", "include"):
            continue
        child = next(models if tag == "model" else includes)
        relative_to, is_static = raw_pose(child)[1], child.flag("static", False)
        if tag == "model":
            model = notes.attempt("this model", read_model, child, context, static)
        else:
            model = read_include(child, context, static)[0]
        if model is None:
            child.ignore()
            continue
        if not static and is_static:
            notes.add('{}: nested model "{}" is static, but its outermost model is not; it is '
                      'treated as moving.'.format(child.line, model.name))
        if model.name in names:
            notes.add('{}: there is another nested model "{}"; this one is skipped.'.format(child.line, model.name))
            continue
        names.add(model.name)
        found.append((model, child, relative_to))
    return found


def _frames_of(node, link_nodes, joint_nodes, nested):
    """Return the Frames of a model: links, joints, ``<frame>`` elements, nested models and their links."""
    frames = Frames(node.notes)
    for name, child in link_nodes:
        frames.add(name, *raw_pose(child), child)
    for model, child, relative_to in nested:
        frames.add(model.name, model.pose, relative_to, child)
        for link in model.links:
            frames.add(model.name + "::" + link.name, link.pose, model.name, child)
    add_frames(node, frames)
    for name, child in joint_nodes:
        pose, relative_to = raw_pose(child)
        relative_to = relative_to or named_end(child, "child", node.name(), frames.has)
        if frames.has(relative_to):       # otherwise there is a warning about the joint
            frames.add(name, pose, relative_to, child)
    frames.settle()
    return frames


def add_frames(node, frames):
    """Add the ``<frame>`` elements of a model or world."""
    for name, child in _named_once(node.children("frame"), "frame", node.notes):
        pose, relative_to = raw_pose(child)
        frames.add(name, pose, relative_to or child.attribute("attached_to") or None, child)


def read_plugins(node):
    """Return the PluginSpecs of the ``<plugin>`` elements in a node; those that cannot be read are left out (noted)."""
    found = []
    for child in node.children("plugin"):
        found.append(node.notes.attempt("this plugin", read_plugin, child.element, None, node.notes))
        child.ignore()
    return [plugin for plugin in found if plugin is not None]


def _joints(node, joint_nodes, links, frames):
    """Return the Joints that can be made; the others are left out (noted), as in Gazebo."""
    poses, joints = {link.name: link.pose for link in links}, []
    for _, child in joint_nodes:
        joint = node.notes.attempt("this joint", read_joint, child, poses, frames, version_of(node.element),
                                   node.name())
        if joint is None:
            child.ignore()
        else:
            joints.append(joint)
    return joints


def _put_down(node, pose, name, frames):
    """Return the model's pose, where what ``<pose>`` places is another frame of it (SDF 1.8)."""
    if not name:
        return pose
    return compose(pose, invert(frames.resolve(name, node)))


def read_model(node, context, static=None):
    """Read one ``<model>``.

    Parameters
    ----------
    node : Node
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
        Where it has no name, a link that moves has no mass, or models are nested too deep.  Whatever else
        is unusable is left out with a warning.
    """
    name, notes = node.name(), context.notes
    if context.nesting >= MAX_NESTING:
        node.fail("models are nested deeper than {}".format(MAX_NESTING), "fewer levels")
    own_static = node.flag("static", False)
    static = own_static if static is None else static
    context.nesting += 1
    nested = _nested_models(node, context, static)
    context.nesting -= 1
    link_nodes = _named_once(node.children("link"), "link", notes)
    joint_nodes = _named_once(node.children("joint"), "joint", notes)
    frames = _frames_of(node, link_nodes, joint_nodes, nested)
    self_collide = node.flag("self_collide", False)
    files = MeshReader(notes, context.resolve_model)
    links = []
    for _, child in link_nodes:
        links.append(_read_link(child, frames, static, self_collide, files))
        context.count(child, len(links[-1].collisions))
    plugins, joints, nested_names = read_plugins(node), [], []
    for model, _, _ in nested:
        more_links, more_joints, more_names = _scoped(model.name, model, frames.resolve(model.name))
        links, joints, nested_names = links + more_links, joints + more_joints, nested_names + more_names
        plugins.extend(_nested_plugins(model, frames.resolve(model.name)))
    joints += _joints(node, joint_nodes, links, frames)
    _tell_canonical(node, links)
    pose = _put_down(node, raw_pose(node)[0], node.attribute("placement_frame"), frames)
    model = Model(name=name, links=tuple(links), joints=tuple(joints), pose=pose, static=static,
                  plugins=tuple(plugins), nested=tuple(nested_names),
                  allow_auto_disable=node.flag("allow_auto_disable", True))
    node.done()
    return model


def _tell_canonical(node, links):
    canonical = node.attribute("canonical_link")
    if canonical and links and canonical != links[0].name:
        node.notes.add('{}: attribute canonical_link of <model> is "{}"; the first link, "{}", stands for the model '
                       'here.'.format(node.line, canonical, links[0].name))


def _find_included(node, context):
    """Return (path, root element) of the file an include names, or None where it is not on this machine (noted)."""
    uri = node.text("uri")
    if not uri:
        node.fail("<uri> is missing or empty", "model://NAME there")
    path = None if context.resolve_model is None else context.resolve_model(uri)
    if path is None:
        context.notes.add("{}: {} was not found (searched: {}; nothing is downloaded); it is left out ({}).".format(
            node.line, uri, context.resolve_model or "no folders", HOW_TO_INSTALL))
        return None
    tell_stand_in(context.notes, context.resolve_model, path)
    path = os.path.realpath(path)
    if path in context.including:
        node.fail("{} includes itself ({})".format(uri, " -> ".join(context.including + (path,))),
                  "includes that do not form a ring")
    if path not in context.roots:
        try:
            context.roots[path] = parse_xml(read_file(path), path)
            check_root(context.roots[path], context.notes)
        except XmlError as error:
            context.roots[path] = error
    return path, _or_raise(context.roots[path])


def _or_raise(found):
    if isinstance(found, XmlError):
        raise found
    return found


def _included_model(element, path, static, context):
    """Return the model in an included file; each file is read once for each ``static``.

    Raises
    ------
    XmlError
        If it cannot be made, the same for every include of it.
    """
    key = (path, static)
    if key not in context.models:
        outer, context.including = context.including, context.including + (path,)
        nesting, context.nesting = context.nesting, context.nesting + 1
        try:
            context.models[key] = read_model(Node(element, context.notes), context, static)
        except XmlError as error:
            context.models[key] = error
        context.nesting, context.including = nesting, outer
    return _or_raise(context.models[key])


def read_include(node, context, static=None):
    """Read one ``<include>``: the named model with the include's own name, pose, static and plugins.

    An include that cannot be used, because its file is malformed, leaves its folder or includes itself, is left out
    with a warning.

    Parameters
    ----------
    node : Node
    context : SdfContext
    static : bool or None
        As for :func:`read_model`.

    Returns
    -------
    model : Model or None
        None where the file holds a light, or nothing of use, or is not on this machine (both noted).
    lights : tuple of Light
        The light that the file holds, if any.
    """
    found = context.notes.attempt("this include", _read_include, node, context, static,
                                  subject=("include", node.text("uri")) if node.text("uri") else None)
    if found is None:
        node.ignore()
        return None, ()
    node.done()
    return found


def _read_include(node, context, static):
    found = _find_included(node, context)
    plugins = read_plugins(node)
    name, own_static, placed = node.text("name") or None, node.flag("static", None), node.text("placement_frame")
    pose = raw_pose(node)[0]
    _tell_merge(node)
    if found is None:
        return None, ()
    path, root = found
    lights, model_element = root.findall("light"), root.find("model")
    if model_element is None:
        if not lights:
            context.notes.add("{}: {} ({}) holds neither <model> nor <light>; it is left out.".format(
                node.line, node.text("uri"), path))
        read = [read_light(Node(light, context.notes)) for light in lights[:1]]
        return None, tuple(replace(light, name=name or light.name) for light in read)
    try:
        model = _included_model(model_element, path, own_static if static is None else static, context)
    except XmlError as error:
        raise XmlError("{} (in {}: {})".format(error, node.line, node.text("uri"))) from None
    if node.has("pose"):
        frames = {link.name: link.pose for link in model.links}
        if placed and placed not in frames:
            context.notes.add('{}: placement_frame "{}" is no link of {}; the model\'s own frame is placed.'.format(
                node.line, placed, model.name))
        model = replace(model, pose=compose(pose, invert(frames[placed])) if placed in frames else pose)
    return replace(model, name=name or model.name, plugins=model.plugins + tuple(plugins)), ()


def _tell_merge(node):
    if node.attribute("merge").lower() in ("true", "1"):
        node.notes.add("{}: unsupported attribute merge of <include> ignored; the included model stays a "
                       "nested model, its links are NAME::LINK.".format(node.line), ("attribute", "include", "merge"))
