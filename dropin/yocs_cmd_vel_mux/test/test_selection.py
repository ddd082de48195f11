# SPDX-License-Identifier: BSD-3-Clause
"""Which source drives: priorities, timeouts, time that jumps back, bad files."""
import pytest

from cmd_vel_choice.selection import LONGEST, ConfigurationError, Selection, Source, read_sources

NAVI = Source("Navigation", "input/navi", 1.0, 5)
TELEOP = Source("Teleoperation", "input/teleop", 0.5, 7)
FILE = """
subscribers:
  - {name: Teleoperation, topic: input/teleop, timeout: 0.5, priority: 7, short_desc: "by hand"}
  - {name: Navigation, topic: input/navi, timeout: 1.0, priority: 5}
"""


def test_a_higher_priority_takes_over_and_gives_back():
    selection = Selection()
    assert selection.passes(NAVI, 0.0) and selection.passes(TELEOP, 0.1)
    assert not selection.passes(NAVI, 0.2) and not selection.passes(NAVI, 0.6)
    assert selection.passes(NAVI, 0.61) and selection.active is NAVI


def test_an_equal_priority_waits_until_the_first_expires():
    other = NAVI._replace(name="other", topic="other")
    selection = Selection()
    assert selection.passes(NAVI, 0.0) and not selection.passes(other, 0.9) and selection.passes(other, 1.1)


def test_after_its_timeout_a_source_no_longer_drives():
    selection = Selection()
    selection.passes(TELEOP, 3.0)
    selection.expire(3.5)
    assert selection.active is TELEOP
    selection.expire(3.51)
    assert selection.active is None


def test_after_a_jump_back_of_time_every_source_may_drive():
    selection = Selection()
    selection.passes(TELEOP, 100.0)
    assert selection.passes(NAVI, 1.0) and selection.active is NAVI


def test_a_file_lists_sources_and_names_the_output():
    assert read_sources(FILE, "mux.yaml") == ([TELEOP, NAVI], "output")
    assert read_sources(FILE + "publisher: out/cmd_vel", "mux.yaml")[1] == "out/cmd_vel"


@pytest.mark.parametrize("text, words", [
    ("", "expected the keys"), ("[1]", "expected the keys"), ("a: [", "is no YAML"), ("subscribers: []", "1 to 100"),
    ("subscribers: [3]", "subscribers[0] is 3"), (FILE + "publisher: 3", "publisher is 3"),
    (FILE.replace("1.0", "-1"), "timeout is -1"), (FILE.replace("1.0", ".nan"), "timeout is nan"),
    (FILE.replace("5}", "5.5}"), "priority is 5.5"), (FILE.replace("5}", "-1}"), "priority is -1"),
    (FILE.replace("5}", ".inf}"), "priority is inf"),
    (FILE.replace("Navigation", "Teleoperation"), "occurs twice"), (FILE.replace("navi", "teleop"), "occurs twice"),
    (FILE.replace("topic: input/navi,", ""), "subscribers[1]"), ("x" * (LONGEST + 1), "expected at most"),
    ("!!python/object/apply:os.system ['true']", "is no YAML")])
def test_other_files_are_refused(text, words):
    with pytest.raises(ConfigurationError) as caught:
        read_sources(text, "mux.yaml")
    assert words in str(caught.value) and "mux.yaml" in str(caught.value)
