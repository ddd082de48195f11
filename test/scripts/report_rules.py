# SPDX-License-Identifier: BSD-3-Clause
"""An independent implementation of the rules of the report's nodes, from the report's tables.

The expectations of the fixtures come from here, not from the nodes under test.
"""
import math

import numpy as np

SECTORS = ("right", "fright", "front", "fleft", "left")
#: First and last beam of each sector on the report's scan of 720 beams from -90 to +90 degrees, both included.
READING_LASER_BEAMS = ((0, 142), (144, 286), (288, 430), (432, 574), (576, 712))
SWITCHED_NODES_BEAMS = ((0, 142), (144, 286), (288, 430), (432, 574), (576, 718))
REPORT_INCREMENT = 2 * 1.570796 / 719
CAP = 10.0
#: Distance below which the wall follower regards a sector as occupied [m].
WALL = 1.5
WALL_COMMANDS = {0: (0.2, -0.3), 1: (0.0, 0.3), 2: (0.5, 0.0)}
#: (front, fleft, fright) occupied -> state of the wall follower.
WALL_TABLE = {"...": 0, "f..": 1, "..r": 2, ".l.": 0, "f.r": 1, "fl.": 1, "flr": 1, ".lr": 0}


def sector_minima(ranges, angles, beams, margin=1e-4):
    """Return the least range of the five sectors, at most 10 m, of a scan without noise.

    Parameters
    ----------
    ranges, angles : (B,) float64
        Readings [m], inf for none, and beam angles [rad]; angles may run past pi.
    beams : tuple of (int, int)
        One of the two tables above. For another scan than the report's a sector is the range of angles between its
        first and its last beam.
    margin : float
        Angle beyond its sector within which a beam still belongs to it [rad].

    Returns
    -------
    tuple of float
        In the order of SECTORS.
    """
    found = []
    wrapped = (np.asarray(angles) + math.pi) % (2 * math.pi) - math.pi
    for first, last in beams:
        low, high = -1.570796 + first * REPORT_INCREMENT, -1.570796 + last * REPORT_INCREMENT
        inside = (wrapped > low - margin) & (wrapped < high + margin)
        found.append(float(min(np.min(ranges[inside]), CAP)))
    return tuple(found)


def wall_states(minima, doubt):
    """Return the states of the wall follower that ``minima`` allow when each is known to ``doubt`` [m] only."""
    _, fright, front, fleft, _ = minima
    keys = {""}
    for letter, distance in (("f", front), ("l", fleft), ("r", fright)):
        options = ([letter] if distance < WALL + doubt else []) + (["."] if distance > WALL - doubt else [])
        keys = {key + option for key in keys for option in options}
    return sorted({WALL_TABLE[key] for key in keys})


class GoToPointRule:
    """State table of go_to_point: fix the heading (0), go straight (1), done (2)."""

    YAW_PRECISION = math.pi / 90
    DISTANCE_PRECISION = 0.3

    def __init__(self, goal):
        self.goal, self.state = goal, 0

    def turn(self, pose):
        """Return (command, states entered in this period) for the pose (x, y, yaw) of one period of the 20 Hz loop."""
        east, north = self.goal[0] - pose[0], self.goal[1] - pose[1]
        error = math.remainder(math.atan2(north, east) - pose[2], 2 * math.pi)
        off = abs(error) > self.YAW_PRECISION
        left = 1.0 if error > 0 else -1.0
        entered, command = [], (0.0, 0.0)
        if self.state == 0:
            if off:
                command = (0.0, 0.7 * left)
            else:
                entered.append(1)
        elif self.state == 1:
            if math.hypot(east, north) > self.DISTANCE_PRECISION:
                command = (0.6, 0.2 * left)
            else:
                entered.append(2)
            if off:
                entered.append(0)
        if entered:
            self.state = entered[-1]
        return command, entered
