# SPDX-License-Identifier: BSD-3-Clause
"""Gearboxes and screws of SDF: libm2wr_gear.so and libm2wr_screw.so, which the reader of models adds by itself.

Before each step the plugin gives the solver one row between two links, see :meth:`Engine.couple`, so that forces are
passed in both directions.  What the solver leaves as an error is removed at the rate of the world's ``erp``.
"""
from __future__ import annotations

import math
from typing import List, Optional, Tuple

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Vector, compose, cross, rotate
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader


class Screw(Plugin):
    """Lets a screw joint advance by its pitch.

    With axis a through point c, unit vector u at right angles to a, and pitch k [m/rad], the row is the velocity of the
    point c + abs(k) u along a - sign(k) a x u: the way along the axis less k times the rotation about it.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        name = spec.text("joint")
        self._joint, self._record = ctx.joint(name), ctx.joint_record(name)
        if self._record.kind != "screw":
            raise PluginError("%s: joint \"%s\" is of type %s; expected a screw"
                              % (spec.spec.where, name, self._record.kind))
        parent = self._record.parent
        self._child, self._parent = ctx.link(self._record.child), None if parent == "world" else ctx.link(parent)
        x, y, z = self._record.axis.xyz
        self._across = cross((x, y, z), (1.0, 0.0, 0.0) if abs(x) < 0.7 else (0.0, 1.0, 0.0))
        length = math.sqrt(sum(value * value for value in self._across))
        self._across = tuple(value / length for value in self._across)      # type: ignore[assignment]
        self._start = self._way()

    def _way(self) -> float:
        """Return the way of the child along the axis, as seen from the parent [m]."""
        position, orientation = compose(self._physics.link_pose(self._child), self._record.pose)
        axis = rotate(orientation, self._record.axis.xyz)
        origin = (0.0, 0.0, 0.0) if self._parent is None else self._physics.link_pose(self._parent)[0]
        return sum(a * (b - c) for a, b, c in zip(axis, position, origin))

    def next_before(self, now_ns: int) -> Optional[int]:
        return now_ns + self._ctx.step_ns

    def before_step(self, now_ns: int) -> None:
        physics, pitch = self._physics, self._record.pitch
        anchor, orientation = compose(physics.link_pose(self._child), self._record.pose)
        axis, across = rotate(orientation, self._record.axis.xyz), rotate(orientation, self._across)
        around, scale, sign = cross(axis, across), math.sqrt(0.5), math.copysign(1.0, pitch)
        error = self._way() - self._start - pitch * physics.joint_angle(self._joint)
        physics.couple(self._child, self._parent, tuple(a + abs(pitch) * b for a, b in zip(anchor, across)),
                       tuple(scale * (a - sign * b) for a, b in zip(axis, around)),
                       tuple(scale * (sign * a + b) for a, b in zip(axis, around)),
                       -scale * physics.settings.erp * error / (self._ctx.step_ns * 1e-9))


class Gear(Plugin):
    """Lets two wheels with parallel axes mesh: ``driven = -ratio * joint``, by the angles of their joints.

    The row is the velocity in the point where such wheels are in contact, on the line through their centres.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        names = spec.text("joint"), spec.text("driven")
        self._joints, self._records = [ctx.joint(name) for name in names], [ctx.joint_record(name) for name in names]
        self._wheels = ctx.link(spec.text("parent")), ctx.link(spec.text("child"))
        self._carriers = [ctx.link(record.child) for record in self._records]
        self._ratio = spec.number("ratio", 1.0)

    def next_before(self, now_ns: int) -> Optional[int]:
        return now_ns + self._ctx.step_ns

    def _axes(self) -> Tuple[List[Vector], List[Vector]]:
        """Return anchors and axes of both joints in the world."""
        anchors, axes = [], []
        for carrier, record in zip(self._carriers, self._records):
            position, orientation = compose(self._physics.link_pose(carrier), record.pose)
            anchors.append(position)
            axes.append(rotate(orientation, record.axis.xyz))
        return anchors, axes

    def before_step(self, now_ns: int) -> None:
        physics = self._physics
        (first, second), (axis, other) = self._axes()
        apart = tuple(b - a for a, b in zip(first, second))
        along = sum(a * b for a, b in zip(apart, axis))
        apart = tuple(a - along * b for a, b in zip(apart, axis))
        distance = math.sqrt(sum(value * value for value in apart))
        if not distance > 0.0:
            return
        sign = math.copysign(1.0, sum(a * b for a, b in zip(axis, other)))
        # angle of the second wheel about the first one's axis: -ratio times that of the first wheel
        ratio = self._ratio * sign
        first_radius = distance * ratio / (1.0 + ratio)
        other_radius = distance - first_radius
        direction = tuple(value / distance for value in apart)
        angles = [physics.joint_angle(joint) for joint in self._joints]
        # the rates by which joints and wheels turn have the same sign unless the wheel is the joint's parent
        turned = [(1.0 if carrier == wheel else -1.0) for carrier, wheel in zip(self._carriers, self._wheels)]
        error = other_radius * (turned[1] * sign * angles[1] + ratio * turned[0] * angles[0])
        physics.couple(self._wheels[0], self._wheels[1], tuple(a + first_radius * b for a, b in zip(first, direction)),
                       cross(axis, direction), axis, -physics.settings.erp * error / (self._ctx.step_ns * 1e-9))
