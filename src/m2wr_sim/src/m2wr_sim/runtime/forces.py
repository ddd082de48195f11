# SPDX-License-Identifier: BSD-3-Clause
"""Forces that act for a while: wrenches on links and efforts on joints, as Gazebo's services order them."""
import logging
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any, Optional, Tuple

from m2wr_sim.errors import ModelError
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.runtime.limits import strongest, strongest_effort
from m2wr_sim.runtime.schedule import first_step

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Push:
    """One order: what acts on what, and from when to when [ns of simulated time]; no end means until cleared.

    ``part`` is the engine's number of a link or joint.  ``values`` is the force and torque (3 + 3 numbers, world axes)
    on a link, or the one effort along a joint's axis.
    """

    model: Any                      # LiveModel
    name: str                       # of the link or joint
    part: int
    values: Tuple[float, ...]
    start_ns: int
    end_ns: Optional[int]


class Forces(Plugin):
    """Applies the orders in every step in which they are in force; takes part in the steps as an observer.

    Of several wrenches on one link the newest counts alone, as in Gazebo, where each one *sets* the link's force and
    torque; efforts on one joint add up.  Orders survive resets and end with their model.

    No order may end the world: what would tear it apart within a few steps is refused, and an order ends when what it
    pushes has become too fast.
    """

    def __init__(self, simulator):
        self._simulator = simulator
        self._links, self._joints = [], []

    def configure(self, spec, ctx):
        """Nothing to configure: this plugin stands for no tag."""

    def push_link(self, model, name, force, torque, start_ns, duration_ns):
        """Order a wrench on a link [N, N m, world axes, at the centre of mass]; a negative duration never ends.

        Raises
        ------
        ModelError
            If it is more than the world survives.
        """
        values, limits = tuple(force) + tuple(torque), strongest(model.acting_inertial(name), self._step())
        if not all(abs(value) <= limit for vector, limit in zip((force, torque), limits) for value in vector):
            raise ModelError("force %s N and torque %s N m on %s::%s; expected at most %g N and %g N m"
                             % ((tuple(force), tuple(torque), model.name, name) + limits))
        self._links.append(self._push(model, name, model.handle.links[name], values, start_ns, duration_ns))

    def push_joint(self, model, name, effort, start_ns, duration_ns):
        """Order an effort [N m or N] on a joint; nothing acts on a joint of a static model.

        Raises
        ------
        ModelError
            If it is more than the world survives, within the joint's own limit.
        """
        if name in model.handle.joints:
            part, joint = model.handle.joints[name], model.joint_record(name)
            most = strongest_effort(model, joint, self._step())
            if not (abs(effort) <= most or 0.0 <= joint.axis.effort <= most):
                raise ModelError("effort %g on joint %s::%s; expected at most %g" % (effort, model.name, name, most))
            self._joints.append(self._push(model, name, part, (effort,), start_ns, duration_ns))

    def _step(self):
        return self._simulator.step_ns * 1e-9

    def _push(self, model, name, part, values, start_ns, duration_ns):
        start_ns = max(start_ns, self._simulator.now_ns)
        return Push(model, name, part, values, start_ns, None if duration_ns < 0 else start_ns + duration_ns)

    def clear_link(self, scoped_name):
        """Take back all wrenches on ``model::link``."""
        self._links = [push for push in self._links if "%s::%s" % (push.model.name, push.name) != scoped_name]

    def clear_joint(self, name):
        """Take back all efforts on joints of a name."""
        self._joints = [push for push in self._joints if push.name != name]

    def next_before(self, now_ns):
        if not (self._links or self._joints):
            return NEVER
        models = self._simulator.models
        self._links, self._joints = ([push for push in pushes if models.get(push.model.name) is push.model
                                      and (push.end_ns is None or push.end_ns > now_ns)]
                                     for pushes in (self._links, self._joints))
        step_ns = self._simulator.step_ns
        return min([max(now_ns + step_ns, first_step(push.start_ns, now_ns, step_ns))
                    for push in self._links + self._joints], default=NEVER)

    def before_step(self, now_ns):
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

    def _slow_enough(self, push, speeds):
        """Tell whether what an order pushes may go on being pushed; ends the order, with a line in the log, if not."""
        if all(abs(value) <= FASTEST for value in speeds):
            return True
        log.warning("the push %s on %s::%s ends: it moves at %s m/s or rad/s, more than %g", push.values,
                    push.model.name, push.name, tuple(speeds), FASTEST)
        self._links, self._joints = ([other for other in pushes if other is not push]
                                     for pushes in (self._links, self._joints))
        return False

    @staticmethod
    def _acts(push, now_ns):
        return push.start_ns <= now_ns and (push.end_ns is None or now_ns <= push.end_ns)


def _within_limits(effort, axis, rate):
    """Return an effort cut to the joint's limit; one that pushes further past the velocity limit is none."""
    if axis.effort >= 0.0:
        effort = min(axis.effort, max(-axis.effort, effort))
    if axis.velocity >= 0.0 and (rate > axis.velocity and effort > 0.0 or rate < -axis.velocity and effort < 0.0):
        return 0.0
    return effort
