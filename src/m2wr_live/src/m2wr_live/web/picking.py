# SPDX-License-Identifier: BSD-3-Clause
"""Which body, and which place on the ground, a click on the page means."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, List, Optional, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_live.scene.shapes import Geometry, Shape
    from m2wr_view.array_types import FloatArray

FARTHEST = 1000.0           # m from the camera; a click near the horizon means no place


def on_ground(origin: Sequence[float], direction: Sequence[float]) -> Optional[Tuple[float, float]]:
    """Return where a ray meets the ground z = 0 [m], or None.

    Parameters
    ----------
    origin, direction : (3,) floats
    """
    start, along = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    if not (np.all(np.isfinite(start)) and np.all(np.isfinite(along))) or along[2] >= 0.0 or start[2] <= 0.0:
        return None
    distance = -start[2] / along[2]
    if distance * float(np.linalg.norm(along)) > FARTHEST:
        return None
    return float(start[0] + distance * along[0]), float(start[1] + distance * along[1])


def first_hit(origin: Sequence[float], direction: Sequence[float], shapes: Sequence[Shape],
              poses: Sequence[FloatArray], geometries: Dict[str, Geometry]) -> Optional[str]:
    """Return the owner of the first shape whose bounding box a ray meets, or None.

    Parameters
    ----------
    origin, direction : (3,) floats
    shapes : sequence of Shape
    poses : sequence of (4, 4) float64
        Of the shapes, in the frame of the ray.
    geometries : dict of str to Geometry
    """
    start, along = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    if not shapes or not (np.all(np.isfinite(start)) and np.all(np.isfinite(along))):
        return None
    extents: Dict[str, FloatArray] = {key: np.array((item.vertices.min(axis=0), item.vertices.max(axis=0)))
                                      for key, item in geometries.items()}
    bounds = np.array([extents[shape.geometry] * np.array(shape.scale) for shape in shapes])
    matrices = np.asarray(poses)
    local = np.einsum("nji,nj->ni", matrices[:, :3, :3], start - matrices[:, :3, 3])
    ray = np.einsum("nji,j->ni", matrices[:, :3, :3], along)
    ray = np.where(np.abs(ray) < 1e-12, 1e-12, ray)
    one, two = (bounds[:, 0] - local) / ray, (bounds[:, 1] - local) / ray
    enter, leave = np.minimum(one, two).max(axis=1), np.maximum(one, two).min(axis=1)
    met: List[int] = [int(index) for index in np.flatnonzero((enter <= leave) & (leave > 0.0))]
    return shapes[min(met, key=lambda index: float(enter[index]))].owner if met else None
