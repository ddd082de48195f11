# SPDX-License-Identifier: BSD-3-Clause
"""``<model>`` and ``<include>`` of SDF -> Model; nested models are flattened into their outermost one."""
from __future__ import annotations

import logging
import os
from dataclasses import dataclass, field, replace
from functools import partial
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Dict,
    Iterable,
    List,
    Optional,
    Sequence,
    Set,
    Tuple,
    TypeVar,
    Union,
)

from m2wr_sim.geometry import IDENTITY, compose, invert
from m2wr_sim.model.inertials import mass_fault, usable
from m2wr_sim.model.mesh.shapes import MeshReader
from m2wr_sim.model.model_folders import HOW_TO_INSTALL, NEWEST_SDF, parse_version, tell_stand_in
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.plugin_spec import read_plugin
from m2wr_sim.model.sdf.frames import Frames, raw_pose
from m2wr_sim.model.sdf.gears import read_gear
from m2wr_sim.model.sdf.joint import named_end, read_joint
from m2wr_sim.model.sdf.known_links import KnownLinks
from m2wr_sim.model.sdf.light import read_light
from m2wr_sim.model.sdf.nesting import merged, merged_plugins, merges, nested_plugins, scoped, settled
from m2wr_sim.model.sdf.node import Node
from m2wr_sim.model.sdf.sensor import read_sensor
from m2wr_sim.model.sdf.shapes import inertial_doubt, read_collision, read_inertial, read_visual
from m2wr_sim.model.types import Heightmap, Link, Model, Plane
from m2wr_sim.model.xml.safe import XmlError, fail, line_of, parse_xml, path_of, read_file

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.model_folders import ResolveModel
    from m2wr_sim.model.types import Collision, Inertial, Joint, Light, PluginSpec, Visual

    _Shape = TypeVar("_Shape", Collision, Visual)
    _Found = TypeVar("_Found")
    _Included = Tuple[Optional[Model], Tuple[Light, ...]]

log = logging.getLogger(__name__)

MAX_NESTING = 32
_PROGRESS = 10000       # links between two log messages about the progress


@dataclass
class SdfContext:
    """State of reading one SDF document: notes, the model finder, and the files being included."""

    notes: Notes
    resolve_model: Optional[ResolveModel] = None
    including: Tuple[str, ...] = ()
    roots: Dict[str, Any] = field(default_factory=dict)     # file -> parsed root or its XmlError, each is parsed once
    # (file, static) -> model as in the file, or XmlError
    models: Dict[Tuple[str, Optional[bool]], Union[Model, XmlError]] = field(default_factory=dict)
    known_links: KnownLinks = field(default_factory=KnownLinks)
    nesting: int = 0
    most_parts: Optional[int] = None                        # links and collisions together; None: any number
    links: int = 0
    parts: int = 0

    def count(self, node: Node, collisions: int) -> None:
        """Count a link and log the progress from time to time.

        Parameters
        ----------
        node : Node
            The link.
        collisions : int
            Number of its collisions.

        Raises
        ------
        XmlError
            If there are more than ``most_parts`` links and collisions.
        """
        self.links += 1
        self.parts += 1 + collisions
        if self.links % _PROGRESS == 0:
            log.info("%d links read so far", self.links)
        if self.most_parts is not None and self.parts > self.most_parts:
            node.fail("up to here there are {} links and collisions".format(self.parts),
                      "at most {}".format(self.most_parts))


def version_of(element: Any) -> Tuple[int, ...]:
    """Return the SDF version of an element's document, (1, 6) by default."""
    return parse_version(element.getroottree().getroot().get("version")) or (1, 6)


def check_root(root: Any, notes: Notes) -> None:
    """Check root element and version of a document; a version that is too new gives a warning.

    Parameters
    ----------
    root : lxml element
    notes : Notes

    Raises
    ------
    XmlError
        If it is not ``<sdf>``, or ``<gazebo>`` of the first files.
    """
    if root.tag not in ("sdf", "gazebo"):
        fail(root, "the root element is <{}>".format(root.tag), "<sdf>")
    if version_of(root) > NEWEST_SDF:
        notes.add("{}: SDF version {} is newer than {}.{}; new elements are ignored.".format(
            line_of(root), root.get("version"), *NEWEST_SDF))


def _read_shapes(node: Node, tag: str, reader: Callable[[Node, Pose], Optional[_Shape]], frames: Frames,
                 link_name: str) -> Tuple[_Shape, ...]:
    """Return the collisions or visuals of a link; ``reader(node, pose)`` reads one."""
    shapes: List[_Shape] = []
    names: Set[str] = set()
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


def _inertial(node: Node, name: str, frames: Frames, static: bool, collisions: Sequence[Collision]) -> Inertial:
    """Return the Inertial of a link; XmlError where a moving one would have no mass."""
    inertial_node = node.child("inertial")
    inertial = read_inertial(inertial_node, frames.pose_in(inertial_node, name) if inertial_node else IDENTITY)
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


def _read_link(node: Node, frames: Frames, static: bool, self_collide: bool, files: MeshReader) -> Link:
    """Read one ``<link>``; XmlError only where it moves and has no mass."""
    name, notes, decay = node.name(), node.notes, node.child("velocity_decay")
    collisions = _read_shapes(node, "collision", lambda child, pose: read_collision(child, pose, files), frames, name)
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
    raw_pose(node)      # marks it as read; the frames have it already
    link = Link(
        name=name, pose=frames.resolve(name), inertial=inertial, collisions=collisions,
        visuals=_read_shapes(node, "visual", lambda child, pose: read_visual(child, pose, files), frames, name),
        sensors=tuple(sensors),
        gravity=node.flag("gravity", True), self_collide=node.flag("self_collide", self_collide),
        kinematic=node.flag("kinematic", False),
        linear_damping=decay.number("linear", 0.0), angular_damping=decay.number("angular", 0.0))
    node.done()
    return link


def _named_once(nodes: Iterable[Node], kind: str, notes: Notes) -> List[Tuple[str, Node]]:
    """Return [(name, node)] without those that have no name or a name already used; these get a warning."""
    found: Dict[str, Node] = {}
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


def _nested_models(node: Node, context: SdfContext, static: bool) -> List[Tuple[Model, Node, Optional[str]]]:
    """Return [(Model, node, relative_to)] of the models inside a model, both inline and included."""
    found: List[Tuple[Model, Node, Optional[str]]] = []
    names: Set[str] = set()
    notes = context.notes
    models, includes = iter(node.children("model")), iter(node.children("include"))
    for tag in node.tags():
        if tag not in ("model", "include"):
            continue
        child = next(models if tag == "model" else includes)
        relative_to, given = raw_pose(child)[1], True if static else None
        if tag == "model":
            model: Optional[Model] = notes.attempt("this model", read_model, child, context, given)
        else:
            model = read_include(child, context, given)[0]
        if model is None:
            child.ignore()
            continue
        if model.name in names:
            notes.add('{}: there is another nested model "{}"; this one is skipped.'.format(child.line, model.name))
            continue
        names.add(model.name)
        found.append((model, child, relative_to))
    return found


def _frames_of(node: Node, link_nodes: List[Tuple[str, Node]], joint_nodes: List[Tuple[str, Node]],
               nested: List[Tuple[Model, Node, Optional[str]]]) -> Frames:
    """Return the Frames of a model: links, joints, ``<frame>`` elements, nested models and their links."""
    frames = Frames(node.notes)
    for name, child in link_nodes:
        pose, relative_to = raw_pose(child)
        frames.add(name, pose, relative_to, child)
    for model, child, relative_to in nested:
        frames.add(model.name, model.pose, relative_to, child)
        for link in model.links:
            name = link.name if merges(child) else model.name + "::" + link.name
            if not (merges(child) and frames.has(name)):       # else the merge is refused
                frames.add(name, link.pose, model.name, child)
    add_frames(node, frames)
    for name, child in joint_nodes:
        pose, relative_to = raw_pose(child)
        relative_to = relative_to or named_end(child, "child", node.name(), frames.has)
        if frames.has(relative_to):       # otherwise there is a warning about the joint
            frames.add(name, pose, relative_to, child)
    frames.settle()
    return frames


def add_frames(node: Node, frames: Frames) -> None:
    """Add the ``<frame>`` elements of a model or world.

    Parameters
    ----------
    node : Node
        ``<model>`` or ``<world>``.
    frames : Frames
    """
    for name, child in _named_once(node.children("frame"), "frame", node.notes):
        pose, relative_to = raw_pose(child)
        frames.add(name, pose, relative_to or child.attribute("attached_to") or None, child)


def read_plugins(node: Node) -> List[PluginSpec]:
    """Return the ``<plugin>`` elements in a node; those that cannot be read are left out with a warning."""
    found = []
    for child in node.children("plugin"):
        found.append(node.notes.attempt("this plugin", read_plugin, child.element, None, node.notes))
        child.ignore()
    return [plugin for plugin in found if plugin is not None]


def _joints(node: Node, joint_nodes: List[Tuple[str, Node]], links: Sequence[Link],
            frames: Frames) -> Tuple[List[Joint], List[PluginSpec]]:
    """Return the joints that can be made, and their plugins; the others are left out with a warning, as in Gazebo."""
    poses = {link.name: link.pose for link in links}
    joints: List[Joint] = []
    plugins: List[PluginSpec] = []
    gears = [child for _, child in joint_nodes if child.attribute("type") == "gearbox"]
    for _, child in joint_nodes:
        if child in gears:
            continue
        found = node.notes.attempt("this joint", read_joint, child, poses, frames, version_of(node.element),
                                   node.name())
        if found is None:
            child.ignore()
        else:
            joints.append(found[0])
            plugins += found[1]
    for child in gears:
        gear = node.notes.attempt("this joint", read_gear, child, links, joints, frames, node.name())
        if gear is None:
            child.ignore()
        else:
            plugins.append(gear)
    return joints, plugins


def _placed(node: Node, pose: Pose, name: str, frames: Frames) -> Pose:
    """Return the pose of a model whose ``<pose>`` is that of one of its frames (``placement_frame`` of SDF 1.8)."""
    if not name:
        return pose
    return compose(pose, invert(frames.resolve(name, node)))


def read_model(node: Node, context: SdfContext, static: Optional[bool] = None) -> Model:
    """Read one ``<model>``.

    Parameters
    ----------
    node : Node
    context : SdfContext
        Receives notes; finds included models.
    static : bool or None
        Set by an include or an outer model; takes precedence over the model's own ``<static>``.

    Returns
    -------
    Model
        ``pose`` is the model's own; links of nested models have scoped names, and poses in this model's frame.

    Raises
    ------
    XmlError
        If it has no name, a link that moves has no mass, or models are nested too deep.  Other unusable parts are left
        out with a warning.
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
    if not static:
        static, nested = settled(nested, bool(link_nodes))
    joint_nodes = _named_once(node.children("joint"), "joint", notes)
    frames = _frames_of(node, link_nodes, joint_nodes, nested)
    self_collide = node.flag("self_collide", False)
    files = MeshReader(notes, context.resolve_model)
    links: List[Link] = []
    for _, child in link_nodes:
        links.append(context.known_links.read(child, (static, self_collide), partial(
            _read_link, child, frames, static, self_collide, files)))
        context.count(child, len(links[-1].collisions))
    plugins = read_plugins(node)
    joints: List[Joint] = []
    nested_names: List[str] = []
    for inner, child, _ in nested:
        place_of_inner = frames.resolve(inner.name)
        if merges(child):
            parts = notes.attempt("this include", merged, inner, place_of_inner, links, joints, child)
            if parts is None:
                continue
            (more_links, more_joints), more_names = parts, list(inner.nested)
            plugins.extend(merged_plugins(inner, place_of_inner))
        else:
            more_links, more_joints, more_names = scoped(inner.name, inner, place_of_inner)
            plugins.extend(nested_plugins(inner, place_of_inner))
        links, joints, nested_names = links + more_links, joints + more_joints, nested_names + more_names
    own_joints, couplings = _joints(node, joint_nodes, links, frames)
    joints, plugins = joints + own_joints, plugins + couplings
    _tell_canonical(node, links)
    pose = _placed(node, raw_pose(node)[0], node.attribute("placement_frame"), frames)
    model = Model(name=name, links=tuple(links), joints=tuple(joints), pose=pose, static=static,
                  plugins=tuple(plugins), nested=tuple(nested_names),
                  allow_auto_disable=node.flag("allow_auto_disable", True))
    node.done()
    return model


def _tell_canonical(node: Node, links: Sequence[Link]) -> None:
    canonical = node.attribute("canonical_link")
    if canonical and links and canonical != links[0].name:
        node.notes.add('{}: attribute canonical_link of <model> is "{}"; the first link, "{}", stands for the model '
                       'here.'.format(node.line, canonical, links[0].name))


def _find_included(node: Node, context: SdfContext) -> Optional[Tuple[str, Any]]:
    """Return (path, root element) of the file of an include; None, after a warning, if it is not on this machine."""
    uri = node.text("uri")
    if not uri:
        node.fail("<uri> is missing or empty", "model://NAME there")
    path = None if context.resolve_model is None else context.resolve_model(uri)
    if path is None:
        context.notes.add("{}: {} was not found (searched: {}; nothing is downloaded); it is left out ({}).".format(
            node.line, uri, context.resolve_model or "no folders", HOW_TO_INSTALL))
        return None
    if uri.startswith("http"):
        context.notes.add("{} is not downloaded; using {}.".format(uri, path), ("include", uri))
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


def _or_raise(found: Union[_Found, XmlError]) -> _Found:
    if isinstance(found, XmlError):
        raise found
    return found


def _included_model(element: Any, path: str, static: Optional[bool], context: SdfContext) -> Model:
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


def read_include(node: Node, context: SdfContext, static: Optional[bool] = None) -> _Included:
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
        None if the file has a light, or, after a warning, if it is unusable or not on this machine.
    lights : tuple of Light
        The light in the file, if any.
    """
    found = context.notes.attempt("this include", _read_include, node, context, static,
                                  subject=("include", node.text("uri")) if node.text("uri") else None)
    if found is None:
        node.ignore()
        return None, ()
    node.done()
    return found


def _read_include(node: Node, context: SdfContext, static: Optional[bool]) -> _Included:
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


def _tell_merge(node: Node) -> None:
    if merges(node) and node.element.getparent().tag != "model":
        node.notes.add("{}: attribute merge of <include> ignored; expected it inside a <model>.".format(node.line),
                       ("attribute", "include", "merge"))
