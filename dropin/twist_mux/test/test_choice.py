# SPDX-License-Identifier: BSD-3-Clause
"""Which command passes: priorities, timeouts, locks, bad lists."""
import math

import pytest

from twist_choice.choice import Choice, ConfigurationError, Source, read_sources

JOY = Source("joy", "joy/cmd_vel", 0.5, 10)
NAV = Source("nav", "cmd_vel", 0.5, 1)
STOP = Source("stop", "e_stop", 0.0, 255)
ENTRY = {"name": "joy", "topic": "joy/cmd_vel", "timeout": 0.5, "priority": 10}


def test_the_higher_priority_passes_until_it_expires():
    choice = Choice([NAV, JOY])
    assert choice.passes(NAV, 0.0) and choice.passes(JOY, 0.1)
    assert not choice.passes(NAV, 0.2) and not choice.passes(NAV, 0.6)
    assert choice.passes(NAV, 0.61) and choice.chosen(0.61) is NAV and choice.chosen(5.0) is None


def test_of_equal_priorities_the_first_passes():
    first, second = (Source(name, name, 0.5, 3) for name in "ab")
    choice = Choice([first, second])
    assert choice.passes(second, 0.0) and choice.passes(first, 0.1) and not choice.passes(second, 0.2)


def test_priority_zero_never_passes():
    choice = Choice([Source("a", "a", 0.5, 0)])
    assert not choice.passes(choice.topics[0], 0.0)


def test_a_topic_without_timeout_holds_its_place_for_ever():
    forever = JOY._replace(timeout=0.0)
    choice = Choice([forever, NAV])
    assert not choice.passes(NAV, 1e6) and choice.passes(forever, 1e6)


def test_a_lock_holds_back_what_is_below_its_priority():
    lock = Source("pause", "pause", 0.0, 5)
    choice = Choice([JOY, NAV], [lock])
    assert choice.passes(NAV, 0.0)              # no message yet and no timeout: open
    choice.hear_lock(lock, True, 0.1)
    assert not choice.passes(NAV, 0.2) and choice.passes(JOY, 0.2) and choice.lock_priority(9.0) == 5
    choice.hear_lock(lock, False, 1.0)
    assert choice.passes(NAV, 1.1) and choice.lock_priority(1.1) == 0


def test_a_lock_of_equal_priority_lets_pass():
    choice = Choice([JOY], [STOP._replace(priority=10)])
    choice.hear_lock(choice.locks[0], True, 0.0)
    assert choice.passes(JOY, 0.1)


def test_a_silent_lock_with_timeout_is_closed():
    lock = STOP._replace(timeout=0.3)
    choice = Choice([JOY], [lock])
    assert not choice.passes(JOY, 0.0)
    choice.hear_lock(lock, False, 0.1)
    assert choice.passes(JOY, 0.2) and not choice.passes(JOY, 0.41)


def test_what_was_heard_before_time_jumped_back_is_forgotten():
    choice = Choice([JOY, NAV])
    choice.passes(JOY, 100.0)
    assert choice.passes(NAV, 0.0) and choice.age(JOY, 0.0) == math.inf


def test_lists_are_read_as_parameter_files_write_them():
    assert read_sources([dict(ENTRY, timeout=1, priority=10.0)], "~topics") == [JOY._replace(timeout=1.0)]
    assert read_sources([], "~locks") == []


@pytest.mark.parametrize("value, words", [
    ({"joy": ENTRY}, "expected a list"), ([3], r"~topics\[0\] is 3"), ([dict(ENTRY, priority=256)], "from 0 to 255"),
    ([dict(ENTRY, priority=True)], "priority is True"), ([dict(ENTRY, timeout=-1)], "timeout is -1"),
    ([dict(ENTRY, timeout=math.nan)], "timeout is nan"), ([dict(ENTRY, topic="")], "topic is ''"),
    ([{"name": "joy"}], "no topic and no timeout and no priority"), ([ENTRY, dict(ENTRY, topic="b")], "the name 'joy'"),
    ([ENTRY, dict(ENTRY, name="b")], "the topic 'joy/cmd_vel' occurs twice"), ([ENTRY] * 101, "at most 100")])
def test_a_bad_list_names_the_entry(value, words):
    with pytest.raises(ConfigurationError, match=words):
        read_sources(value, "~topics")
