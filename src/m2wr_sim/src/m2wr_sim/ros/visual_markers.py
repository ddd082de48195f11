# SPDX-License-Identifier: BSD-3-Clause
"""Topic with the looks of models, where collision shapes do not have them: robots, and models with meshes."""
from typing import Any, List, Optional, Tuple

from visualization_msgs.msg import Marker, MarkerArray

from m2wr_sim.model.types import Collision, MeshFile, Model, Visual
from m2wr_sim.ros.convert import write_pose
from m2wr_sim.ros.world_markers import MATERIALS, OTHER_COLOUR, MarkerPlugin, is_robot, marker_of
from m2wr_sim.runtime.simulator import Simulator

MOST = 2000             # markers of all models together
ROBOT, MODEL = "robot", "model"         # text of a marker: what it is a part of


def colour_of(visual: Visual) -> Tuple[float, ...]:
    """Return the colour (r, g, b, a) of a visual."""
    colour = MATERIALS.get((visual.material or "").rsplit("/", 1)[-1].lower())
    red, green, blue, opacity = visual.rgba or (OTHER_COLOUR if colour is None else colour + (1.0,))
    return red, green, blue, opacity * (1.0 - visual.transparency)


def visual_marker(visual: Visual) -> Optional[Marker]:
    """Return the Marker of a visual in its link's frame, without names, or None for a shape that is not shown.

    Planes are not shown, nor meshes of which only a part is used or whose file was not found.
    """
    if not isinstance(visual.geometry, MeshFile):
        return marker_of(Collision(visual.name, visual.geometry), visual.pose, colour_of(visual))
    shape = visual.geometry
    if not shape.path or shape.submesh:
        return None
    marker = Marker(action=Marker.ADD, type=Marker.MESH_RESOURCE, mesh_resource="file://" + shape.path)
    marker.mesh_use_embedded_materials = not (visual.rgba or visual.material)
    marker.scale.x, marker.scale.y, marker.scale.z = shape.scale
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour_of(visual)
    write_pose(marker.pose, *visual.pose)
    return marker


def has_looks(record: Model) -> bool:
    """Return whether the visuals of a model are published: it is a robot, or one of them is the mesh of a file."""
    return is_robot(record) or any(isinstance(visual.geometry, MeshFile) for link in record.links
                                   for visual in link.visuals)


def visual_markers(name: str, record: Model) -> List[Marker]:
    """Return the markers of a model: ``ns`` is its name, ``frame_id`` its name, ``::`` and the link's.

    Parameters
    ----------
    name : str
        Of the model in the world.
    record : Model
    """
    found: List[Marker] = []
    for link in record.links:
        for visual in link.visuals:
            marker = visual_marker(visual)
            if marker is not None:
                marker.ns, marker.id, marker.text = name, len(found), ROBOT if is_robot(record) else MODEL
                marker.header.frame_id = "%s::%s" % (name, link.name)
                found.append(marker)
    return found


class VisualMarkers(MarkerPlugin):
    """Publishes the looks of robots and of models with meshes whenever one was added or removed.

    Parameters
    ----------
    simulator : Simulator
    port : LatchedPort
        For a MarkerArray.
    """

    def __init__(self, simulator: Simulator, port: Any) -> None:
        self._simulator, self._port = simulator, port
        self._models: List[Any] = []
        self.turn()

    def _changed(self) -> bool:
        return self._models != list(self._simulator.models.values())

    def turn(self) -> None:
        """Publish the markers again if a model was added or removed."""
        if not self._changed():
            return
        before = [model for model in self._models if has_looks(model.record)]
        self._models = list(self._simulator.models.values())
        shown = [model for model in self._models if has_looks(model.record)]
        if shown != before:
            found = [marker for model in shown for marker in visual_markers(model.name, model.record)]
            self._port.publish(MarkerArray([Marker(action=Marker.DELETEALL)] + found[:MOST]))
