# SPDX-License-Identifier: BSD-3-Clause
"""Which body, and which place on the ground, a click on the page means."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.errors import ViewError

if TYPE_CHECKING:
    from m2wr_live.scene.relief import Relief
    from m2wr_live.scene.shapes import Geometry, Shape
    from m2wr_node.array_types import FloatArray

FARTHEST = 1000.0           # m from the camera; a click near the horizon means no place


def read_ray(origin: object, direction: object) -> FloatArray:
    """Return origin and direction of a ray that a page sent, (2, 3) float64.

    Parameters
    ----------
    origin, direction : object
        Expected to be sequences of three numbers.

    Raises
    ------
    ViewError
        If they are anything else, or a number is not finite.
    """
    try:
        ray = np.array((origin, direction), dtype=float)
    except (TypeError, ValueError):
        ray = np.full((2, 3), np.nan)
    if ray.shape != (2, 3) or not np.all(np.isfinite(ray)):
        raise ViewError("a click along the ray from %s in direction %s; expected three finite numbers each, so it is "
                        "ignored" % (repr(origin)[:60], repr(direction)[:60]))
    return ray


def on_ground(origin: Sequence[float], direction: Sequence[float],
              relief: Optional[Relief] = None) -> Optional[Tuple[float, float, float]]:
    """Return where a ray meets the ground [m]: a relief, beside it the plane z = 0; or None.

    Parameters
    ----------
    origin, direction : (3,) floats
    relief : Relief, optional
    """
    start, along = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    if not (np.all(np.isfinite(start)) and np.all(np.isfinite(along))):
        return None
    found = None if relief is None else relief.hit(start, along)
    if found is None and along[2] < 0.0 < start[2]:
        x, y, _ = (start - start[2] / along[2] * along).tolist()
        found = (x, y, 0.0)
    return found if found is not None and float(np.linalg.norm(found - start)) <= FARTHEST else None


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
