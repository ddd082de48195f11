# SPDX-License-Identifier: BSD-3-Clause
"""Go to point: turn towards the goal, drive straight, stop. Uses only the pose; it does not see obstacles."""
from __future__ import annotations

import logging
import math
from enum import IntEnum
from typing import Optional

from motion_plan.angles import wrap_angle
from motion_plan.planar_types import Command, Point, Pose, Regions

LOG = logging.getLogger(__name__)

YAW_PRECISION = math.pi / 90
DISTANCE_PRECISION = 0.3
TURN_SPEED = 0.7
FORWARD_SPEED = 0.6
CORRECTION_SPEED = 0.2


class State(IntEnum):
    """States of the behaviour, numbered as in the report's log lines."""

    FIX_YAW = 0
    GO_STRAIGHT_AHEAD = 1
    DONE = 2


class GoToPoint:
    """Drives to a goal in the odometry frame.

    Parameters
    ----------
    goal : (float, float)
        x, y [m].
    """

    def __init__(self, goal: Point) -> None:
        self.goal = goal
        self.state = State.FIX_YAW

    def restart(self) -> None:
        """Begin with state 0, as when the behaviour is switched on: an old command of state 1 would drive the robot
        before it has turned to the goal.
        """
        self.state = State.FIX_YAW

    def change_state(self, state: State) -> None:
        """Enter ``state`` and log it."""
        self.state = State(state)
        LOG.info('State changed to [%d]', self.state)

    def update(self, pose: Pose, regions: Optional[Regions] = None) -> Command:
        """Return the command for one period of the loop.

        Parameters
        ----------
        pose : (float, float, float)
            x, y [m], yaw [rad] in the odometry frame.
        regions : dict, optional
            Not used: every behaviour has the same signature.

        Returns
        -------
        (float, float)
            linear_x [m/s] and angular_z [rad/s], positive to the left.
        """
        if self.state == State.FIX_YAW:
            return self.fix_yaw(pose)
        if self.state == State.GO_STRAIGHT_AHEAD:
            return self.go_straight_ahead(pose)
        return self.done()

    def yaw_error(self, pose: Pose) -> float:
        """Return the rotation [rad] in [-pi, pi) that turns the robot to the goal; left is positive."""
        return wrap_angle(math.atan2(self.goal[1] - pose[1], self.goal[0] - pose[0]) - pose[2])

    def fix_yaw(self, pose: Pose) -> Command:
        """State 0: turn on the spot until the heading is right within 2 degrees."""
        error = self.yaw_error(pose)
        if math.fabs(error) > YAW_PRECISION:
            return 0.0, math.copysign(TURN_SPEED, error)
        LOG.info('Yaw error: [%s]', error)
        self.change_state(State.GO_STRAIGHT_AHEAD)
        return 0.0, 0.0

    def go_straight_ahead(self, pose: Pose) -> Command:
        """State 1: drive, with a small constant correction, until 0.3 m from the goal.

        Both checks run in the same period, as in the original: on arrival with a heading error above 2 degrees the
        state changes to 0 first, and then to 1 and 2.
        """
        error = self.yaw_error(pose)
        distance = math.hypot(self.goal[0] - pose[0], self.goal[1] - pose[1])
        command = 0.0, 0.0
        if distance > DISTANCE_PRECISION:
            command = FORWARD_SPEED, math.copysign(CORRECTION_SPEED, error)
        else:
            LOG.info('Position error: [%s]', distance)
            self.change_state(State.DONE)
        if math.fabs(error) > YAW_PRECISION:
            LOG.info('Yaw error: [%s]', error)
            self.change_state(State.FIX_YAW)
        return command

    def done(self) -> Command:
        """State 2: stop until restarted."""
        return 0.0, 0.0
