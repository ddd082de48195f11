# SPDX-License-Identifier: BSD-3-Clause
"""What the robot does after bumps, at cliffs and with a wheel in the air."""
import pytest

from kobuki_safety.reaction import BACK, BUMPER, CENTRE, CLIFF, LEFT, RIGHT, TURN, WHEEL, Reaction


@pytest.mark.parametrize("kind", [BUMPER, CLIFF])
@pytest.mark.parametrize("sensor, turn", [(LEFT, -TURN), (CENTRE, 0.0), (RIGHT, TURN)])
def test_the_robot_backs_away_from_the_side(kind, sensor, turn):
    reaction = Reaction()
    assert reaction.command(0.0) is None
    reaction.event(kind, sensor, True, 1.0)
    assert reaction.command(1.0) == reaction.command(9.0) == (BACK, turn)
    reaction.event(kind, sensor, False, 10.0)
    assert reaction.command(10.0) is None


def test_the_centre_counts_more_than_the_sides():
    reaction = Reaction()
    for sensor in (LEFT, CENTRE, RIGHT):
        reaction.event(BUMPER, sensor, True, 0.0)
    assert reaction.command(0.0) == (BACK, 0.0)


def test_with_a_wheel_in_the_air_the_robot_stands():
    reaction = Reaction()
    reaction.event(BUMPER, LEFT, True, 0.0)
    reaction.event(WHEEL, RIGHT, True, 0.0)
    assert reaction.command(0.0) == (0.0, 0.0)


def test_the_extension_repeats_the_last_command():
    reaction = Reaction(extension=1.0)
    reaction.event(BUMPER, LEFT, True, 2.0)
    reaction.command(2.0)
    reaction.event(BUMPER, LEFT, False, 2.1)
    assert reaction.command(2.9) == (BACK, -TURN) and reaction.command(3.0) is None
    assert reaction.command(1.0) is None            # time has jumped back


def test_a_reset_forgets_and_a_disabled_controller_is_silent():
    reaction = Reaction(extension=1.0)
    reaction.event(CLIFF, CENTRE, True, 0.0)
    reaction.enabled = False
    assert reaction.command(0.0) is None
    reaction.enabled = True
    assert reaction.command(0.0) == (BACK, 0.0)
    reaction.reset()
    assert reaction.command(0.1) is None
