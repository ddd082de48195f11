# SPDX-License-Identifier: BSD-3-Clause
"""Transforms in space: translation [m] and quaternion x, y, z, w."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray

    Transform = Tuple[Tuple[float, float, float], Tuple[float, float, float, float]]    # translation, quaternion


def transform_parts(transform: Any) -> Transform:
    """Return translation and quaternion x, y, z, w of a TransformStamped."""
    t, r = transform.transform.translation, transform.transform.rotation
    return (t.x, t.y, t.z), (r.x, r.y, r.z, r.w)


def rotation(quaternion: ArrayLike) -> FloatArray:
    """Return the rotation matrix (3, 3) of a quaternion x, y, z, w of any length but 0."""
    x, y, z, w = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
