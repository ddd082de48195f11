# SPDX-License-Identifier: BSD-3-Clause
"""Markers that nodes publish for viewers, such as frontiers: lines, points and shapes, as rviz keeps them."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_view.frames import matrix_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

# of visualization_msgs/Marker
_ARROW, _CUBE, _SPHERE, _CYLINDER, _STRIP, _LIST, _CUBES, _SPHERES, _POINTS, _TEXT = range(10)
_DELETE, _DELETE_ALL = 2, 3
MOST = 2000                 # markers of a topic
MOST_POINTS = 20000         # of a marker
LONGEST_TEXT = 80           # characters
_LEAST, _GREATEST = 0.01, 10.0      # m; size of a drawn point


class Annotation(NamedTuple):
    """One marker as it is drawn.

    Attributes
    ----------
    kind : str
        ``points``, ``lines`` or ``text``.
    points : (n, 3) float64
        In the fixed frame [m]; ends of lines in pairs.
    colour : (int, int, int)
        0 to 255.
    size : float
        Of a point [m].
    text : str
    """

    kind: str
    points: FloatArray
    colour: Tuple[int, int, int]
    size: float
    text: str


class _Kept(NamedTuple):
    annotation: Annotation
    expires: float          # simulated time [s]


class Annotations:
    """The markers of one topic.

    Attributes
    ----------
    version : int
        Increases with each change.
    """

    def __init__(self) -> None:
        self._kept: Dict[Tuple[str, int], _Kept] = {}
        self.version = 0

    def update(self, markers: Iterable[Any], now: float, pose_of: Callable[[str], Optional[FloatArray]]) -> None:
        """Take the markers of a message; those without finite numbers or a known frame are left out.

        Parameters
        ----------
        markers : iterable of visualization_msgs.msg.Marker
        now : float
            Simulated time [s].
        pose_of : callable
            Name of a frame -> its pose (4, 4) in the fixed frame, or None.
        """
        for marker in markers:
            name = (marker.ns, marker.id)
            if marker.action == _DELETE_ALL:
                self._kept = {}
            elif marker.action == _DELETE:
                self._kept.pop(name, None)
            else:
                found = _read(marker, pose_of(marker.header.frame_id))
                lifetime = marker.lifetime.to_sec()
                if found is None:
                    self._kept.pop(name, None)
                elif len(self._kept) < MOST or name in self._kept:
                    self._kept[name] = _Kept(found, now + lifetime if lifetime > 0.0 else math.inf)
        self.version += 1

    def present(self, now: float) -> List[Annotation]:
        """Return what is to be drawn; markers whose lifetime [s] is over at ``now`` are dropped."""
        over = [name for name, kept in self._kept.items() if kept.expires < now]
        for name in over:
            del self._kept[name]
        self.version += bool(over)
        return [kept.annotation for kept in list(self._kept.values())]


def _read(marker: Any, frame: Optional[FloatArray]) -> Optional[Annotation]:
    place, turn = marker.pose.position, marker.pose.orientation
    quaternion = (turn.x, turn.y, turn.z, turn.w)
    # rviz takes a quaternion of zeros, which many nodes send, as no rotation
    own = matrix_of((place.x, place.y, place.z), quaternion if any(quaternion) else (0.0, 0.0, 0.0, 1.0))
    points = np.array([(point.x, point.y, point.z) for point in marker.points[:MOST_POINTS]]).reshape(-1, 3)
    shade, size = (marker.color.r, marker.color.g, marker.color.b), marker.scale.x
    if frame is None or not (np.all(np.isfinite(own)) and np.all(np.isfinite(points)) and np.all(np.isfinite(shade))
                             and math.isfinite(size)):
        return None
    kind, text = "points", ""
    if marker.type == _STRIP:
        kind, points = "lines", np.repeat(points, 2, axis=0)[1:-1]
    elif marker.type == _LIST:
        kind, points = "lines", points[:len(points) // 2 * 2]
    elif marker.type == _ARROW:
        ends = points if len(points) == 2 else np.array(((0.0, 0.0, 0.0), (size, 0.0, 0.0)))
        kind, points = "lines", ends
    elif marker.type == _TEXT:
        kind, text, points = "text", marker.text[:LONGEST_TEXT], np.zeros((1, 3))
    elif marker.type in (_CUBE, _SPHERE, _CYLINDER):
        points = np.zeros((1, 3))
    elif marker.type not in (_POINTS, _CUBES, _SPHERES):
        return None
    if not len(points):
        return None
    pose = frame.dot(own)
    red, green, blue = (int(round(255 * min(1.0, max(0.0, float(part))))) for part in shade)
    return Annotation(kind, points.dot(pose[:3, :3].T) + pose[:3, 3], (red, green, blue),
                      min(_GREATEST, max(_LEAST, size)), text)
