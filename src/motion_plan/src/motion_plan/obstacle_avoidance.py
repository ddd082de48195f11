# SPDX-License-Identifier: BSD-3-Clause
"""Obstacle avoidance without a goal: drive, turn away from obstacles nearer than a metre."""
from __future__ import annotations

import logging
from enum import Enum
from typing import Dict, Optional, Tuple

from motion_plan.planar_types import Command, Pose, Regions

LOG = logging.getLogger(__name__)

#: A sector nearer than this [m] counts as occupied.
THRESHOLD = 1.0


class State(Enum):
    """Action of the robot; the value is its command (linear_x [m/s], angular_z [rad/s])."""

    GO_STRAIGHT = (0.6, 0.0)
    TURN_LEFT = (0.0, 0.3)
    TURN_RIGHT = (0.0, -0.3)
    PASS_BETWEEN = (0.3, 0.0)


#: (front, fleft, fright occupied) -> text of the case, state.
CASES: Dict[Tuple[bool, ...], Tuple[str, State]] = {
    (False, False, False): ('case 1 - nothing', State.GO_STRAIGHT),
    (True, False, False): ('case 2 - front', State.TURN_LEFT),
    (False, False, True): ('case 3 - fright', State.TURN_LEFT),
    (False, True, False): ('case 4 - fleft', State.TURN_RIGHT),
    (True, False, True): ('case 5 - front and fright', State.TURN_LEFT),
    (True, True, False): ('case 6 - front and fleft', State.TURN_RIGHT),
    (True, True, True): ('case 7 - front and fleft and fright', State.TURN_LEFT),
    (False, True, True): ('case 8 - fleft and fright', State.PASS_BETWEEN),
}


class ObstacleAvoidance:
    """The table of eight cases over the sectors front, fleft and fright."""

    def __init__(self) -> None:
        self.state = State.GO_STRAIGHT
        self.case = ''

    def take_action(self, regions: Regions) -> None:
        """Choose the state from ``regions`` (dict of sector to metres). A value equal to 1 m matches no case."""
        values = [regions[name] for name in ('front', 'fleft', 'fright')]
        if not all(value < THRESHOLD or value > THRESHOLD for value in values):
            self.case = 'unknown case'
            LOG.info('%s %s', self.case, regions)
            return
        case, self.state = CASES[tuple(value < THRESHOLD for value in values)]
        if case != self.case:
            self.case = case
            LOG.info('%s', case)

    def update(self, pose: Optional[Pose] = None, regions: Optional[Regions] = None) -> Command:
        """Return (linear_x [m/s], angular_z [rad/s]).

        Parameters
        ----------
        pose : (float, float, float), optional
            Not used: every behaviour has the same signature.
        regions : dict, optional
            Least range [m] of each laser sector; evaluated first.
        """
        if regions is not None:
            self.take_action(regions)
        return self.state.value
