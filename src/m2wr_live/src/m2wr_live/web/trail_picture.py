# SPDX-License-Identifier: BSD-3-Clause
"""Draws where robots have been: what is long past is sent once, the newest metre of all robots in one message."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Sequence, Tuple

import numpy as np

from m2wr_live.web.segments import Segments

if TYPE_CHECKING:
    from m2wr_live.scene.live_scene import LiveScene, Robot
    from m2wr_node.array_types import FloatArray

CHUNK = 120                 # segments of a node
TAIL = 20                   # segments after which they are moved from the tail to a node; CHUNK is a multiple
_COLOUR, _THICKNESS = (0, 114, 178), 4.0
_ABOVE = 0.02               # m; above the ground and maps


def segments_of(points: Sequence[Tuple[float, float, float, bool]]) -> FloatArray:
    """Return the segments (n, 2, 3) [m] of a part of a trail; none where the robot was placed and did not drive."""
    places = np.array([(x, y, z + _ABOVE) for x, y, z, _ in points]).reshape(-1, 3)
    driven = np.array([driven for _, _, _, driven in points[1:]], dtype=bool)
    return np.stack((places[:-1], places[1:]), axis=1)[driven]


class TrailPicture:
    """The trails of all robots, as children of the scene's node ``/trails``.

    Parameters
    ----------
    scene : viser.SceneApi
    source : LiveScene
    """

    def __init__(self, scene: Any, source: LiveScene) -> None:
        self._scene, self._source = scene, source
        self._tail = Segments(scene, "/trails/tail", _COLOUR, _THICKNESS)
        self._known: object = None
        self._moved: Dict[str, int] = {}            # robot -> number of its first point in the tail
        self._nodes: Dict[str, Dict[int, Any]] = {}     # robot -> number of the chunk -> node

    def draw(self) -> None:
        """Send what has changed."""
        robots = list(self._source.robots.values())
        known = (self._source.run, [robot.name for robot in robots])
        if known != self._known:
            self._known = known
            self._forget_all()
        tails: List[FloatArray] = []
        for number, robot in enumerate(robots):
            if robot.trail:
                end = max(robot.first, (robot.first + len(robot.trail) - 1) // TAIL * TAIL)
                if end != self._moved.get(robot.name, 0):
                    self._draw_chunks(number, robot, end)
                tails.append(segments_of(robot.trail[end - robot.first:]))
        self._tail.set(np.concatenate(tails) if tails else np.zeros((0, 2, 3)))

    def _draw_chunks(self, number: int, robot: Robot, end: int) -> None:
        """Draw the trail up to the point number ``end``, and forget what the robot has forgotten."""
        nodes = self._nodes.setdefault(robot.name, {})
        begin = self._moved.get(robot.name, robot.first)
        self._moved[robot.name] = end
        for chunk in range(max(begin, robot.first) // CHUNK, (end - 1) // CHUNK + 1):
            first = max(0, chunk * CHUNK - robot.first)
            last = min((chunk + 1) * CHUNK, end) - robot.first
            segments = segments_of(robot.trail[first:last + 1])
            if len(segments):
                nodes[chunk] = self._scene.add_line_segments(       # takes the place of the one of this name
                    "/trails/%d/%d" % (number, chunk), segments.astype(np.float32), _COLOUR, thickness=_THICKNESS,
                    thickness_units="screen")
        for chunk in [chunk for chunk in nodes if (chunk + 1) * CHUNK <= robot.first]:
            nodes.pop(chunk).remove()

    def _forget_all(self) -> None:
        for nodes in self._nodes.values():
            for node in nodes.values():
                node.remove()
        self._nodes, self._moved = {}, {}
