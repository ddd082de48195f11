# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_harness.so and libHarnessPlugin.so: joints to the world from which a model hangs, with a winch."""
from __future__ import annotations

import math
from typing import Any, Dict, Optional, Tuple

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Pose, quaternion_from_rpy
from m2wr_sim.messages import find_message
from m2wr_sim.model.types import Axis, Joint
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.plugins.rejections import Rejections

Bool: Any = find_message("std_msgs.msg", "Bool")
Float32: Any = find_message("std_msgs.msg", "Float32")

_NO_LIMIT = 1e16        # m, as in descriptions
_KINDS = ("revolute", "prismatic", "fixed", "ball")
_AXIS = "axis/"


class WinchPid:
    """Gazebo's PID: its output counteracts the error; ``i_max < i_min`` or ``cmd_max < cmd_min`` switch a limit off.

    Parameters
    ----------
    p, i, d : float
        Gains.
    i_max, i_min : float
        Limits of the integral term.
    cmd_max, cmd_min : float
        Limits of the output.
    """

    def __init__(self, p: float = 0.0, i: float = 0.0, d: float = 0.0, i_max: float = 0.0, i_min: float = 0.0,
                 cmd_max: float = 0.0, cmd_min: float = 0.0) -> None:
        self._gains, self._integral_limits, self._limits = (p, i, d), (i_min, i_max), (cmd_min, cmd_max)
        self.reset()

    def reset(self) -> None:
        """Discard integral and last error."""
        self._integral, self._last = 0.0, 0.0

    def update(self, error: float, dt: float) -> float:
        """Return the output for an error after a step.

        Parameters
        ----------
        error : float
            Value less target.
        dt : float
            Step [s].

        Returns
        -------
        float
        """
        p, i, d = self._gains
        self._integral = _within(self._integral + i * dt * error, *self._integral_limits)
        change, self._last = (error - self._last) / dt, error
        return _within(-p * error - self._integral - d * change, *self._limits)


def _within(value: float, least: float, greatest: float) -> float:
    return min(greatest, max(least, value)) if greatest >= least else value


class Harness(Plugin):
    """Holds a model by joints to the world, and moves one of them, the winch, by two PIDs as Gazebo's plugin does.

    At speed 0 the first PID holds the position, and the second one brakes; otherwise the second one keeps the speed.
    The second one only pulls.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics, self._rejections = ctx, ctx.physics, Rejections(ctx)
        self._now_ns = ctx.now_ns
        joints = [self._read_joint(reader) for reader in spec.groups("joint")]
        if not joints:
            raise PluginError("%s: no <joint> in the harness; expected at least one, to the world" % spec.spec.where)
        spec.ignore("winch")
        winch = next(iter(spec.groups("winch")), PluginReader(spec.spec, ("winch",)))
        names = [joint.name for joint in joints]
        chosen = self._choose(spec, "<winch><joint>", winch.spec.find("joint"), names)
        if not joints[names.index(chosen)].axes():
            raise PluginError("%s: the winch \"%s\" is of type %s; expected a joint with an axis" % (
                spec.spec.where, chosen, joints[names.index(chosen)].kind))
        detach = self._choose(spec, "<detach>", spec.text("detach", names[0]), names)
        self._position_pid, self._speed_pid = _read_pid(winch, "pos_pid"), _read_pid(winch, "vel_pid")
        self._joints: Dict[str, int] = {}
        try:
            for joint in joints:
                self._joints[joint.name] = ctx.join(joint)
        except PluginError:
            self.close()
            raise
        self._winch, self._detached_by = self._joints[chosen], detach
        self._target, self._speed = 0.0, 0.0
        place = "/%s/harness/" % ctx.model_name
        ctx.subscribe(place + "velocity", Float32, lambda message: self._set_speed(message.data))
        ctx.subscribe(place + "detach", Bool, lambda message: self._detach() if message.data else None)

    def _choose(self, spec: PluginReader, tag: str, name: Optional[str], names: Any) -> str:
        """Return the name of a joint of the harness, the first one where none of that name exists, as in Gazebo."""
        if name in names:
            return str(name)
        self._ctx.log.warning("%s: %s names \"%s\"; expected one of %s; using the first", spec.spec.where, tag,
                              name or "", ", ".join(names))
        return str(names[0])

    def _read_joint(self, spec: PluginReader) -> Joint:
        where, kind, parent = spec.spec.where, spec.text("@type"), spec.text("parent", "world")
        if kind not in _KINDS:
            raise PluginError("%s: joint type \"%s\"; expected one of %s" % (where, kind, ", ".join(_KINDS)))
        x, y, z = spec.vector(_AXIS + "xyz") if spec.spec.find(_AXIS + "xyz") else (0.0, 0.0, 1.0)
        length = math.sqrt(x * x + y * y + z * z)
        if length < 1e-9:
            raise PluginError("%s: the axis of joint \"%s\" has no length" % (where, spec.text("@name")))
        lower, upper = (_bound(spec, tag, default) for tag, default in (("lower", -_NO_LIMIT), ("upper", _NO_LIMIT)))
        if lower > upper:
            raise PluginError("%s: joint \"%s\": the lower limit %g is above the upper one, %g" % (
                where, spec.text("@name"), lower, upper))
        axis = Axis(xyz=(x / length, y / length, z / length), lower=lower, upper=upper,
                    damping=spec.number(_AXIS + "dynamics/damping", 0.0, minimum=0.0))
        return Joint(spec.text("@name"), kind, parent, spec.text("child"), _read_pose(spec), axis)

    def _set_speed(self, speed: float) -> None:
        if not abs(speed) <= FASTEST:
            self._rejections.warn(self._now_ns, "%s: harness: refused a speed of %s; expected a finite number of at "
                                  "most %g m/s", self._ctx.model_name, speed, FASTEST)
            return
        if not self._joints:
            self._rejections.warn(self._now_ns, "%s: harness: the model is detached; the speed %s has no effect",
                                  self._ctx.model_name, speed)
            return
        self._speed = speed
        if speed == 0.0:
            self._target = self._physics.joint_angle(self._winch)
            self._position_pid.reset()

    def _detach(self) -> None:
        if self._joints:
            self._ctx.log.info("%s: harness: detached", self._ctx.model_name)
            self._physics.part(self._joints[self._detached_by])
            self._joints = {}           # the others stay, as in Gazebo; nothing moves the winch any more

    def next_before(self, now_ns: int) -> Optional[int]:
        self._now_ns = now_ns
        return now_ns + self._ctx.step_ns if self._joints else NEVER

    def before_step(self, now_ns: int) -> None:
        physics, dt = self._physics, self._ctx.step_ns * 1e-9
        error = physics.joint_angle(self._winch) - self._target if self._speed == 0.0 else 0.0
        rate_error = physics.joint_rate(self._winch) - self._speed
        if math.isfinite(error) and math.isfinite(rate_error):
            force = self._position_pid.update(error, dt) + max(0.0, self._speed_pid.update(rate_error, dt))
            physics.add_joint_force(self._winch, force)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._now_ns, self._target, self._speed = now_ns, 0.0, 0.0
        self._position_pid.reset()
        self._speed_pid.reset()
        self._rejections.reset()

    def close(self) -> None:
        for joint in self._joints.values():
            self._physics.part(joint)
        self._joints = {}


def _read_pid(winch: PluginReader, tag: str) -> WinchPid:
    """Return a PID of the winch; a value that is missing is 0, as in Gazebo."""
    names = ("p", "i", "d", "i_max", "i_min", "cmd_max", "cmd_min")
    return WinchPid(**{name: winch.number(tag + "/" + name, 0.0) for name in names})


def _bound(spec: PluginReader, tag: str, default: float) -> float:
    """Return a limit of the axis; infinity stands for none."""
    try:
        value = float(spec.spec.find(_AXIS + "limit/" + tag) or default)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise PluginError("%s: <limit><%s> holds \"%s\"; expected a number" % (
            spec.spec.where, tag, spec.spec.find(_AXIS + "limit/" + tag)))
    return min(_NO_LIMIT, max(-_NO_LIMIT, value))


def _read_pose(spec: PluginReader) -> Pose:
    """Return the pose of the joint in the frame of its child."""
    text = spec.text("pose", "0 0 0 0 0 0")
    try:
        values: Tuple[float, ...] = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != 6 or not all(math.isfinite(value) for value in values):
        raise PluginError("%s: <pose> holds \"%s\"; expected six finite numbers" % (spec.spec.where, text))
    return (values[0], values[1], values[2]), quaternion_from_rpy(*values[3:])
