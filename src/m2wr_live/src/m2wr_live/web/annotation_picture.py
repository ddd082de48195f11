# SPDX-License-Identifier: BSD-3-Clause
"""Draws markers for viewers with viser."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_live.scene.annotations import Annotation
    from m2wr_live.scene.live_scene import LiveScene

_LIFT = (0.0, 0.0, 0.03)    # m; above maps, costmaps and paths


def node_name(topic: str) -> str:
    """Return the name of a scene's node for a topic."""
    return "".join(sign if sign.isalnum() else "_" for sign in topic.strip("/")) or "_"


class AnnotationPicture:
    """The markers of all topics, as children of the scene's node ``/markers``.

    Parameters
    ----------
    scene : viser.SceneApi
    source : LiveScene
    """

    def __init__(self, scene: Any, source: LiveScene) -> None:
        self._scene, self._source = scene, source
        self._nodes: Dict[str, List[Any]] = {}
        self._versions: Dict[str, int] = {}

    def draw(self) -> None:
        """Send the topics that have changed."""
        for topic, known in list(self._source.annotations.items()):
            present = known.present(self._source.now)
            if self._versions.get(topic) != known.version:
                self._versions[topic] = known.version
                self._replace(topic, present)

    def _replace(self, topic: str, present: List[Annotation]) -> None:
        """Draw a topic with one message for all points of a size, one for all lines and one for each text."""
        place = "/markers/" + node_name(topic)
        nodes = []
        lines = [entry for entry in present if entry.kind == "lines"]
        if lines:
            ends = np.concatenate([entry.points for entry in lines]).reshape(-1, 2, 3) + _LIFT
            nodes.append(self._scene.add_line_segments(
                place + "/lines", ends.astype(np.float32), _colours(lines).reshape(-1, 2, 3), thickness=3.0,
                thickness_units="screen"))
        for number, size in enumerate(sorted({entry.size for entry in present if entry.kind == "points"})):
            group = [entry for entry in present if entry.kind == "points" and entry.size == size]
            points = np.concatenate([entry.points for entry in group]) + _LIFT
            nodes.append(self._scene.add_point_cloud(
                "%s/points%d" % (place, number), points.astype(np.float32), _colours(group), point_size=size,
                point_shape="circle"))
        for number, entry in enumerate(entry for entry in present if entry.kind == "text"):
            where: Tuple[float, ...] = tuple(entry.points[0])
            nodes.append(self._scene.add_label("%s/text%d" % (place, number), entry.text, position=where))
        for node in self._nodes.get(topic, []):
            if node.name not in {new.name for new in nodes}:
                node.remove()
        self._nodes[topic] = nodes


def _colours(entries: List[Annotation]) -> Any:
    """Return the colour of each point (n, 3) uint8."""
    return np.concatenate([np.tile(np.array(entry.colour, dtype=np.uint8), (len(entry.points), 1))
                           for entry in entries])
