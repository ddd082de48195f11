# SPDX-License-Identifier: BSD-3-Clause
"""Joints that follow another joint: ``<mimic>`` of URDF, and the mimic plugins that grippers use in Gazebo.

Libraries: libroboticsgroup_gazebo_mimic_joint_plugin.so, its older names, and libgazebo_mimic_joint_plugin.so.
"""
from __future__ import annotations

import math
from typing import Any, Optional

from m2wr_sim.errors import PluginError
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader, driven_joint
from m2wr_sim.ros_control.hardware import FASTEST_SERVO, UNBOUNDED_EFFORT
from m2wr_sim.ros_control.pid import Pid, read_gains


class MimicJoint(Plugin):
    """Drives a joint to ``multiplier * position + offset`` of another one in every step.

    Without PID gains a motor does it, with the greatest force ``maxEffort``, by default the joint's effort limit.
    Gazebo places the joint instead, so that it passes through what it grasps.  The followed joint feels no reaction.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        leader, follower = spec.text("joint"), spec.text("mimicJoint")
        self._leader, self._follower = driven_joint(ctx, spec, leader), driven_joint(ctx, spec, follower)
        if self._leader == self._follower:
            raise PluginError("%s: joint \"%s\" follows itself; expected another joint in <joint>"
                              % (spec.spec.where, follower))
        axis = ctx.joint_record(follower).axis
        self._lower, self._upper = axis.lower, axis.upper
        self._multiplier, self._offset = spec.number("multiplier", 1.0), spec.number("offset", 0.0)
        self._tolerance = spec.number("sensitiveness", 0.0, minimum=0.0)
        limit = axis.effort if axis.effort > 0.0 else UNBOUNDED_EFFORT
        self._effort = min(spec.number("maxEffort", limit, minimum=0.0), UNBOUNDED_EFFORT)
        self._fastest = min(axis.velocity, FASTEST_SERVO) if axis.velocity > 0.0 else FASTEST_SERVO
        self._pid: Optional[Pid] = self._read_pid(spec, follower)
        self._motor: Optional[float] = None
        if self._pid is None:
            # targets keep the limits; at a stop the solver would add the motor's greatest force to the joint
            ctx.physics.change_joint(self._follower, axis, {"lower": -math.inf, "upper": math.inf})

    def _read_pid(self, spec: PluginReader, follower: str) -> Optional[Pid]:
        """Return the controller with the gains of a parameter, if ``<hasPID>`` is there; its text may name it."""
        if spec.spec.find("hasPID") is None:
            return None
        place = spec.text("hasPID", "gazebo_ros_control/pid_gains/" + follower).strip("/")
        namespace = (spec.spec.find("robotNamespace") or "").strip("/")
        place = "/" + "/".join(part for part in (namespace, place) if part)
        values: Any = self._ctx.parameter(place)
        if not isinstance(values, dict) or "p" not in values:
            self._ctx.log.warning("%s: <hasPID>, but there is no parameter %s/p; joint %s is driven by a motor",
                                  self._ctx.model_name, place, follower)
            return None
        return Pid(read_gains(values, place))

    def next_before(self, now_ns: int) -> Optional[int]:
        return now_ns + self._ctx.step_ns

    def before_step(self, now_ns: int) -> None:
        physics, dt = self._physics, self._ctx.step_ns * 1e-9
        rate = physics.joint_rate(self._leader)
        wanted = self._multiplier * (physics.joint_angle(self._leader) + rate * dt) + self._offset
        wanted = min(self._upper, max(self._lower, wanted))
        error = wanted - physics.joint_angle(self._follower)
        if not math.isfinite(error):
            return
        if abs(error) < self._tolerance:
            error = 0.0
        if self._pid is not None:
            effort = self._pid.update(error, dt)
            physics.add_joint_force(self._follower, min(self._effort, max(-self._effort, effort)))
            return
        speed = min(self._fastest, max(-self._fastest, error / dt))
        if speed != self._motor:
            self._motor = speed
            physics.set_joint_motor(self._follower, speed, self._effort)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._motor = None
        if self._pid is not None:
            self._pid.reset()
