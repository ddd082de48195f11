# SPDX-License-Identifier: BSD-3-Clause
"""Draws many shapes with few messages: one instanced mesh for all shapes of a geometry."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from m2wr_live.scene.shapes import quaternions_of

if TYPE_CHECKING:
    from m2wr_live.scene.live_scene import Robot
    from m2wr_live.scene.shapes import Geometry, Shape
    from m2wr_node.array_types import FloatArray


_BELOW = -1e3           # m; a height that no camera shows
MOST_SHADOWS = 200          # shapes of a geometry that cast shadows; those that do are drawn four times


class LinkShapes:
    """Shapes of models that move with their links.

    Parameters
    ----------
    models : sequence of Robot

    Attributes
    ----------
    shapes : list of (Robot, Shape)
    """

    def __init__(self, models: Sequence[Robot]) -> None:
        self.shapes = [(model, shape) for model in models for shape in model.model.shapes]
        self._offsets = np.array([shape.pose for _, shape in self.shapes]).reshape(-1, 4, 4)

    def poses(self) -> FloatArray:
        """Return the poses (n, 4, 4) of the shapes; one whose link's pose is not known is below the floor."""
        hidden = np.eye(4)
        hidden[2, 3] = _BELOW
        links = [model.poses.get(shape.owner, hidden) for model, shape in self.shapes]
        found: FloatArray = np.einsum("nij,njk->nik", np.array(links).reshape(-1, 4, 4), self._offsets)
        return found

    def draw(self, batches: Batches, geometries: Mapping[str, Geometry]) -> None:
        """Replace the shapes of ``batches`` by these.

        Parameters
        ----------
        batches : Batches
        geometries : mapping of str to Geometry
        """
        batches.set_shapes([shape for _, shape in self.shapes], geometries, self.poses())


class Batches:
    """The instanced meshes of one group of shapes, as children of a node of the scene.

    Parameters
    ----------
    scene : viser.SceneApi
    name : str
        Of the node, such as ``/world``.
    """

    def __init__(self, scene: Any, name: str) -> None:
        self._scene, self._name = scene, name
        self._root = scene.add_frame(name, show_axes=False)
        self._handles: Dict[str, Any] = {}
        self._members: Dict[str, List[int]] = {}
        self._looks: Dict[str, Tuple[object, ...]] = {}

    def show(self, visible: bool) -> None:
        """Show or hide all shapes."""
        self._root.visible = visible

    def set_shapes(self, shapes: Sequence[Shape], geometries: Mapping[str, Geometry], poses: FloatArray) -> None:
        """Replace the shapes; those that look the same are only moved.

        Parameters
        ----------
        shapes : sequence of Shape
        geometries : mapping of str to Geometry
        poses : (n, 4, 4) float64
            Of the shapes, in the node's frame.
        """
        members: Dict[str, List[int]] = {}
        for index, shape in enumerate(shapes):
            members.setdefault(shape.geometry, []).append(index)
        for key in set(self._handles) - set(members):
            self._handles.pop(key).remove()
            self._looks.pop(key)
        self._members = members
        for key, indices in members.items():
            looks = tuple((shapes[index].scale, shapes[index].colour) for index in indices)
            if self._looks.get(key) != looks:
                self._looks[key] = looks
                self._handles[key] = self._add(key, geometries[key], [shapes[index] for index in indices],
                                               poses[indices])
        self.move(poses)

    def move(self, poses: FloatArray) -> None:
        """Move the shapes; meshes whose shapes rest are not sent again.

        Parameters
        ----------
        poses : (n, 4, 4) float64
            In the order of the shapes.
        """
        if not len(poses):
            return
        quaternions = quaternions_of(poses[:, :3, :3])
        for key, indices in self._members.items():
            handle = self._handles[key]
            handle.batched_positions = poses[indices, :3, 3].astype(np.float32)
            handle.batched_wxyzs = quaternions[indices].astype(np.float32)

    def _add(self, key: str, geometry: Geometry, shapes: Sequence[Shape], poses: FloatArray) -> Any:
        name = "%s/%s" % (self._name, "".join(sign if sign.isalnum() else "_" for sign in key))
        where = {"batched_wxyzs": quaternions_of(poses[:, :3, :3]), "batched_positions": poses[:, :3, 3],
                 "batched_scales": np.array([shape.scale for shape in shapes], dtype=np.float32), "lod": "off",
                 "cast_shadow": len(shapes) <= MOST_SHADOWS}
        if geometry.coloured:
            return self._scene.add_batched_glb(name, geometry.coloured, **where)
        colours = np.clip(np.array([shape.colour[:3] for shape in shapes]) * 255.0, 0.0, 255.0).astype(np.uint8)
        opacities = np.clip(np.array([shape.colour[3] for shape in shapes]), 0.0, 1.0)
        return self._scene.add_batched_meshes_simple(
            name, geometry.vertices.astype(np.float32), geometry.faces, batched_colors=colours,
            batched_opacities=None if np.all(opacities >= 1.0) else opacities.astype(np.float32),
            flat_shading=not geometry.smooth, side="front" if geometry.closed else "double", **where)
