# SPDX-License-Identifier: BSD-3-Clause
"""SDF files: worlds for the simulator to load, and models for spawning.

Reads SDF 1.4 to 1.7.  The smallest part that cannot be used (a collision, a joint, a model, an include) is left out; a
warning in the ``notes`` names file, line, element and what was expected.  There are also warnings about ignored
elements.  Elements without effect on the simulation (colours, scene, window layout, sound) are listed in one sentence,
the ``remarks``.
"""
from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple, Union

from m2wr_sim.collector import paused_collector
from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.sdf.actor import read_actor
from m2wr_sim.model.sdf.frames import Frames, raw_pose
from m2wr_sim.model.sdf.light import read_light, read_scene
from m2wr_sim.model.sdf.model import SdfContext, add_frames, check_root, read_include, read_model, read_plugins
from m2wr_sim.model.sdf.node import Node
from m2wr_sim.model.sdf.physics import read_physics, read_state
from m2wr_sim.model.types import World
from m2wr_sim.model.xml.safe import errors_as, fail, parse_xml, read_file

if TYPE_CHECKING:
    from m2wr_sim.model.model_folders import ResolveModel
    from m2wr_sim.model.types import Light, Model

log = logging.getLogger(__name__)

_SLOW_BYTES = 4 * 1024 * 1024       # for larger documents a log message is written


class _Contents:
    """The models and lights of a world or file while it is being read; the first of a name wins."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self.models: Dict[str, Tuple[Model, Node, Optional[str]]] = {}
        self.lights: Dict[str, Light] = {}

    def add_model(self, model: Model, node: Node, relative_to: Optional[str]) -> None:
        if not model.links:
            self._notes.add('{}: model "{}" has no link; it is skipped.'.format(node.line, model.name))
        elif model.name in self.models:
            self._notes.add('{}: a model "{}" is there already; this one is skipped (name it otherwise).'.format(
                node.line, model.name))
        else:
            self.models[model.name] = (model, node, relative_to)

    def add_light(self, light: Light, node: Node) -> None:
        if light.name in self.lights:
            self._notes.add('{}: a light "{}" is there already; this one is skipped.'.format(node.line, light.name))
        self.lights.setdefault(light.name, light)

    def read(self, parent: Node, context: SdfContext) -> None:
        """Read every model, actor, include and light in ``parent``."""
        nodes = {tag: iter(parent.children(tag)) for tag in ("model", "actor", "include", "light")}
        for tag in parent.tags():
            if tag not in nodes:
                continue
            child = next(nodes[tag])
            relative_to = raw_pose(child)[1]
            model: Optional[Model] = None
            lights: Tuple[Optional[Light], ...] = ()
            if tag == "include":
                model, lights = read_include(child, context)
            elif tag == "model":
                model = self._notes.attempt("this model", read_model, child, context)
            elif tag == "actor":
                model = self._notes.attempt("this actor", read_actor, child, context)
            else:
                lights = (self._notes.attempt("this light", read_light, child),)
            if model is not None:
                self.add_model(model, child, relative_to)
            elif tag != "light" or lights[0] is None:
                child.ignore()
            for light in lights:
                if light is not None:
                    self.add_light(light, child)

    def placed(self, parent: Node) -> Tuple[Model, ...]:
        """Return the models in load order; poses relative to other models or frames are converted to the world."""
        frames = Frames(self._notes, roots=("world",))
        for name, (model, node, relative_to) in self.models.items():
            frames.add(name, model.pose, relative_to, node)
        add_frames(parent, frames)
        frames.settle()
        poses = [frames.resolve(name) for name in self.models]
        return tuple(model if model.pose == pose else replace(model, pose=pose)
                     for (model, _, _), pose in zip(self.models.values(), poses))


def _world_element(root: Any, notes: Notes) -> Any:
    worlds = root.findall("world")
    if not worlds:
        fail(root, "the file has no <world>", "one <world>")
    if len(worlds) > 1:
        notes.add("{}: the file has {} worlds; using the first.".format(Node(worlds[1], notes).line, len(worlds)))
    return worlds[0]


def _parse(text: Union[str, bytes], source: str) -> Any:
    """Return the root element; long documents are logged, because they take a while."""
    if len(text) > _SLOW_BYTES:
        log.info("reading %s (%d MB)", source, len(text) // 2 ** 20)
    return parse_xml(text, source)


def load_world(path_or_text: Union[str, bytes], source: Optional[str] = None,
               resolve_model: Optional[ResolveModel] = None) -> World:
    """Load a world.

    Parameters
    ----------
    path_or_text : str or bytes
        Path of an SDF ``.world`` file, or the document itself (bytes, or text with a ``<`` in it).
    source : str or None
        Name for messages; default: the path, if there is one.
    resolve_model : callable or None
        Finds included models: ``resolve_model("model://NAME")`` gives the path of an SDF file or None; see
        :class:`m2wr_sim.model.model_folders.ModelFolders`.

    Returns
    -------
    World
        Models in load order; insertions and deletions of the stored state are applied.

    Raises
    ------
    WorldError
        If the file is missing, is not XML, or has no world; the message names file, line and what was expected.  Other
        errors only remove their own part of the world, see the ``notes``.
    """
    with errors_as(WorldError), paused_collector():
        if isinstance(path_or_text, bytes) or "<" in path_or_text:
            text, source = path_or_text, source or "world"
        else:
            text, source = read_file(path_or_text), source or path_or_text
        notes = Notes()
        root = _parse(text, source)
        check_root(root, notes)
        return _read_world(Node(_world_element(root, notes), notes), SdfContext(notes, resolve_model))


def _read_world(node: Node, context: SdfContext) -> World:
    notes = context.notes
    contents = _Contents(notes)
    contents.read(node, context)
    stored = node.children("state")
    if stored:
        for deletions in stored[0].children("deletions"):
            for name in deletions.children("name"):
                contents.models.pop(name.own_text(), None)
        for insertions in stored[0].children("insertions"):
            contents.read(insertions, context)
    world = World(name=node.attribute("name") or "default", models=contents.placed(node), physics=read_physics(node),
                  lights=tuple(contents.lights.values()), scene=read_scene(node.child("scene")),
                  plugins=tuple(read_plugins(node)), state=read_state(node))
    node.done()
    return replace(world, notes=notes.sentences(), remarks=notes.remarks())


def load_sdf_models(text: Union[str, bytes], source: str = "model_xml",
                    resolve_model: Optional[ResolveModel] = None) -> List[Model]:
    """Load the models of an SDF document.

    Parameters
    ----------
    text : str or bytes
    source : str
    resolve_model : callable or None
        As for :func:`load_sdf`.

    Returns
    -------
    list of Model

    Raises
    ------
    ModelError
        As :func:`load_sdf`, and if the document has only lights.
    """
    models, lights = load_sdf(text, source, resolve_model)
    if not models:
        raise ModelError("{}: no model is in it, only a light; expected a <model> with a link".format(source))
    return models


def load_sdf(text: Union[str, bytes], source: str = "model_xml", resolve_model: Optional[ResolveModel] = None,
             most_parts: Optional[int] = None) -> Tuple[List[Model], List[Light]]:
    """Load the models and lights of an SDF document, for spawning.

    Parameters
    ----------
    text : str or bytes
        ``<sdf>`` with models in it, or with a world that holds or includes them.
    source : str
        Name for messages.
    resolve_model : callable or None
        As for :func:`load_world`.
    most_parts : int or None
        Greatest number of links and collisions together; a model beyond it is left out.

    Returns
    -------
    models : list of Model
        In document order; each carries the notes of the whole document.
    lights : list of Light

    Raises
    ------
    ModelError
        If the document is malformed, or has no usable model or light.
    """
    with errors_as(ModelError):
        notes = Notes()
        root = _parse(text, source)
        check_root(root, notes)
        contents, context = _Contents(notes), SdfContext(notes, resolve_model, most_parts=most_parts)
        parent = Node(root.find("world") if root.find("world") is not None else root, notes)
        contents.read(parent, context)
        models = contents.placed(parent)
        if not models and not contents.lights:
            if len(notes.faults()) == 1:
                raise notes.faults()[0]
            details = " ".join(notes.sentences())
            fail(root, "no model is in it" + (" ({})".format(details) if details else ""), "a <model> with a link")
        return ([replace(model, notes=notes.sentences(), remarks=notes.remarks()) for model in models],
                list(contents.lights.values()))
