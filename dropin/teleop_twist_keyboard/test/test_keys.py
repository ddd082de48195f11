# SPDX-License-Identifier: BSD-3-Clause
"""The meaning of the keys: velocities in closed form, speeds, limits."""
import pytest

from twist_keys.keys import DIRECTIONS, FACTORS, HELP, KeyDriver


@pytest.mark.parametrize('key, command', [
    ('i', (0.5, 0, 0, 0)), (',', (-0.5, 0, 0, 0)), ('j', (0, 0, 0, 2)), ('l', (0, 0, 0, -2)), ('u', (0.5, 0, 0, 2)),
    ('o', (0.5, 0, 0, -2)), ('m', (-0.5, 0, 0, -2)), ('.', (-0.5, 0, 0, 2)), ('k', (0, 0, 0, 0)),
    ('I', (0.5, 0, 0, 0)), ('<', (-0.5, 0, 0, 0)), ('J', (0, 0.5, 0, 0)), ('L', (0, -0.5, 0, 0)),
    ('U', (0.5, 0.5, 0, 0)), ('O', (0.5, -0.5, 0, 0)), ('M', (-0.5, 0.5, 0, 0)), ('>', (-0.5, -0.5, 0, 0)),
    ('t', (0, 0, 0.5, 0)), ('b', (0, 0, -0.5, 0))])
def test_directions(key, command):
    driver = KeyDriver(0.5, 2.0)
    assert driver.press(key) == '' and driver.command() == command


def test_every_other_key_stops():
    for code in range(256):
        key = chr(code)
        if key not in DIRECTIONS and key not in FACTORS:
            driver = KeyDriver()
            driver.press('u')
            driver.press(key)
            assert driver.command() == (0, 0, 0, 0), repr(key)


@pytest.mark.parametrize('key, linear, angular', [
    ('q', 1.1, 1.1), ('z', 0.9, 0.9), ('w', 1.1, 1), ('x', 0.9, 1), ('e', 1, 1.1), ('c', 1, 0.9)])
def test_speeds_change_while_driving(key, linear, angular):
    driver = KeyDriver(0.5, 2.0)
    driver.press('u')
    assert 'currently' in driver.press(key)
    assert driver.command() == pytest.approx((0.5 * linear, 0, 0, 2.0 * angular))


def test_speeds_stop_at_their_limits_with_a_message():
    driver = KeyDriver(0.5, 1.0, speed_limit=0.52, turn_limit=1.05)
    said = driver.press('q')
    assert 'Linear speed limit' in said and 'Angular speed limit' in said
    assert (driver.speed, driver.turn) == (0.52, 1.05)
    assert 'limit' not in driver.press('z')


def test_an_initial_speed_beyond_the_limit_is_clipped():
    assert KeyDriver(2.0, 3.0, 1.0, 1.0).speed == 1.0 and KeyDriver(2.0, 3.0, 1.0, 1.0).turn == 1.0


def test_the_help_comes_again_after_fifteen_changes():
    driver = KeyDriver()
    said = [HELP in driver.press('q') for _ in range(30)]
    assert [number for number, shown in enumerate(said) if shown] == [14, 29]


def test_a_question_mark_stops_and_shows_the_help():
    driver = KeyDriver()
    driver.press('i')
    assert driver.press('?') == HELP and driver.command() == (0, 0, 0, 0)


def test_release_stops_once():
    driver = KeyDriver()
    assert not driver.release()
    driver.press('i')
    assert driver.release() and driver.command() == (0, 0, 0, 0) and not driver.release()


def test_the_help_names_every_key():
    shown = set(HELP.replace('10 %', '').split())
    assert set(DIRECTIONS) | set(FACTORS) <= shown
