# SPDX-License-Identifier: BSD-3-Clause
"""The recovery behaviours that move_base has by default, or by its list."""
import pytest

from m2wr_navigation import registry
from m2wr_navigation.ros.recovery_setup import default_list, listed

VALUES = {"conservative_reset_dist": 3.0, "clearing_rotation_allowed": True}


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
