"""SDF files: worlds for the simulator to load, and models for spawning.

Reads SDF 1.4 to 1.7.  What has no part in the simulation (colours, scene, window layout, sound) is passed over;
whatever else is not read is named in the ``notes``.
"""
from dataclasses import replace

from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.model.notes import Notes
from m2wr_sim.model.plugin_spec import read_plugin
from m2wr_sim.model.safe_xml import errors_as, fail, line_of, parse_xml, read_file, required_name
from m2wr_sim.model.sdf_frames import Frames, raw_pose
from m2wr_sim.model.sdf_light import read_light
from m2wr_sim.model.sdf_model import SdfContext, check_root, read_include, read_model
from m2wr_sim.model.sdf_physics import read_physics, read_state
from m2wr_sim.model.types import World

_WORLD_READ = frozenset(("model", "include", "light", "physics", "gravity", "plugin", "state", "frame"))
_WORLD_SILENT = frozenset(("scene", "gui", "audio", "wind", "atmosphere", "magnetic_field", "spherical_coordinates",
                           "road"))


class _Contents:
    """The models and lights of a world or file while it is being read; the first of a name wins."""

    def __init__(self, notes):
        self._notes = notes
        self.models = {}
        self.lights = {}

    def add_model(self, model, element):
        if not model.links:
            self._notes.add('{}: model "{}" has no link; it is skipped.'.format(line_of(element), model.name))
        elif model.name in self.models:
            self._notes.add('{}: a model "{}" is there already; this one is skipped (name it otherwise).'.format(
                line_of(element), model.name))
        else:
            self.models[model.name] = (model, element)

    def add_light(self, light, element):
        if light.name in self.lights:
            self._notes.add('{}: a light "{}" is there already; this one is skipped.'.format(
                line_of(element), light.name))
        self.lights.setdefault(light.name, light)

    def read(self, parent, context):
        """Read every model, include and light that stands directly in ``parent``."""
        for child in parent:
            if child.tag == "model":
                self.add_model(read_model(child, context), child)
            elif child.tag == "light":
                self.add_light(read_light(child, self._notes), child)
            elif child.tag == "include":
                model, lights = read_include(child, context)
                if model is not None:
                    self.add_model(model, child)
                for light in lights:
                    self.add_light(light, child)

    def placed(self, parent, notes):
        """Return the models in load order, with poses relative to other models or frames brought to the world."""
        frames = Frames(notes, roots=("world",))
        for name, (model, element) in self.models.items():
            frames.add(name, model.pose, raw_pose(element)[1], element)
        for element in parent.findall("frame"):
            pose, relative_to = raw_pose(element)
            frames.add(required_name(element), pose, relative_to or element.get("attached_to") or None, element)
        return tuple(replace(model, pose=frames.resolve(name)) for name, (model, _) in self.models.items())


def _is_text(path_or_text):
    return isinstance(path_or_text, bytes) or "<" in path_or_text


def _world_element(root):
    worlds = root.findall("world")
    if len(worlds) != 1:
        fail(root, "the file has {} <world> elements".format(len(worlds)), "one <world>")
    return worlds[0]


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
        If the file is missing or malformed, or an element in it (or in an included file) cannot be used; the message
        names file, line, element and what was expected.
    """
    with errors_as(WorldError):
        if _is_text(path_or_text):
            text, source = path_or_text, source or "world"
        else:
            source = source or path_or_text
            text = read_file(path_or_text)
        notes = Notes()
        root = parse_xml(text, source)
        check_root(root, notes)
        element = _world_element(root)
        return _read_world(element, SdfContext(notes, resolve_model))


def _read_world(element, context):
    notes = context.notes
    notes.unread(element, _WORLD_READ, _WORLD_SILENT)
    contents = _Contents(notes)
    contents.read(element, context)
    state = element.find("state")
    if state is not None:
        for name in state.findall("deletions/name"):
            contents.models.pop((name.text or "").strip(), None)
        for insertions in state.findall("insertions"):
            contents.read(insertions, context)
    return World(name=(element.get("name") or "").strip() or "default", models=contents.placed(element, notes),
                 physics=read_physics(element, notes), lights=tuple(contents.lights.values()),
                 plugins=tuple(read_plugin(child) for child in element.findall("plugin")),
                 state=read_state(element, notes), notes=notes.sentences())


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


def load_sdf(text, source="model_xml", resolve_model=None):
    """Load the models and lights of an SDF document, for spawning.

    Parameters
    ----------
    text : str or bytes
        ``<sdf>`` with models in it, or with a world that holds or includes them.
    source, resolve_model
        As for :func:`load_world`.

    Returns
    -------
    models : list of Model
        In document order; each carries the notes of the whole document.
    lights : list of Light

    Raises
    ------
    ModelError
        If the document is malformed, holds neither model nor light, or an element in it cannot be used.
    """
    with errors_as(ModelError):
        notes = Notes()
        root = parse_xml(text, source)
        check_root(root, notes)
        contents, context = _Contents(notes), SdfContext(notes, resolve_model)
        parent = root.find("world") if root.find("world") is not None else root
        contents.read(parent, context)
        models = contents.placed(parent, notes)
        if not models and not contents.lights:
            details = " ".join(notes.sentences())
            fail(root, "no model is in it" + (" ({})".format(details) if details else ""), "a <model> with a link")
        return [replace(model, notes=notes.sentences()) for model in models], list(contents.lights.values())
