# SPDX-License-Identifier: BSD-3-Clause
"""Line segments that change often, as one node of a scene."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

_STEP = 64                  # a node has place for a multiple of so many segments
_BELOW = ((0.0, 0.0, -1000.0), (0.0, 0.0, -1000.01))        # m; a segment that no camera shows


class Segments:
    """Segments whose number changes: the node is made again only if there are too many or far too few for it.

    Browsers keep the place for a fixed number of segments; places that are not used hold one far below the floor.

    Parameters
    ----------
    scene : viser.SceneApi
    name : str
        Of the node.
    colour : (3,) ints
        Red, green, blue, 0 to 255.
    thickness : float
        [pixels]
    """

    def __init__(self, scene: Any, name: str, colour: Tuple[int, int, int], thickness: float) -> None:
        self._scene, self._name, self._colour, self._thickness = scene, name, colour, thickness
        self._node: Any = None
        self._places = 0

    def set(self, ends: FloatArray) -> None:
        """Show these segments instead of those before.

        Parameters
        ----------
        ends : (n, 2, 3) floats
            Where they start and end [m].
        """
        count = len(ends)
        if not count and self._node is None:
            return
        places = self._places
        if count > places or places > _STEP and 4 * count < places:
            places = max(1, -(-count // _STEP)) * _STEP
        points = np.empty((places, 2, 3), dtype=np.float32)
        points[:count], points[count:] = ends, _BELOW
        if places == self._places:
            self._node.points = points          # viser sends nothing if they are the same
        else:
            self._places = places
            self._node = self._scene.add_line_segments(self._name, points, self._colour, thickness=self._thickness,
                                                       thickness_units="screen")
