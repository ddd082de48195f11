# SPDX-License-Identifier: BSD-3-Clause
"""libhector_gazebo_ros_magnetic.so: the earth's magnetic field in the axes of a body."""
from __future__ import annotations

import math

from m2wr_sim.geometry import rotate_inverse
from m2wr_sim.messages import MagneticField, Vector3Stamped
from m2wr_sim.plugins.base import PluginReader
from m2wr_sim.plugins.hector import HectorSensor


class HectorMagnetic(HectorSensor):
    """A magnetometer; the field is the same everywhere."""

    def _set_up(self, spec: PluginReader) -> None:
        self._link, body = self._body(spec)
        self._frame = self._ctx.frame(spec.text("frameId", body), self._namespace)
        strength = spec.number("magnitude", 1.0)
        heading = math.radians(spec.number("referenceHeading", 0.0) - spec.number("declination", 0.0))
        dip = math.radians(spec.number("inclination", 60.0))
        self._field = (strength * math.cos(dip) * math.cos(heading), strength * math.cos(dip) * math.sin(heading),
                       -strength * math.sin(dip))
        self._kind = MagneticField if spec.flag("useMagneticFieldMsgs", False) else Vector3Stamped
        self._field_error = self._error(spec, "", 3)
        self._port = self._advertise(spec.text("topicName", "magnetic"), self._kind)

    def _measure(self, now_ns: int, elapsed: float) -> None:
        orientation = self._physics.link_state(self._link).orientation
        values = self._field_error.measure(rotate_inverse(orientation, self._field), elapsed)
        if not self._port.wanted():
            return
        message = self._kind()
        message.header.stamp, message.header.frame_id = self._ctx.moment(now_ns), self._frame
        vector = message.magnetic_field if self._kind is MagneticField else message.vector
        vector.x, vector.y, vector.z = map(float, values)
        self._port.publish(message)
