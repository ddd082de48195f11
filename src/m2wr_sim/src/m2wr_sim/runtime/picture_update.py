# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the shapes that cameras see where the engine has their links.  Nothing is built before the first picture."""
from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.errors import SimError
from m2wr_sim.geometry import compose, rotate
from m2wr_sim.model.ground import sampled
from m2wr_sim.model.materials import colour_of_name
from m2wr_sim.model.mesh.surfaces import plain_surface, read_surface_file
from m2wr_sim.model.mesh.textures import find_script, read_texture
from m2wr_sim.model.types import Box, Cylinder, Heightmap, Light, Mesh, MeshFile, Plane, Scene, Sphere
from m2wr_sim.rendering import picture_layout as layout
from m2wr_sim.rendering.picture_scene import Lighting, Part, PictureScene
from m2wr_sim.sensors.mesh_tree import corners_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.types import Link, Visual, VisualGeometry
    from m2wr_sim.runtime.entities import LiveModel
    from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)

DEFAULT_SUN = Light("sun", "directional", ((0.0, 0.0, 10.0), (0.0, 0.0, 0.0, 1.0)), (0.8, 0.8, 0.8, 1.0),
                    direction=(-0.5, 0.1, -0.9), cast_shadows=True)     # of Gazebo's model "sun"
INVISIBLE = 0.5         # transparency from which a shape is not drawn; others are drawn as solid ones
TERRAIN = (0.45, 0.42, 0.36)
SKY = ((0.80, 0.86, 0.92), (0.33, 0.52, 0.80))      # at the horizon, overhead
WITHOUT_COLOUR = (1.0, 1.0, 1.0)
_MOST_LIGHTS = 16
_MOST_TRIANGLES = 2 * 1024 * 1024      # of a heightmap, of which pictures show every k-th sample above that; 0.5 GB

#: Row of the scene, the engine's number of the link, pose of the shape in the link frame.
_Place = Tuple[int, int, "Pose"]


class PictureUpdate:
    """What cameras see of a simulation.

    Parameters
    ----------
    simulator : Simulator

    Attributes
    ----------
    scene : PictureScene
    look : m2wr_sim.model.types.Scene
        Ambient light and background.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self.scene, self.look = PictureScene(), Scene()
        self._models: Dict[str, LiveModel] = {}             # that are in the scene
        self._changes = -1                                  # of the simulator's models that it shows
        self._resting: Dict[int, List[_Place]] = {}         # static link -> its shapes
        self._moving: Dict[str, List[_Place]] = {}
        self._read: Optional[Callable[[], None]] = None
        self._rows, self._poses = np.zeros(0, np.int64), np.zeros((0, 7))
        self._shown = -1
        self._lights: Optional[Tuple[object, ...]] = None
        self._told: Dict[str, bool] = {}

    def refresh(self) -> PictureScene:
        """Bring models, poses and lights up to date, and return the scene."""
        if self._changes != self._simulator.model_changes:
            self._changes = self._simulator.model_changes
            lost = set(self._simulator.lost)
            self._change({name: model for name, model in self._simulator.models.items() if name not in lost})
        engine = self._simulator.engine
        if self._read is None:
            places = [place for parts in self._moving.values() for place in parts]
            self._rows, self._poses = np.array([place[0] for place in places], np.int64), np.zeros((len(places), 7))
            self._read = engine.pose_reader([place[1:] for place in places], self._poses)
        if self._rows.size:
            self._read()
            self.scene.place(self._rows, self._poses)
        for link in engine.placed_since(self._shown):
            for row, _, pose in self._resting.get(link, ()):
                position, orientation = compose(engine.link_pose(link), pose)
                self.scene.place(np.array([row], np.int64), np.array([tuple(position) + tuple(orientation)]))
                self.scene.disturb()
        self._shown = engine.version
        self._light()
        return self.scene

    # ---- models ------------------------------------------------------------------------------------------------

    def _change(self, models: Dict[str, LiveModel]) -> None:
        """Remove the models that are gone, and add the new ones."""
        for name, model in list(self._models.items()):
            if models.get(name) is not model:
                self.scene.remove_owner(name)
                del self._models[name]
                self._moving.pop(name, None)
                for link in model.handle.links.values():
                    self._resting.pop(link, None)
        for name, model in models.items():
            if name not in self._models:
                self._models[name] = model
                self._add(model)
        self._read = None

    def _add(self, model: LiveModel) -> None:
        parts: List[Part] = []
        places: List[Tuple[int, Pose]] = []
        for link in model.record.links:
            for part, pose in self._parts(model.name, link):
                parts.append(part)
                places.append((model.handle.links[link.name], pose))
        engine = self._simulator.engine
        rows = self.scene.add_all(parts, [compose(engine.link_pose(link), pose) for link, pose in places], model.name,
                                  not model.record.static)
        if not model.record.static:
            self._moving[model.name] = [(row, link, pose) for row, (link, pose) in zip(rows, places)]
            return
        for row, (number, pose) in zip(rows, places):
            self._resting.setdefault(number, []).append((row, number, pose))

    def _parts(self, model: str, link: Link) -> List[Tuple[Part, Pose]]:
        """Return the visible shapes of a link and their poses in its frame."""
        found = []
        for visual in link.visuals:
            alpha = (visual.rgba[3] if visual.rgba is not None else 1.0) * (1.0 - visual.transparency)
            if alpha < INVISIBLE:
                continue
            where = "%s::%s::%s" % (model, link.name, visual.name)
            try:
                found.append(self._part(where, visual))
            except (SimError, ValueError) as error:
                self._tell("%s is not in pictures: %s" % (where, error))
        for collision in link.collisions:       # its visual names the same picture
            if isinstance(collision.geometry, Heightmap):
                points, triangles = sampled(collision.geometry, _MOST_TRIANGLES)
                found.append((Part(layout.MESH, plain_surface(points[triangles], TERRAIN)), collision.pose))
        return found

    def _part(self, where: str, visual: Visual) -> Tuple[Part, Pose]:
        colour = None if visual.rgba is None else visual.rgba[:3]
        texture, repeat = None, (1.0, 1.0)
        if visual.material is not None:
            script = find_script(visual.material, visual.scripts) if visual.scripts else None
            if script is not None and script.picture:
                try:
                    texture, repeat = read_texture(script.picture), script.repeat
                except SimError as error:
                    self._tell("%s: %s; it has no texture" % (where, error))
            if script is not None:
                colour = script.colour or colour or WITHOUT_COLOUR
            elif colour is None:
                colour = colour_of_name(visual.material)
                if colour is None and not isinstance(visual.geometry, MeshFile):
                    self._tell("%s: the material %s is unknown; it is white" % (where, visual.material))
        kind, shape, pose = self._shape(where, visual.geometry, visual.pose)
        if kind != layout.MESH and colour is None:
            colour = WITHOUT_COLOUR
        return Part(kind, shape, colour, texture, repeat, visual.cast_shadows and kind != layout.PLANE), pose

    def _shape(self, where: str, geometry: VisualGeometry, pose: Pose) -> Tuple[int, object, Pose]:
        """Return kind of the layout, half extents or Surface, and pose in the link frame."""
        if isinstance(geometry, Box):
            return layout.BOX, tuple(0.5 * size for size in geometry.size), pose
        if isinstance(geometry, Sphere):
            return layout.SPHERE, (geometry.radius,) * 3, pose
        if isinstance(geometry, Cylinder):
            return layout.CYLINDER, (geometry.radius, geometry.radius, 0.5 * geometry.length), pose
        if isinstance(geometry, Plane):
            half = (0.5 * geometry.size[0], 0.5 * geometry.size[1], 0.0)
            return layout.PLANE, half, (pose[0], _upward(pose[1], geometry.normal))
        if isinstance(geometry, MeshFile):
            surface, problems = read_surface_file(geometry)
            for problem in problems:
                self._tell("%s: %s" % (where, problem))
            return layout.MESH, surface, pose
        if isinstance(geometry, (Mesh, Heightmap)):
            return layout.MESH, plain_surface(corners_of(geometry)), pose
        raise ValueError("%s is no shape that cameras see" % type(geometry).__name__)

    def _tell(self, text: str) -> None:
        if text not in self._told and len(self._told) < 1000:
            self._told[text] = True
            log.warning("%s", text)

    # ---- light -------------------------------------------------------------------------------------------------

    def _light(self) -> None:
        lights = tuple(self._simulator.lights.values())
        if self._lights is not None and self._lights[0] is self.look and self._lights[1:] == lights:
            return
        self._lights = (self.look,) + lights
        kept: Sequence[Light] = sorted(lights, key=lambda light: light.kind != "directional") or [DEFAULT_SUN]
        table = np.array([_row(light, self.look.shadows) for light in kept[:_MOST_LIGHTS]])
        background = self.look.background[:3]
        self.scene.lighting = Lighting(table, np.array(self.look.ambient[:3], float),
                                       np.array(SKY[0] + SKY[1] if self.look.sky else background + background, float))


def _row(light: Light, shadows: bool) -> NDArray[np.float64]:
    """Return the row of a light in the table of the kernels."""
    row = np.zeros(layout.LIGHT_SIZE)
    directional = light.kind == "directional"
    row[layout.L_DIRECTIONAL] = directional
    row[layout.L_PLACE:layout.L_PLACE + 3] = light.pose[0]
    row[layout.L_COLOUR:layout.L_COLOUR + 3] = light.diffuse[:3]
    row[layout.L_ATTENUATION:layout.L_ATTENUATION + 3] = light.attenuation
    if directional:
        along = rotate(light.pose[1], light.direction)
        length = math.sqrt(sum(value * value for value in along))
        row[layout.L_PLACE:layout.L_PLACE + 3] = [-value / length if length > 1e-9 else float(axis == 2)
                                                  for axis, value in enumerate(along)]
    row[layout.L_SHADOW] = shadows and light.cast_shadows
    return row


def _upward(orientation: Sequence[float], normal: Sequence[float]) -> Tuple[float, float, float, float]:
    """Return the orientation of a rectangle whose z axis is a normal given in the visual's frame."""
    x, y, z = normal
    if z < -1.0 + 1e-9:
        turn = (1.0, 0.0, 0.0, 0.0)
    else:
        scale = 1.0 / math.sqrt(2.0 * (1.0 + z))
        turn = (-y * scale, x * scale, 0.0, (1.0 + z) * scale)
    return compose(((0.0, 0.0, 0.0), tuple(orientation)), ((0.0, 0.0, 0.0), turn))[1]
