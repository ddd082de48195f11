# SPDX-License-Identifier: BSD-3-Clause
"""SDF files: worlds for the simulator to load, and models for spawning.

Reads SDF 1.4 to 1.7.  What cannot be used is left out in its smallest part (a collision, a joint, a model, an include)
and named in the ``notes`` with file, line, element and what was expected; so are ignored elements.  What has no part
in the simulation (colours, scene, window layout, sound) is gathered in one quiet sentence, the ``remarks``.
"""
import logging
from dataclasses import replace

from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.sdf.frames import Frames, raw_pose
from m2wr_sim.model.sdf.light import read_light
from m2wr_sim.model.sdf.model import SdfContext, add_frames, check_root, read_include, read_model, read_plugins
from m2wr_sim.model.sdf.node import Node
from m2wr_sim.model.sdf.physics import read_physics, read_state
from m2wr_sim.model.types import World
from m2wr_sim.model.xml.safe import errors_as, fail, parse_xml, read_file

log = logging.getLogger(__name__)

_SLOW_BYTES = 4 * 1024 * 1024       # from here on it is said that a document is being read


class _Contents:
    """The models and lights of a world or file while it is being read; the first of a name wins."""

    def __init__(self, notes):
        self._notes = notes
        self.models = {}
        self.lights = {}

    def add_model(self, model, node, relative_to):
        if not model.links:
            self._notes.add('{}: model "{}" has no link; it is skipped.'.format(node.line, model.name))
        elif model.name in self.models:
            self._notes.add('{}: a model "{}" is there already; this one is skipped (name it otherwise).'.format(
                node.line, model.name))
        else:
            self.models[model.name] = (model, node, relative_to)

    def add_light(self, light, node):
        if light.name in self.lights:
            self._notes.add('{}: a light "{}" is there already; this one is skipped.'.format(node.line, light.name))
        self.lights.setdefault(light.name, light)

    def read(self, parent, context):
        """Read every model, include and light that is a child of ``parent``, a Node."""
        nodes = {tag: iter(parent.children(tag)) for tag in ("model", "include", "light")}
        for tag in parent.tags():
            if tag not in nodes:
                continue
            child = next(nodes[tag])
            relative_to = raw_pose(child)[1]
            if tag == "include":
                model, lights = read_include(child, context)
            elif tag == "model":
                model, lights = self._notes.attempt("this model", read_model, child, context), ()
            else:
                model, lights = None, (self._notes.attempt("this light", read_light, child),)
            if model is not None:
                self.add_model(model, child, relative_to)
            elif tag != "light" or lights[0] is None:
                child.ignore()
            for light in lights:
                if light is not None:
                    self.add_light(light, child)

    def placed(self, parent):
        """Return the models in load order, with poses relative to other models or frames brought to the world."""
        frames = Frames(self._notes, roots=("world",))
        for name, (model, node, relative_to) in self.models.items():
            frames.add(name, model.pose, relative_to, node)
        add_frames(parent, frames)
        frames.settle()
        return tuple(replace(model, pose=frames.resolve(name)) for name, (model, _, _) in self.models.items())


def _is_text(path_or_text):
    return isinstance(path_or_text, bytes) or "<" in path_or_text


def _world_element(root, notes):
    worlds = root.findall("world")
    if not worlds:
        fail(root, "the file has no <world>", "one <world>")
    if len(worlds) > 1:
        notes.add("{}: the file has {} worlds; using the first.".format(Node(worlds[1], notes).line, len(worlds)))
    return worlds[0]


def _parse(text, source):
    """Return the root element; long documents are announced, since they take a while."""
    if len(text) > _SLOW_BYTES:
        log.info("reading %s (%d MB)", source, len(text) // 2 ** 20)
    return parse_xml(text, source)


def load_world(path_or_text, source=None, resolve_model=None):
    """Load a world.

    Parameters
    ----------
    path_or_text : str or bytes
        Path of an SDF ``.world`` file, or the document itself (bytes, or text with a ``<`` in it).
    source : str or None
        Name for messages; the path where there is one.
    resolve_model : callable or None
        Finds included models: ``resolve_model("model://NAME")`` gives the path of an SDF file or None; see
        :class:`m2wr_sim.model.model_folders.ModelFolders`.

    Returns
    -------
    World
        Models in load order; changes that the stored state makes to the list of models are applied.

    Raises
    ------
    WorldError
        If the file is missing, is no XML, or holds no world; the message names file, line and what was expected.
        Everything else that is wrong costs only its own part of the world: see the ``notes``.
    """
    with errors_as(WorldError):
        if _is_text(path_or_text):
            text, source = path_or_text, source or "world"
        else:
            source = source or path_or_text
            text = read_file(path_or_text)
        notes = Notes()
        root = _parse(text, source)
        check_root(root, notes)
        return _read_world(Node(_world_element(root, notes), notes), SdfContext(notes, resolve_model))


def _read_world(node, context):
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
                  lights=tuple(contents.lights.values()), plugins=tuple(read_plugins(node)), state=read_state(node))
    node.done()
    return replace(world, notes=notes.sentences(), remarks=notes.remarks())


def load_sdf_models(text, source="model_xml", resolve_model=None):
    """Load the models of an SDF document; see :func:`load_sdf`.

    Returns
    -------
    list of Model

    Raises
    ------
    ModelError
        Also where the document holds lights alone.
    """
    models, lights = load_sdf(text, source, resolve_model)
    if not models:
        raise ModelError("{}: no model is in it, only a light; expected a <model> with a link".format(source))
    return models


def load_sdf(text, source="model_xml", resolve_model=None, most_parts=None):
    """Load the models and lights of an SDF document, for spawning.

    Parameters
    ----------
    text : str or bytes
        ``<sdf>`` with models in it, or with a world that holds or includes them.
    source, resolve_model
        As for :func:`load_world`.
    most_parts : int or None
        Most links and collisions, together; a model that goes beyond is left out.

    Returns
    -------
    models : list of Model
        In document order; each carries the notes of the whole document.
    lights : list of Light

    Raises
    ------
    ModelError
        If the document is malformed, or holds neither model nor light that can be used.
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
