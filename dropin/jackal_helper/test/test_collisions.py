# SPDX-License-Identifier: BSD-3-Clause
"""When a robot has collided, by the counts in the diagnostics."""
import pytest

from collision_topic.collisions import KEY, Collisions


def test_each_new_contact_is_a_collision():
    collisions = Collisions("jackal")
    counts = [None, 1, 1, 3, 3]
    found = [collisions.update({} if count is None else {KEY.format("jackal"): str(count)}) for count in counts]
    assert found == [False, True, False, True, False]


def test_other_robots_do_not_count():
    collisions = Collisions("jackal")
    assert not collisions.update({KEY.format("husky"): "4"})


def test_after_a_reset_the_count_starts_again():
    collisions = Collisions("jackal")
    assert collisions.update({KEY.format("jackal"): "5"})
    assert not collisions.update({})
    assert collisions.update({KEY.format("jackal"): "1"})


@pytest.mark.parametrize("text", ["", "x", "-1", "1.5", "9" * 5000, "²"])
def test_what_is_no_count_is_none(text):
    assert not Collisions("jackal").update({KEY.format("jackal"): text})
