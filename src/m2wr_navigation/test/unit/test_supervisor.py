# SPDX-License-Identifier: BSD-3-Clause
"""The state machine of move_base: plans, commands, recovery behaviours, results, with a clock in hand."""
import numpy as np
import pytest

from m2wr_navigation.controllers.controller import Command, Controller, Situation
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read
from m2wr_navigation.planners.planner import Plan
from m2wr_navigation.recoveries.recovery import Recovery, SpeedLimit, Step
from m2wr_navigation.supervisor import (
    ABORTED,
    CLEARING,
    CONTROLLING,
    NO_CONTROL,
    NO_PLAN,
    OSCILLATION,
    PARAMETERS,
    PLANNING,
    REACHED,
    SUCCEEDED,
    Supervisor,
)

PLAN = Plan(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
GRID = Costmap.filled((10, 10), 0.1, (0.0, 0.0), 0, "odom")


class Puppet(Controller):
    """Answers what the test wants."""

    def __init__(self):
        super().__init__({})
        self.plans, self.reached, self.velocity = [], False, np.array([0.3, 0.0, 0.1])

    def set_plan(self, plan, new_goal):
        self.plans.append(new_goal)

    def compute(self, situation):
        return Command(self.velocity, "" if self.velocity is not None else "a wall", np.zeros((0, 3)), np.zeros((0, 3)))

    def is_goal_reached(self, situation):
        return self.reached


class Behaviour(Recovery):
    """Takes three cycles."""

    def begin(self, situation):
        self.left, self.begun = 3, getattr(self, "begun", 0) + 1

    def step(self, situation):
        self.left -= 1
        return Step(np.array([0.0, 0.0, 0.5]), self.left == 0, "")


class Drive:
    """A supervisor and its clock."""

    def __init__(self, recoveries=2, **values):
        self.controller = Puppet()
        self.behaviours = [Behaviour("behaviour_%d" % k, {}, None) for k in range(recoveries)]
        self.supervisor = Supervisor(read(PARAMETERS, values, "~")[0], self.controller, self.behaviours)
        self.now, self.pose = 100.0, np.zeros(3)
        self.number = self.supervisor.begin(self.now)

    def plan(self, plan=PLAN, number=None):
        return self.supervisor.take_plan(self.number if number is None else number, plan, self.now)

    def cycle(self, late=(), blind=""):
        self.now += 0.1
        seen = Situation(self.now, 0.1, self.pose, np.zeros(3), PLAN.poses, GRID, np.zeros((0, 2)))
        situation = None if blind else seen
        return self.supervisor.cycle(self.now, situation, late, blind)

    def until(self, done, most=1000):
        for _ in range(most):
            outcome = self.cycle()
            if done(outcome):
                return outcome
        raise AssertionError("it did not happen")


def test_a_plan_leads_to_commands_and_the_goal():
    drive = Drive()
    assert drive.supervisor.wants_plan and drive.cycle().velocity is None
    drive.plan()
    outcome = drive.cycle()
    assert outcome.velocity.tolist() == [0.3, 0.0, 0.1] and drive.supervisor.state == CONTROLLING
    drive.controller.reached = True
    outcome = drive.cycle()
    assert (outcome.result, outcome.text) == (SUCCEEDED, REACHED) and not outcome.velocity.any()


def test_a_plan_of_another_goal_is_ignored():
    drive = Drive()
    old = drive.number
    drive.number = drive.supervisor.begin(drive.now)
    drive.plan(number=old)
    drive.cycle()
    assert drive.supervisor.state == PLANNING and drive.controller.plans == []


def test_only_the_first_plan_of_a_goal_is_a_new_goal():
    drive = Drive()
    for _ in range(3):
        drive.plan()
        drive.cycle()
    drive.number = drive.supervisor.begin(drive.now)
    drive.plan()
    drive.cycle()
    assert drive.controller.plans == [True, False, False, True]


def test_without_a_plan_behaviours_run_then_the_goal_is_aborted():
    drive, reasons = Drive(planner_patience=1.0), []

    def no_plan(outcome):
        if drive.supervisor.wants_plan:
            reasons.extend(drive.plan(Plan.none("a wall in between")))
        return outcome.result
    outcome = drive.until(no_plan)
    assert (outcome.result, outcome.text) == (ABORTED, NO_PLAN) and outcome.messages == ("a wall in between",)
    assert [behaviour.begun for behaviour in drive.behaviours] == [1, 1]
    assert "no plan: a wall in between" in reasons and len(reasons) < 5, "the same reason again and again"
    assert drive.now - 100.0 == pytest.approx(3 * 1.0 + 2 * 0.3, abs=1.0)


def test_failed_plans_are_counted_if_asked():
    drive = Drive(max_planning_retries=2, planner_patience=100.0)
    for _ in range(3):
        assert drive.supervisor.state == PLANNING
        drive.plan(Plan.none("no"))
    assert drive.supervisor.state == CLEARING


def test_without_a_command_the_robot_stops_and_replans():
    drive = Drive()
    drive.plan()
    drive.cycle()
    drive.controller.velocity = None
    outcome = drive.cycle()
    assert not outcome.velocity.any() and outcome.messages == ("no valid command: a wall",)
    assert drive.supervisor.wants_plan
    drive.plan()
    drive.controller.velocity = np.array([0.1, 0.0, 0.0])
    assert drive.cycle().velocity[0] == 0.1


def test_without_a_command_for_long_the_goal_is_aborted():
    drive = Drive(controller_patience=2.0)
    drive.controller.velocity = None

    def planned(outcome):
        if drive.supervisor.wants_plan:
            drive.plan()
        return outcome.result
    drive.plan()
    outcome = drive.until(planned)
    assert (outcome.result, outcome.text) == (ABORTED, NO_CONTROL)
    assert [behaviour.begun for behaviour in drive.behaviours] == [1, 1]
    assert drive.now - 100.0 == pytest.approx(3 * 2.0, abs=1.5)


@pytest.mark.parametrize("moved, begun", [(0.1, [1, 1]), (0.6, [2, 0])])
def test_behaviours_begin_again_once_the_robot_has_left(moved, begun):
    """A single valid command is no way out of a narrow place."""
    drive = Drive(controller_patience=1.0, oscillation_distance=0.5)
    drive.plan()
    drive.cycle()

    def recovers(outcome):
        if drive.supervisor.wants_plan:
            drive.plan()
        return drive.supervisor.state == CLEARING
    for _ in range(2):
        drive.controller.velocity = None
        drive.until(recovers)
        drive.until(lambda outcome: drive.supervisor.state != CLEARING)
        drive.pose = drive.pose + (moved, 0.0, 0.0)
        drive.controller.velocity = np.array([0.3, 0.0, 0.0])
        drive.plan()
        drive.cycle()
    assert [getattr(behaviour, "begun", 0) for behaviour in drive.behaviours] == begun


def test_a_robot_that_does_not_move_is_oscillating():
    drive = Drive(oscillation_timeout=3.0, recoveries=0)
    drive.plan()
    outcome = drive.until(lambda outcome: outcome.result)
    assert (outcome.result, outcome.text) == (ABORTED, OSCILLATION) and drive.now == pytest.approx(103.0, abs=0.5)


@pytest.mark.parametrize("replaces, moved, stuck", [(True, 0.0, True), (True, 0.3, False), (False, 0.0, False)])
def test_a_stuck_robot_is_noticed_although_its_goal_changes(replaces, moved, stuck):
    drive, began = Drive(oscillation_timeout=3.0), []
    drive.plan()
    for _ in range(10):                             # a new goal each second, as from an explorer
        began += [outcome.began for outcome in (drive.cycle() for _ in range(10)) if outcome.began]
        drive.pose = drive.pose + [moved, 0.0, 0.0]
        drive.number = drive.supervisor.begin(drive.now, replaces)
        drive.plan()
    assert bool(began) == stuck


@pytest.mark.parametrize("step", [[0.02, 0.0, 0.0], [0.0, 0.0, 0.06]])
def test_driving_and_turning_are_progress(step):
    drive = Drive(oscillation_timeout=3.0, recoveries=0)
    drive.plan()
    for _ in range(200):
        drive.pose = drive.pose + step
        assert not drive.cycle().result


def test_recovery_behaviours_are_announced_with_their_numbers():
    drive, began = Drive(oscillation_timeout=1.0), []

    def note(outcome):
        if outcome.began:
            began.append((outcome.began[0].name, outcome.began[1]))
        if drive.supervisor.wants_plan:
            drive.plan()
        return outcome.result
    drive.plan()
    drive.until(note)
    assert began == [("behaviour_0", 0), ("behaviour_1", 1)]


def test_disabled_recovery_aborts_at_once():
    drive = Drive(recovery_behavior_enabled=False, oscillation_timeout=1.0)
    drive.plan()
    assert drive.until(lambda outcome: outcome.result).result == ABORTED
    assert not hasattr(drive.behaviours[0], "begun")


@pytest.mark.parametrize("how", [dict(late=["topic scan has been silent"]), dict(blind="no pose")])
def test_a_robot_that_cannot_see_stops_says_so_once_and_gives_up(how):
    drive = Drive(sensor_patience=5.0)
    drive.plan()
    drive.cycle()
    first, second = drive.cycle(**how), drive.cycle(**how)
    sentence = how.get("late", [how.get("blind")])[0]
    assert not first.velocity.any() and first.messages == ("stopped: " + sentence,) and second.messages == ()
    for _ in range(60):
        outcome = drive.cycle(**how)
        if outcome.result:
            break
    assert outcome.result == ABORTED and sentence in outcome.text
    assert drive.now - 100.0 == pytest.approx(5.3, abs=0.3)


def test_a_sentence_whose_numbers_change_is_told_once():
    drive = Drive()
    drive.plan()
    drive.cycle()
    assert drive.cycle(late=["topic scan has been silent for 0.61 s"]).messages
    assert not drive.cycle(late=["topic scan has been silent for 0.66 s"]).messages
    assert drive.cycle(late=["topic odom has been silent for 0.7 s"]).messages


def test_a_robot_that_sees_again_continues():
    drive = Drive()
    drive.plan()
    drive.cycle()
    drive.cycle(late=["silent"])
    assert drive.cycle().velocity.any()


def test_a_new_goal_ends_a_recovery_behaviour():
    drive = Drive(oscillation_timeout=1.0)
    drive.plan()
    drive.until(lambda outcome: outcome.began)
    drive.number = drive.supervisor.begin(drive.now)
    drive.plan()
    assert drive.cycle().velocity.tolist() == [0.3, 0.0, 0.1] and drive.supervisor.state == CONTROLLING


def test_a_limit_of_speed_holds_until_the_robot_has_moved():
    drive = Drive(recoveries=1, controller_patience=0.5)
    limit = SpeedLimit(0.15, 0.45, 0.3)
    drive.behaviours[0].step = lambda situation: Step(None, True, "", limit)
    drive.plan()
    assert drive.cycle().velocity == pytest.approx([0.3, 0.0, 0.1])
    drive.controller.velocity = None
    while drive.supervisor.state != CLEARING:
        drive.plan()
        drive.cycle()
    drive.controller.velocity = np.array([0.3, 0.0, 0.1])
    assert drive.cycle().began
    drive.plan()
    assert drive.cycle().velocity == pytest.approx([0.15, 0.0, 0.05])           # the same arc
    drive.controller.velocity = np.array([0.1, 0.0, -0.9])
    assert drive.cycle().velocity == pytest.approx([0.05, 0.0, -0.45])
    drive.number = drive.supervisor.begin(drive.now)                            # also to another goal
    drive.plan()
    drive.pose = np.array([0.2, 0.2, 0.0])
    assert drive.cycle().velocity == pytest.approx([0.05, 0.0, -0.45])
    drive.pose = np.array([0.2, 0.3, 0.0])
    assert drive.cycle().velocity == pytest.approx([0.1, 0.0, -0.9])
    drive.pose = np.zeros(3)
    assert drive.cycle().velocity == pytest.approx([0.1, 0.0, -0.9])


@pytest.mark.parametrize("sides", [(1.0,), (1.0, -1.0)])
def test_a_robot_that_only_turns_says_so_and_gives_up(sides):
    drive = Drive()
    texts = []
    for cycle in range(2000):
        drive.plan()
        # turns round and round, or to and fro by 60 degrees
        drive.pose = drive.pose + [0.0, 0.0, 0.1 * sides[cycle // 10 % len(sides)]]
        outcome = drive.cycle()
        texts += outcome.messages
        if outcome.result:
            break
    spins = [text for text in texts if "does not get on" in text]
    assert (outcome.result, outcome.text) == (ABORTED, OSCILLATION) and len(spins) == 3
    assert "turned by 72" in spins[0] and "within 0.5 m of (0.00, 0.00); the goal is 1.00 m away" in spins[0]


def test_a_robot_that_turns_on_its_way_is_not_stopped():
    drive = Drive()
    drive.plan()
    for _ in range(1000):
        drive.pose = drive.pose + [0.02, 0.0, 0.1]
        assert drive.cycle().velocity == pytest.approx([0.3, 0.0, 0.1])
