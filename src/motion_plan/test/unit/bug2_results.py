# SPDX-License-Identifier: BSD-3-Clause
"""What the result of a run of Bug 2 in the planar rig must have."""
from motion_plan.bug2 import State

#: The real outline must stay this far from every obstacle [m].
MARGIN = 0.03


def reached(result, limit):
    assert result.state is State.GOAL_REACHED, (result.reason, result.robot.pose)
    assert result.clearance > MARGIN
    assert result.time < limit
    assert result.bug.distance_to_goal(result.robot.pose) <= 0.31


def unreachable(result):
    assert result.state is State.GOAL_UNREACHABLE
    assert result.clearance > MARGIN
