# SPDX-License-Identifier: BSD-3-Clause
"""Groups of diagnostics: members, levels, stale and missing items."""
import pytest

from diagnostic_groups.analyzers import ERROR, OK, STALE, WARN, Aggregator, ConfigurationError, Item

GENERIC = "diagnostic_aggregator/GenericAnalyzer"


def analyzers(**groups):
    return {"base_path": "robot", "analyzers": groups}


def levels(aggregator, now=1.0):
    return {item.name: item.level for item in aggregator.report(now)}


def test_items_are_grouped_by_prefix_part_and_name():
    made = Aggregator(analyzers(motors={"type": GENERIC, "path": "Motors", "find_and_remove_prefix": "motor_"},
                                power={"type": GENERIC, "path": "Power", "contains": ["battery", "fuse"]},
                                laser={"type": GENERIC, "path": "Laser", "name": "scan: rate"}))
    for name, level in (("motor_left", OK), ("motor_right", WARN), ("main battery", OK), ("scan: rate", ERROR)):
        made.add(Item(name, level, time=1.0))
    assert levels(made) == {"/robot/Motors": WARN, "/robot/Motors/left": OK, "/robot/Motors/right": WARN,
                            "/robot/Power": OK, "/robot/Power/main battery": OK, "/robot/Laser": ERROR,
                            "/robot/Laser/scan: rate": ERROR}


def test_what_belongs_to_no_group_is_in_other():
    made = Aggregator(analyzers())
    made.add(Item("strange", WARN, time=1.0))
    assert levels(made) == {"/robot/Other": WARN, "/robot/Other/strange": WARN}
    assert made.worst(made.report(1.0)) == WARN


def test_old_items_are_stale_and_one_among_others_is_an_error():
    made = Aggregator(analyzers(a={"type": GENERIC, "path": "A", "startswith": "a", "timeout": 2.0}))
    made.add(Item("a1", OK, time=0.0))
    made.add(Item("a2", OK, time=3.0))
    assert levels(made, 3.5) == {"/robot/A": ERROR, "/robot/A/a1": STALE, "/robot/A/a2": OK}
    assert levels(made, 9.0)["/robot/A"] == STALE


def test_expected_items_that_never_came_are_missing():
    made = Aggregator(analyzers(a={"type": GENERIC, "path": "A", "expected": ["one", "two"], "num_items": 2}))
    made.add(Item("one", OK, time=1.0))
    assert levels(made) == {"/robot/A": ERROR, "/robot/A/one": OK, "/robot/A/two": STALE}


def test_groups_contain_groups():
    inner = {"type": GENERIC, "path": "Left", "startswith": "left"}
    made = Aggregator(analyzers(arms={"type": "diagnostic_aggregator/AnalyzerGroup", "path": "Arms",
                                      "analyzers": {"left": inner}}))
    made.add(Item("left wrist", WARN, time=1.0))
    assert levels(made) == {"/robot/Arms": WARN, "/robot/Arms/Left": WARN, "/robot/Arms/Left/left wrist": WARN}


@pytest.mark.parametrize("parameters, words", [
    ({"analyzers": 3}, "~analyzers is 3; expected a dictionary"),
    (analyzers(a={"type": "CoreAnalyzer"}), "~analyzers/a/type is 'CoreAnalyzer'; expected diagnostic_aggregator/Gen"),
    (analyzers(a={"type": GENERIC, "contains": [1]}), "~analyzers/a/contains is [1]; expected a text"),
    (analyzers(a={"type": GENERIC, "timeout": "long"}), "~analyzers/a/timeout is 'long'; expected a number"),
    (analyzers(a=None), "~analyzers/a is None; expected a dictionary")])
def test_unusable_parameters_are_named(parameters, words):
    with pytest.raises(ConfigurationError) as caught:
        Aggregator(parameters)
    assert words in str(caught.value)
