# SPDX-License-Identifier: BSD-3-Clause
"""The report's wall follower: three states chosen by a table over three laser sectors. Keeps the wall on the right."""
from __future__ import annotations

import logging
from enum import IntEnum
from typing import Dict, Optional, Tuple

from motion_plan.planar_types import Command, Pose, Regions
from motion_plan.regions import SECTOR_NAMES

LOG = logging.getLogger(__name__)

#: A sector nearer than this [m] counts as occupied.
THRESHOLD = 1.5


class State(IntEnum):
    """States of the behaviour, numbered as in the report's log lines."""

    FIND_WALL = 0
    TURN_LEFT = 1
    FOLLOW_THE_WALL = 2


STATE_NAMES = {State.FIND_WALL: 'find the wall', State.TURN_LEFT: 'turn left',
               State.FOLLOW_THE_WALL: 'follow the wall'}

#: (front, fleft, fright occupied) -> number and text of the case, state.
CASES: Dict[Tuple[bool, ...], Tuple[str, State]] = {
    (False, False, False): ('case 1 - nothing', State.FIND_WALL),
    (True, False, False): ('case 2 - front', State.TURN_LEFT),
    (False, False, True): ('case 3 - fright', State.FOLLOW_THE_WALL),
    (False, True, False): ('case 4 - fleft', State.FIND_WALL),
    (True, False, True): ('case 5 - front and fright', State.TURN_LEFT),
    (True, True, False): ('case 6 - front and fleft', State.TURN_LEFT),
    (True, True, True): ('case 7 - front and fleft and fright', State.TURN_LEFT),
    (False, True, True): ('case 8 - fleft and fright', State.FIND_WALL),
}


class WallFollower:
    """The table and its three actions; no guard (see `motion_plan.wall_guard`)."""

    def __init__(self) -> None:
        self.state = State.FIND_WALL
        self.regions = {name: 0.0 for name in SECTOR_NAMES}
        self.case = ''

    def change_state(self, state: State) -> None:
        """Enter ``state``; a change is logged."""
        if state != self.state:
            LOG.info('Wall follower - [%d] - %s', state, STATE_NAMES[state])
            self.state = State(state)

    def take_action(self, regions: Regions) -> None:
        """Choose the state from the sectors ``regions`` (dict of name to metres). A value equal to 1.5 m matches
        no case: the state is kept and the sectors are logged.
        """
        self.regions = regions
        key = []
        for name in ('front', 'fleft', 'fright'):
            if not (regions[name] < THRESHOLD or regions[name] > THRESHOLD):
                self.case = 'unknown case'
                LOG.info('%s %s', self.case, regions)
                return
            key.append(regions[name] < THRESHOLD)
        self.case, state = CASES[tuple(key)]
        self.change_state(state)

    take_actions = take_action

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
        if self.state == State.FIND_WALL:
            return self.find_wall()
        if self.state == State.TURN_LEFT:
            return self.turn_left()
        return self.follow_the_wall()

    @staticmethod
    def find_wall() -> Command:
        """State 0: a clockwise circle; the wall is kept on the right, so it can only be found there."""
        return 0.2, -0.3

    @staticmethod
    def turn_left() -> Command:
        """State 1: turn left on the spot."""
        return 0.0, 0.3

    @staticmethod
    def follow_the_wall() -> Command:
        """State 2: straight on."""
        return 0.5, 0.0
