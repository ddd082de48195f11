# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_multicamera.so: several cameras of one sensor, taken at the same time."""
from __future__ import annotations

from typing import Any, List, Tuple

from m2wr_sim.errors import PluginError
from m2wr_sim.messages import CameraInfo, Image
from m2wr_sim.plugins.camera import CameraPlugin, Eye, PluginReader


class Multicamera(CameraPlugin):
    """Cameras whose names contain ``left`` and ``right``; a subscriber of one wakes all."""

    def _set_up(self, spec: PluginReader) -> None:
        self._eyes: List[Tuple[Eye, Any, Any]] = []
        baseline = spec.number("hackBaseline", 0.0)
        for view in self._ctx.sensor.cameras:
            side = next((side for side in ("left", "right") if side in view.name), "")
            if not side:
                raise PluginError("%s: camera \"%s\" of sensor %s: expected a name that contains left or right"
                                  % (spec.spec.where, view.name, self._ctx.sensor.name))
            eye = Eye(spec, self._ctx, view, self._frame, "noise of " + view.name, baseline if side == "right" else 0.0)
            self._eyes.append((eye, self._open(spec.text("imageTopicName", "image_raw"), Image, side, latched=True),
                               self._open(spec.text("cameraInfoTopicName", "camera_info"), CameraInfo, side)))

        spec.defaults[:] = list(dict.fromkeys(spec.defaults))       # each camera has read the same tags

    def _publish(self, stamp: Any) -> None:
        for eye, image_port, info_port in self._eyes:
            if image_port.wanted() or info_port.wanted():
                picture = eye.take()
                if image_port.wanted():
                    image_port.publish(eye.image(stamp, picture))
                info_port.publish(eye.info_at(stamp))

    def _restart_noise(self) -> None:
        for eye, _, _ in self._eyes:
            eye.restart()
