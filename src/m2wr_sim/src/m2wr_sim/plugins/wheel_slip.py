# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_wheel_slip.so and libWheelSlipPlugin.so: wheels that slip in proportion to the force on the ground."""
from __future__ import annotations

import math
from functools import partial
from typing import Any, List, NamedTuple, Optional

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Vector, compose, cross, rotate, rotate_inverse
from m2wr_sim.messages import JointState, find_message
from m2wr_sim.model.types import Cylinder, Sphere
from m2wr_sim.physics.engine import FARTHEST
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader
from m2wr_sim.plugins.rejections import Rejections

Float64: Any = find_message("std_msgs.msg", "Float64")

_GREATEST = 1e3         # compliance without unit; at 1 a wheel whose grip is its weight already spins in place


class _Wheel(NamedTuple):
    """``frame``: of the joint in the link, ``axis`` in that frame; ``radius`` [m], ``load`` [N]."""

    name: str
    link: int
    joint: int
    frame: Any
    axis: Vector
    radius: float
    load: float
    lateral: float
    longitudinal: float


class WheelSlip(Plugin):
    """Lets wheels slip: v = C r abs(w) F / N, with compliance C, radius r, rate w, force F and the usual load N.

    C is given for each direction: along the wheel's axis (lateral) and across it.  The expression is that of Gazebo's
    plugin, which takes the direction from ``fdir1``; here it is always the wheel's axis.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        self._rejections, self._now_ns = Rejections(ctx), ctx.now_ns
        place = (spec.spec.find("robotNamespace") or "").strip("/") or "wheel_slip"
        place = "/%s/%s" % (ctx.model_name, place)
        self._wheels = self._read_wheels(spec)
        self._compliances = [[wheel.lateral, wheel.longitudinal] for wheel in self._wheels]
        for index, direction in enumerate(("lateral", "longitudinal")):
            self._take(index, ctx.parameter("%s/slip_compliance_unitless_%s" % (place, direction)))
            ctx.subscribe("%s/%s_compliance" % (place, direction), Float64, partial(self._store, index))
        self._slips = ctx.advertise(place + "/wheel_slips", JointState, queue_size=1000)
        gravity = ctx.physics.settings.gravity
        length = math.sqrt(sum(value * value for value in gravity))
        down = tuple(value / length for value in gravity) if length > 0.0 else (0.0, 0.0, -1.0)
        x, y, z = rotate_inverse(ctx.model_state().orientation, down)
        self._down = (x, y, z)
        for wheel in self._wheels:
            self._physics.let_slip(wheel.link, rotate(wheel.frame[1], wheel.axis))

    def _read_wheels(self, spec: PluginReader) -> List[_Wheel]:
        """Return the wheels; one that cannot be used is left out with a warning, as in Gazebo."""
        found = []
        for reader in spec.groups("wheel"):
            try:
                found.append(self._read_wheel(reader))
            except PluginError as error:
                self._ctx.log.error("%s; this wheel does not slip", error)
        if not found:
            raise PluginError("%s: no <wheel link_name=\"...\"> that can be used" % spec.spec.where)
        return found

    def _read_wheel(self, spec: PluginReader) -> _Wheel:
        ctx, where = self._ctx, spec.spec.where
        name = spec.text("@link_name")
        link, record = ctx.link(name), ctx.link_record(name)
        joint = ctx.joint_above(name)
        if joint is None or joint.kind != "revolute":
            raise PluginError("%s: link \"%s\" is no wheel; expected a link below a joint that rotates" % (where, name))
        radii = [shape.geometry.radius for shape in record.collisions if isinstance(shape.geometry, (Cylinder, Sphere))]
        radius = spec.number("wheel_radius", 0.0)
        if radius <= 0.0 and len(record.collisions) == len(radii) == 1:
            radius = radii[0]
        load = spec.number("wheel_normal_force", 0.0)
        if not 0.0 < radius <= FARTHEST or load <= 0.0:
            raise PluginError("%s: link \"%s\": radius %g m and <wheel_normal_force> %g N; expected both above 0, the "
                              "radius in <wheel_radius> unless a cylinder or sphere is the only collision"
                              % (where, name, radius, load))
        return _Wheel(name, link, ctx.joint(joint.name), joint.pose, joint.axis.xyz, radius, load,
                      spec.number("slip_compliance_lateral", 0.0, minimum=0.0),
                      spec.number("slip_compliance_longitudinal", 0.0, minimum=0.0))

    def _store(self, index: int, message: Any) -> None:
        self._take(index, message.data)

    def _take(self, index: int, value: Any) -> None:
        """Use a compliance for all wheels; None and numbers below 0 have no effect, as in Gazebo."""
        if value is None or isinstance(value, (int, float)) and value < 0.0:
            return
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not value <= _GREATEST:
            self._rejections.warn(self._now_ns, "%s: wheel slip: refused a compliance of %r; expected a number from 0 "
                                  "to %g", self._ctx.model_name, value, _GREATEST)
            return
        for compliances in self._compliances:
            compliances[index] = float(value)

    def next_before(self, now_ns: int) -> Optional[int]:
        self._now_ns = now_ns
        return now_ns + self._ctx.step_ns

    def before_step(self, now_ns: int) -> None:
        physics, rows, wanted = self._physics, [], self._slips.wanted()
        down = rotate(self._ctx.model_state().orientation, self._down) if wanted else self._down
        for wheel, (lateral, longitudinal) in zip(self._wheels, self._compliances):
            state = physics.link_state(wheel.link)
            anchor, orientation = compose((state.position, state.orientation), wheel.frame)
            axis = rotate(orientation, wheel.axis)
            rate = sum(a * b for a, b in zip(axis, state.angular_velocity))
            scale = wheel.radius * abs(rate) / wheel.load
            physics.set_slip(wheel.link, scale * lateral, scale * longitudinal)
            if wanted:
                arm = tuple(a - b for a, b in zip(anchor, state.position))
                turn = cross(state.angular_velocity, (arm[0], arm[1], arm[2]))
                velocity = tuple(a + b for a, b in zip(state.linear_velocity, turn))
                rolled = wheel.radius * physics.joint_rate(wheel.joint)
                ahead = sum(a * b for a, b in zip(cross(down, axis), velocity))
                rows.append((wheel.name, ahead - rolled, sum(a * b for a, b in zip(axis, velocity)), rolled))
        if wanted:
            self._publish(now_ns, rows)

    def _publish(self, now_ns: int, rows: List[Any]) -> None:
        """Publish the slips in the fields of Gazebo's plugin: position ahead, velocity sideways, effort the rim's."""
        names, ahead, sideways, rolled = (list(column) for column in zip(*sorted(rows)))
        message = JointState(name=names, position=ahead, velocity=sideways, effort=rolled)
        message.header.stamp = self._ctx.moment(now_ns)
        self._slips.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._now_ns = now_ns
        self._rejections.reset()
