# SPDX-License-Identifier: BSD-3-Clause
"""The state machine of move_base: when to plan, to control, to recover, and when to give up; without ROS."""
from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation.parameters import Parameter, flag, text

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Command, Controller, Situation
    from m2wr_navigation.planners.planner import Plan
    from m2wr_navigation.recoveries.recovery import Recovery, SpeedLimit
    from m2wr_node.array_types import FloatArray

PARAMETERS: Dict[str, Parameter] = {
    "base_global_planner": text("navfn/NavfnROS", "planner of paths over the whole map", True),
    "base_local_planner": text("base_local_planner/TrajectoryPlannerROS", "controller along the path", True),
    "planner_frequency": Parameter(0.0, "Hz", 0.0, 100.0, "rate of plans; 0: only for a new goal or after a failure"),
    "controller_frequency": Parameter(20.0, "Hz", 0.1, 100.0, "rate of commands"),
    "planner_patience": Parameter(5.0, "s", 0.0, 100.0, "time without a plan before a recovery behaviour"),
    "controller_patience": Parameter(15.0, "s", 0.0, 100.0, "time without a command before a recovery behaviour"),
    "max_planning_retries": Parameter(-1, "", -1, 1000, "failed plans before a recovery behaviour; -1: only patience"),
    "oscillation_timeout": Parameter(0.0, "s", 0.0, 60.0, "time without progress before a recovery behaviour; 0: off"),
    "oscillation_distance": Parameter(0.5, "m", 0.0, 10.0, "distance that counts as progress"),
    "sensor_patience": Parameter(30.0, "s", 0.0, 1e6, "time without a sensor before the goal is aborted; 0: for ever"),
    "conservative_reset_dist": Parameter(3.0, "m", 0.0, 50.0, "side of the square that the first recovery keeps"),
    "recovery_behavior_enabled": flag(True, "whether there are recovery behaviours"),
    "clearing_rotation_allowed": flag(True, "whether the robot may turn on the spot to see obstacles again"),
    "shutdown_costmaps": flag(False, "accepted, without effect: the costmaps are always updated"),
    "make_plan_clear_costmap": flag(True, "accepted, without effect: make_plan works on a copy"),
    "make_plan_add_unreachable_goal": flag(True, "whether a plan to a place near the goal ends with the goal"),
}

PLANNING, CONTROLLING, CLEARING = "planning", "controlling", "clearing"
NO_PLAN = "Failed to find a valid plan. Even after executing recovery behaviors."
NO_CONTROL = "Failed to find a valid control. Even after executing recovery behaviors."
OSCILLATION = "Robot is oscillating. Even after executing recovery behaviors."
REACHED = "Goal reached."
PROGRESS_TURN = math.pi / 2     # rad: turning this far counts as progress, too
#: rad, in one place: half a turn to the path and half a turn to the goal's heading are useful, each twice after a slip
MOST_TURNED = 4.0 * math.pi
_NUMBER = re.compile(r"-?\d+(\.\d+)?")
SUCCEEDED, ABORTED = "succeeded", "aborted"


@dataclass(frozen=True)
class Outcome:
    """What one cycle decided.

    Attributes
    ----------
    velocity : (3,) float64 or None
        To publish [m/s, m/s, rad/s]; None: nothing, the last command stands.
    result : str
        ``succeeded`` or ``aborted``; empty: the goal is still active.
    text : str
        Of the result, as in move_base; the reason is among the messages.
    messages : list of str
        What a user should be told now.
    began : (Recovery, int) or None
        A recovery behaviour that begins now, and its number.
    command : Command or None
        Of the controller, for display.
    """

    velocity: Optional[FloatArray]
    result: str = ""
    text: str = ""
    messages: Tuple[str, ...] = ()
    began: Optional[Tuple[Recovery, int]] = None
    command: Optional[Command] = None


def _stop() -> FloatArray:
    return np.zeros(3)


class Supervisor:
    """Follows one goal at a time.

    Parameters
    ----------
    values : mapping of str to object
        Value of every one of :data:`PARAMETERS`; may be replaced between two cycles.
    controller : Controller
        May be replaced between two cycles.
    recoveries : sequence of Recovery
        In the order in which they are tried.
    """

    def __init__(self, values: Mapping[str, Any], controller: Controller, recoveries: Sequence[Recovery]) -> None:
        self.values, self.controller, self.recoveries = values, controller, list(recoveries)
        self.state = PLANNING
        self.number = 0                 # of the goal; plans of other goals are ignored
        self._limit: Optional[Tuple[SpeedLimit, FloatArray]] = None     # and where it was set; other goals keep it
        self._begin_counts(0.0)

    def _begin_counts(self, now: float) -> None:
        self._index, self._trigger = 0, NO_PLAN
        self._running: Optional[Recovery] = None
        self._cleared_at: Optional[FloatArray] = None           # where the first of the behaviours in use has begun
        self._new_plan: Optional[FloatArray] = None
        self._has_plan, self._new_goal = False, True
        self._retries, self._reason = 0, ""
        self._last_plan = self._last_command = self._last_progress = now
        self._late_since: Optional[float] = None
        self._mark: Optional[FloatArray] = None
        self._replaces = False                                  # whether progress is counted since an earlier goal
        self._place: FloatArray = np.full(3, math.inf)          # where the robot has begun to turn
        self._heading, self._turned = 0.0, 0.0
        self._told = ""

    def begin(self, now: float, replaces: bool = False) -> int:
        """Start a goal; return its number.

        Parameters
        ----------
        now : float
            [s]
        replaces : bool
            Whether the robot was still on its way to another goal. Then it has made no progress since it last moved: a
            robot that is stuck gets no further with a new goal each second.

        Returns
        -------
        int
        """
        mark, progress = self._mark, self._last_progress
        self.number += 1
        self.state = PLANNING
        self._begin_counts(now)
        if replaces:
            self._mark, self._last_progress, self._replaces = mark, progress, True
        return self.number

    @property
    def wants_plan(self) -> bool:
        """Whether a plan is needed before the robot can continue."""
        return self.state == PLANNING and self._new_plan is None

    def take_plan(self, number: int, plan: Plan, now: float) -> List[str]:
        """Take the answer of the planner.

        Parameters
        ----------
        number : int
            Of the goal for which it was made.
        plan : Plan
        now : float
            [s]

        Returns
        -------
        list of str
            What a user should be told.
        """
        if number != self.number:
            return []
        if len(plan.poses):
            self._new_plan, self._last_plan, self._retries = plan.poses, now, 0
            return []
        self._reason = plan.reason
        if self.state != PLANNING:
            return self._once("no new plan, the old one stays: " + plan.reason)
        self._retries += 1
        limit = self.values["max_planning_retries"]
        if now > self._last_plan + self.values["planner_patience"] or 0 <= limit < self._retries:
            self._recover(NO_PLAN)
        return self._once("no plan: " + plan.reason)

    def _once(self, message: str) -> List[str]:
        """Return a message unless it was the last one, whatever its numbers."""
        key = _NUMBER.sub("#", message)
        if key == self._told:
            return []
        self._told = key
        return [message]

    def _recover(self, trigger: str) -> None:
        self.state, self._trigger, self._running = CLEARING, trigger, None

    def cycle(self, now: float, situation: Optional[Situation], late: Sequence[str], missing: str = "") -> Outcome:
        """Decide what to do in this control cycle.

        Parameters
        ----------
        now : float
            [s]
        situation : Situation or None
            None: the pose of the robot is not known.
        late : sequence of str
            Sentences about sensors of the local costmap that are silent.
        missing : str
            Why there is no situation.

        Returns
        -------
        Outcome
        """
        if late or situation is None:
            return self._blind(now, list(late) or [missing])
        self._late_since = None
        self._note_progress(now, situation)
        self._note_turning(situation.pose)
        if self._new_plan is not None:
            self.controller.set_plan(self._new_plan, self._new_goal)
            if not self._has_plan:
                self._last_command, self._last_progress = now, self._last_progress if self._replaces else now
            self._new_goal, self._has_plan, self._new_plan = False, True, None
            if self.state != CLEARING or self._trigger == NO_PLAN:
                self.state, self._running = CONTROLLING, None
                if self._trigger == NO_PLAN:
                    self._index = 0
        if self.state == PLANNING:
            return Outcome(_stop() if self._retries else None)
        if self.state == CLEARING:
            return self._clear(situation)
        return self._control(now, situation)

    def _blind(self, now: float, reasons: List[str]) -> Outcome:
        """Stop while a sensor or the pose is missing; give up after a while."""
        if self._late_since is None:
            self._late_since = now
        patience = self.values["sensor_patience"]
        if patience > 0.0 and now - self._late_since > patience:
            return Outcome(_stop(), ABORTED, "The robot cannot see: {}".format("; ".join(reasons)))
        return Outcome(_stop(), messages=tuple(self._once("stopped: " + "; ".join(reasons))))

    def _note_progress(self, now: float, situation: Situation) -> None:
        pose = situation.pose
        if self._mark is not None:
            turned = abs((pose[2] - self._mark[2] + math.pi) % (2.0 * math.pi) - math.pi)
            moved = float(np.hypot(*(pose[:2] - self._mark[:2])))
            if moved < self.values["oscillation_distance"] and turned < PROGRESS_TURN:
                return
            if moved >= self.values["oscillation_distance"] and self._trigger == OSCILLATION:
                self._index = 0
        self._mark, self._last_progress = np.array(pose, float), now

    def _note_turning(self, pose: FloatArray) -> None:
        """Sum up how far the robot has turned, to either side, since it was somewhere else."""
        away = float(np.hypot(*(pose[:2] - self._place[:2])))
        if away >= self.values["oscillation_distance"]:
            self._place, self._turned = np.array(pose, float), 0.0
        elif self.state == CONTROLLING:
            self._turned += abs(math.remainder(pose[2] - self._heading, 2.0 * math.pi))
        self._heading = float(pose[2])

    def _spinning(self, situation: Situation) -> Outcome:
        """Tell that the robot turns and does not get on, and recover."""
        goal = float(np.hypot(*(situation.plan[-1, :2] - situation.pose[:2])))
        told = "it has turned by {:.0f} degrees within {:g} m of ({:.2f}, {:.2f}); the goal is {:.2f} m away"
        self._reason = told.format(math.degrees(self._turned), self.values["oscillation_distance"], self._place[0],
                                   self._place[1], goal)
        self._turned = 0.0
        self._recover(OSCILLATION)
        return Outcome(_stop(), messages=("the robot turns and does not get on: " + self._reason,))

    def _control(self, now: float, situation: Situation) -> Outcome:
        if self.controller.is_goal_reached(situation):
            return Outcome(_stop(), SUCCEEDED, REACHED)
        if self._turned > MOST_TURNED:
            return self._spinning(situation)
        timeout = self.values["oscillation_timeout"]
        if timeout > 0.0 and now > self._last_progress + timeout:
            self._reason = "moved less than {:g} m in {:g} s".format(self.values["oscillation_distance"], timeout)
            self._recover(OSCILLATION)
            return Outcome(_stop(), messages=("the robot makes no progress: " + self._reason,))
        command = self.controller.compute(situation)
        if command.velocity is not None:
            self._last_command = now
            self._forget_recoveries(situation.pose)
            return Outcome(self._limited(command.velocity, situation.pose), messages=tuple(
                self._once(command.reason) if command.reason else ()), command=command)
        self._reason = command.reason
        messages = tuple(self._once("no valid command: " + command.reason))
        if now > self._last_command + self.values["controller_patience"]:
            self._recover(NO_CONTROL)
        else:                   # a new plan may help
            self.state, self._last_plan, self._retries = PLANNING, now, 0
            self._trigger = NO_CONTROL
        return Outcome(_stop(), messages=messages, command=command)

    def _forget_recoveries(self, pose: FloatArray) -> None:
        """Begin with the first behaviour again next time, once the robot has left the place where it needed one.

        A valid command alone is no way out: in a narrow place every turn makes one possible, and the next one not.
        """
        if self._trigger == NO_CONTROL and self._cleared_at is not None and float(
                np.hypot(*(pose[:2] - self._cleared_at[:2]))) >= self.values["oscillation_distance"]:
            self._index, self._cleared_at = 0, None

    def _limited(self, velocity: FloatArray, pose: FloatArray) -> FloatArray:
        """Return a command on the same arc within the limit of a recovery behaviour, while there is one."""
        if self._limit is not None and float(np.hypot(*(pose[:2] - self._limit[1][:2]))) >= self._limit[0].distance:
            self._limit = None
        if self._limit is None:
            return velocity
        limit, speed, rate = self._limit[0], math.hypot(velocity[0], velocity[1]), abs(velocity[2])
        return velocity * min(1.0, limit.speed / max(speed, limit.speed), limit.rate / max(rate, limit.rate))

    def _clear(self, situation: Situation) -> Outcome:
        """Run the present recovery behaviour, or begin the next one."""
        began: Optional[Tuple[Recovery, int]] = None
        if self._running is None:
            if not self.values["recovery_behavior_enabled"] or self._index >= len(self.recoveries):
                return Outcome(_stop(), ABORTED, self._trigger, (self._reason,) if self._reason else ())
            if self._index == 0:
                self._cleared_at = np.array(situation.pose, float)
            self._running = self.recoveries[self._index]
            began = self._running, self._index
            self._index += 1
            self._running.begin(situation)
        step = self._running.step(situation)
        messages = (step.reason,) if step.reason else ()
        if step.limit is not None:
            self._limit = step.limit, np.array(situation.pose, float)
        if step.done:
            self._running, self._retries = None, 0
            self.state = PLANNING
            self._last_plan = self._last_command = self._last_progress = situation.stamp
        return Outcome(_stop() if step.velocity is None else step.velocity, messages=messages, began=began)
