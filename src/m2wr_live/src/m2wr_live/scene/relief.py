# SPDX-License-Identifier: BSD-3-Clause
"""Ground that is not level: its triangles, its height at a place, and where a ray meets it."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Iterable, List, NamedTuple, Optional, Tuple

import numpy as np
import trimesh

from m2wr_view.frames import matrix_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Uint8Array, Uint32Array

_TRIANGLES = 11             # of visualization_msgs/Marker
_DELETE, _DELETE_ALL = 2, 3
MOST_FACES = 200000         # of all ground together
_EDGE = 1e-9                # by which a point may lie beside a triangle: it is then on its edge


class Relief(NamedTuple):
    """Ground as triangles, in the fixed frame.

    Attributes
    ----------
    vertices : (n, 3) float64
        [m]
    faces : (m, 3) uint32
    colours : (n, 3) uint8
        Red, green, blue.
    """

    vertices: FloatArray
    faces: Uint32Array
    colours: Uint8Array

    def mesh(self) -> trimesh.Trimesh:
        """Return it with its colours, to be drawn."""
        return trimesh.Trimesh(self.vertices, self.faces, vertex_colors=self.colours, process=False)

    def height(self, x: float, y: float) -> float:
        """Return the greatest height at a place [m]; 0 beside the ground.

        Parameters
        ----------
        x, y : float
            [m]
        """
        found = self._meet(np.array((x, y, 0.0)), np.array((0.0, 0.0, 1.0)))
        return max(found) if found else 0.0

    def hit(self, origin: FloatArray, direction: FloatArray) -> Optional[Tuple[float, float, float]]:
        """Return where a ray first meets the ground [m], or None.

        Parameters
        ----------
        origin, direction : (3,) float64
        """
        ahead = [distance for distance in self._meet(origin, direction) if distance > 0.0]
        if not ahead:
            return None
        x, y, z = (origin + min(ahead) * direction).tolist()
        return x, y, z

    def _meet(self, origin: FloatArray, direction: FloatArray) -> List[float]:
        """Return where a line meets triangles, as multiples of its direction (Moeller and Trumbore, 1997)."""
        corners = self.vertices[self.faces]
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = np.cross(direction, two)
        volume = np.einsum("ij,ij->i", one, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            start = origin - corners[:, 0]
            u = np.einsum("ij,ij->i", start, across) / volume
            beside = np.cross(start, one)
            v = beside.dot(direction) / volume
            distance = np.einsum("ij,ij->i", two, beside) / volume
            inside = (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1.0 + _EDGE) & np.isfinite(distance)
        found: List[float] = distance[inside].tolist()
        return found


def read_relief(markers: Iterable[Any]) -> Optional[Relief]:
    """Return the ground of the markers of one message, all in the fixed frame; None if there is none.

    Corners at the same place are one vertex, so that slopes are drawn without visible edges. A marker without a colour
    for each corner has its own colour. Markers with numbers that are not finite are left out.

    Parameters
    ----------
    markers : iterable of visualization_msgs.msg.Marker
    """
    corners, colours, count = [], [], 0
    for marker in markers:
        whole = len(marker.points) // 3 * 3
        if marker.type != _TRIANGLES or marker.action in (_DELETE, _DELETE_ALL) or not whole:
            continue
        place, turn, scale = marker.pose.position, marker.pose.orientation, marker.scale
        pose = matrix_of((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
        points = np.array([(point.x, point.y, point.z) for point in marker.points[:whole]])
        points = (points * (scale.x, scale.y, scale.z)).dot(pose[:3, :3].T) + pose[:3, 3]
        shades = marker.colors[:whole] if len(marker.colors) >= whole else [marker.color]
        tints = np.array([(shade.r, shade.g, shade.b) for shade in shades])
        count += whole // 3
        if count > MOST_FACES or not (np.all(np.isfinite(points)) and np.all(np.isfinite(tints))):
            count -= whole // 3
            continue
        corners.append(points)
        colours.append(np.broadcast_to(np.clip(tints, 0.0, 1.0), points.shape))
    if not corners:
        return None
    every = np.concatenate(corners)
    keys = np.round(every, 6) + 0.0             # no negative zero: equal places have equal bytes
    _, first, numbers = np.unique(keys.view([("", keys.dtype)] * 3).ravel(), return_index=True, return_inverse=True)
    return Relief(every[first], numbers.reshape(-1, 3).astype(np.uint32),
                  np.round(255.0 * np.concatenate(colours)[first]).astype(np.uint8))


def height_of(relief: Optional[Relief], x: float, y: float) -> float:
    """Return the height of the ground at a place [m]; 0 where it is level.

    Parameters
    ----------
    relief : Relief or None
    x, y : float
        [m]
    """
    return 0.0 if relief is None or not (math.isfinite(x) and math.isfinite(y)) else relief.height(x, y)
