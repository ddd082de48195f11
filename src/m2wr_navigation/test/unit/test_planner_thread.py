# SPDX-License-Identifier: BSD-3-Clause
"""The planner's thread answers with the number of the goal, and only while a plan is wanted."""
import threading

import numpy as np
import pytest
import rospy

from m2wr_navigation.planners.planner import Plan
from m2wr_navigation.ros.planner_thread import PlannerThread


@pytest.fixture
def thread():
    rospy.rostime.set_rostime_initialized(True)
    planned = threading.Semaphore(0)
    may = threading.Semaphore(0)

    def plan():
        planned.release()
        assert may.acquire(timeout=20.0)
        return Plan(np.zeros((1, 3)))
    made = PlannerThread(plan)
    made.planned, made.may = planned, may
    yield made
    made.close()
    for _ in range(5):
        may.release()


def answers(thread):
    """Wait for answers."""
    for _ in range(2000):
        found = thread.answers()
        if found:
            return found
        threading.Event().wait(0.005)
    raise AssertionError("no answer")


def test_an_answer_has_the_number_of_its_goal(thread):
    thread.ask(7)
    assert thread.planned.acquire(timeout=20.0)
    thread.ask(8)               # while the first plan is made
    thread.may.release()
    assert [number for number, _ in answers(thread)] == [7]
    assert thread.planned.acquire(timeout=20.0)
    thread.may.release()
    assert [number for number, _ in answers(thread)] == [8]


def test_plans_are_asked_for_at_their_rate_or_when_needed(thread):
    thread.keep(1, False, 0.0, 1e9)
    assert not thread.planned.acquire(timeout=0.2)
    thread.keep(1, True, 0.0, 1e9)
    assert thread.planned.acquire(timeout=20.0)
    thread.keep(1, True, 0.0, 2e9)      # busy
    thread.may.release()
    assert len(answers(thread)) == 1
    assert not thread.planned.acquire(timeout=0.2)
    thread.keep(1, False, 2.0, 2e9)
    assert thread.planned.acquire(timeout=20.0)


def test_after_a_stop_nothing_is_planned(thread):
    thread.ask(3)
    assert thread.planned.acquire(timeout=20.0)
    thread.ask(3)
    thread.stop()
    thread.may.release()
    assert not thread.planned.acquire(timeout=0.2)


def test_a_planner_that_fails_gives_the_reason_and_plans_again():
    rospy.rostime.set_rostime_initialized(True)
    faults = [KeyError("cells")]

    def plan():
        if faults:
            raise faults.pop()
        return Plan(np.zeros((1, 3)))
    thread = PlannerThread(plan)
    thread.ask(1)
    (number, failed), = answers(thread)
    assert number == 1 and not len(failed.poses) and failed.reason == "the planner failed: KeyError: 'cells'"
    thread.ask(2)
    assert [len(found.poses) for _, found in answers(thread)] == [1]
    thread.close()
