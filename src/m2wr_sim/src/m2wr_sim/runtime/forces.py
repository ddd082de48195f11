# SPDX-License-Identifier: BSD-3-Clause
"""Wrenches on links and efforts on joints for a time, as requested by Gazebo's services."""
from __future__ import annotations

import logging
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

from m2wr_sim.errors import ModelError
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.runtime.limits import strongest, strongest_effort
from m2wr_sim.runtime.schedule import first_step

if TYPE_CHECKING:
    from m2wr_sim.model.types import Axis
    from m2wr_sim.plugins.base import PluginContext, PluginReader
    from m2wr_sim.runtime.entities import LiveModel
    from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Push:
    """A wrench or effort, with its start and end [ns of simulated time]; without an end it acts until cleared.

    ``part`` is the engine's number of a link or joint.  ``values`` is force and torque on a link (3 + 3 numbers, in the
    world frame), or the effort along the axis of a joint.
    """

    model: LiveModel
    name: str                       # of the link or joint
    part: int
    values: Tuple[float, ...]
    start_ns: int
    end_ns: Optional[int]


class Forces(Plugin):
    """Applies wrenches and efforts in each step; an observer of the simulator.

    Of several wrenches on one link only the newest acts, as in Gazebo, where each one *sets* the force and torque of
    the link.  Efforts on one joint are added.  They continue after a reset, and end when their model is deleted.

    Values that would make the simulation diverge within a few steps are refused.  A wrench or effort also ends when its
    link or joint becomes too fast.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._links: List[Push] = []
        self._joints: List[Push] = []

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        """Do nothing, because this plugin has no element in a description.

        Parameters
        ----------
        spec : PluginReader
        ctx : PluginContext
        """

    def push_link(self, model: LiveModel, name: str, force: Sequence[float], torque: Sequence[float], start_ns: int,
                  duration_ns: int) -> None:
        """Add a wrench on a link.

        Parameters
        ----------
        model : LiveModel
        name : str
            Name of the link.
        force, torque : (3,) sequences of float
            At the centre of mass, in the world frame [N, N m].
        start_ns : int
            Simulated time [ns].
        duration_ns : int
            [ns]; a negative duration never ends.

        Raises
        ------
        ModelError
            If a value exceeds its limit.
        """
        values, limits = tuple(force) + tuple(torque), strongest(model.acting_inertial(name), self._step())
        if not all(abs(value) <= limit for vector, limit in zip((force, torque), limits) for value in vector):
            raise ModelError("force %s N and torque %s N m on %s::%s; expected at most %g N and %g N m"
                             % ((tuple(force), tuple(torque), model.name, name) + limits))
        self._links.append(self._push(model, name, model.handle.links[name], values, start_ns, duration_ns))

    def push_joint(self, model: LiveModel, name: str, effort: float, start_ns: int, duration_ns: int) -> None:
        """Add an effort on a joint; no effect on a joint of a static model.

        Parameters
        ----------
        model : LiveModel
        name : str
            Name of the joint.
        effort : float
            [N m or N].
        start_ns : int
            Simulated time [ns].
        duration_ns : int
            [ns]; a negative duration never ends.

        Raises
        ------
        ModelError
            If the value exceeds its limit.
        """
        if name in model.handle.joints:
            part, joint = model.handle.joints[name], model.joint_record(name)
            most = strongest_effort(model, joint, self._step())
            if not (abs(effort) <= most or 0.0 <= joint.axis.effort <= most):
                raise ModelError("effort %g on joint %s::%s; expected at most %g" % (effort, model.name, name, most))
            self._joints.append(self._push(model, name, part, (effort,), start_ns, duration_ns))

    def _step(self) -> float:
        return self._simulator.step_ns * 1e-9

    def _push(self, model: LiveModel, name: str, part: int, values: Tuple[float, ...], start_ns: int,
              duration_ns: int) -> Push:
        start_ns = max(start_ns, self._simulator.now_ns)
        return Push(model, name, part, values, start_ns, None if duration_ns < 0 else start_ns + duration_ns)

    def clear_link(self, scoped_name: str) -> None:
        """Remove all wrenches on ``model::link``."""
        self._links = [push for push in self._links if "%s::%s" % (push.model.name, push.name) != scoped_name]

    def clear_joint(self, name: str) -> None:
        """Remove all efforts on joints of a name."""
        self._joints = [push for push in self._joints if push.name != name]

    def next_before(self, now_ns: int) -> Optional[int]:
        if not (self._links or self._joints):
            return NEVER
        models = self._simulator.models
        self._links, self._joints = ([push for push in pushes if models.get(push.model.name) is push.model
                                      and (push.end_ns is None or push.end_ns > now_ns)]
                                     for pushes in (self._links, self._joints))
        step_ns = self._simulator.step_ns
        return min([max(now_ns + step_ns, first_step(push.start_ns, now_ns, step_ns))
                    for push in self._links + self._joints], default=NEVER)

    def before_step(self, now_ns: int) -> None:
        engine, newest = self._simulator.engine, OrderedDict()
        for push in self._links:
            if self._acts(push, now_ns):
                newest[push.part] = push
        for push in newest.values():
            state = engine.link_state(push.part)
            if self._slow_enough(push, state.linear_velocity + state.angular_velocity):
                engine.add_link_force(push.part, push.values[:3], push.values[3:])
        for push in self._joints:
            if self._acts(push, now_ns):
                axis, rate = push.model.joint_record(push.name).axis, engine.joint_rate(push.part)
                if self._slow_enough(push, (rate,)):
                    engine.add_joint_force(push.part, _within_limits(push.values[0], axis, rate))

    def _slow_enough(self, push: Push, speeds: Sequence[float]) -> bool:
        """Return whether a link or joint is slow enough; if not, end its wrench or effort with a warning."""
        if all(abs(value) <= FASTEST for value in speeds):
            return True
        log.warning("the push %s on %s::%s ends: it moves at %s m/s or rad/s, more than %g", push.values,
                    push.model.name, push.name, tuple(speeds), FASTEST)
        self._links, self._joints = ([other for other in pushes if other is not push]
                                     for pushes in (self._links, self._joints))
        return False

    @staticmethod
    def _acts(push: Push, now_ns: int) -> bool:
        return push.start_ns <= now_ns and (push.end_ns is None or now_ns <= push.end_ns)


def _within_limits(effort: float, axis: Axis, rate: float) -> float:
    """Return an effort clipped to the limit of the joint; 0 if it would increase a velocity beyond the limit."""
    if axis.effort >= 0.0:
        effort = min(axis.effort, max(-axis.effort, effort))
    if axis.velocity >= 0.0 and (rate > axis.velocity and effort > 0.0 or rate < -axis.velocity and effort < 0.0):
        return 0.0
    return effort
