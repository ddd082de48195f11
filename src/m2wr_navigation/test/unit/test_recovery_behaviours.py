# SPDX-License-Identifier: BSD-3-Clause
"""The recovery behaviours that move_base has by default, or by its list."""
from types import SimpleNamespace

import pytest

from m2wr_navigation import registry
from m2wr_navigation.recoveries.behaviours import default_list, listed, made

VALUES = {"conservative_reset_dist": 3.0, "clearing_rotation_allowed": True}
ROTATE = "rotate_recovery/RotateRecovery"


def test_the_default_is_that_of_the_original_and_backing():
    found = default_list(VALUES, 0.5)
    assert [name for name, _, _ in found] == ["conservative_reset", "rotate_recovery", "back_up", "aggressive_reset",
                                              "rotate_recovery"]
    assert found[3][2] == {"reset_distance": 2.0}
    assert all(registry.find(registry.RECOVERIES, kind) for _, kind, _ in found)


def test_without_turns_the_robot_does_not_back_either():
    found = default_list(dict(VALUES, clearing_rotation_allowed=False), 0.5)
    assert [name for name, _, _ in found] == ["conservative_reset", "aggressive_reset"]


@pytest.mark.parametrize("given", [3, "rotate", [{"name": "a"}], [{"name": "a", "type": "b"}] * 2])
def test_a_list_that_cannot_be_used_says_why(given):
    found, fault = listed(given)
    assert found == [] and fault
    recoveries, warnings = made(VALUES, 0.5, SimpleNamespace(), {"recovery_behaviors": given}.get)
    assert len(recoveries) == 5 and len(warnings) == 1 and fault in warnings[0]


def test_own_parameters_win_over_those_of_the_list():
    given = {"aggressive_reset": {"reset_distance": 1.0}, "rotate_recovery": {"max_vel_theta": 0.5},
             "TrajectoryPlannerROS": {"max_vel_theta": 2.0, "min_in_place_vel_theta": 0.3}}
    found, warnings = made(VALUES, 0.5, SimpleNamespace(), given.get)
    assert [found[k].values["reset_distance"] for k in (0, 3)] == [3.0, 1.0] and not warnings
    assert (found[1].values["max_vel_theta"], found[1].values["min_in_place_vel_theta"]) == (0.5, 0.3)


def test_an_own_list_leaves_out_what_there_is_not():
    given = {"recovery_behaviors": [{"name": "turn", "type": ROTATE}, {"name": "fly", "type": "a/Fly"}], "turn": 3}
    found, warnings = made(VALUES, 0.5, SimpleNamespace(), given.get)
    assert [each.name for each in found] == ["turn"]
    assert len(warnings) == 1 and "fly is left out" in warnings[0]
