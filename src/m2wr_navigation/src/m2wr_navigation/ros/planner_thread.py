# SPDX-License-Identifier: BSD-3-Clause
"""The thread that plans: once when asked, or at a rate while a goal is active."""
from __future__ import annotations

import threading
from collections import deque
from typing import Any, Callable, Deque, List, Tuple

import rospy

from m2wr_navigation.planners.planner import Plan

LEAST_PAUSE = 0.1           # s between two plans that are asked for one after the other, in ROS time


class PlannerThread:
    """Plans without keeping the control loop waiting. Goals have numbers: a late plan is not taken for another one.

    Parameters
    ----------
    plan : callable
        Returns a Plan to the present goal.
    """

    def __init__(self, plan: Callable[[], Any]) -> None:
        self._plan = plan
        self._changed = threading.Condition()
        self._wanted = 0                # number of the goal for which a plan is wanted; 0: none
        self._busy = self._ended = False
        self._begun = -1e9
        self._answers: Deque[Tuple[int, Plan]] = deque(maxlen=10)
        self._thread = threading.Thread(target=self._run, name="planner", daemon=True)
        self._thread.start()

    def ask(self, number: int) -> None:
        """Ask for a plan to the goal with this number."""
        with self._changed:
            self._wanted = number
            self._changed.notify()

    def keep(self, number: int, needed: bool, rate: float, now: float) -> None:
        """Ask for a plan if one is due.

        Parameters
        ----------
        number : int
            Of the goal.
        needed : bool
            Whether the robot waits for it.
        rate : float
            Plans per second while it drives; 0: none [Hz].
        now : float
            [s]
        """
        period = 1.0 / rate if rate > 0.0 else (LEAST_PAUSE if needed else 0.0)
        with self._changed:
            if self._busy or self._wanted or period <= 0.0:
                return
            if not 0.0 <= now - self._begun < period:
                self._wanted = number
                self._changed.notify()

    def stop(self) -> None:
        """Want no plan any more, and forget those that were made."""
        with self._changed:
            self._wanted = 0
            self._answers.clear()

    def answers(self) -> List[Tuple[int, Plan]]:
        """Return the plans made since the last call, with the numbers of their goals."""
        with self._changed:
            found = list(self._answers)
            self._answers.clear()
            return found

    def close(self) -> None:
        """End the thread after the plan in progress."""
        with self._changed:
            self._ended = True
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._wanted and not self._ended:
                    self._changed.wait()
                if self._ended:
                    return
                number, self._wanted, self._busy = self._wanted, 0, True
                self._begun = rospy.get_time()
            try:
                plan = self._plan()
            except rospy.ROSException:
                if rospy.core.is_shutdown_requested():      # topics close before is_shutdown() is true
                    return
                raise
            except Exception as error:      # of one plan; the thread continues, and the goal hears of it
                rospy.logerr("the planner failed: %s: %s", type(error).__name__, error)
                plan = Plan.none("the planner failed: %s: %s" % (type(error).__name__, error))
            with self._changed:
                self._busy = False
                self._answers.append((number, plan))
