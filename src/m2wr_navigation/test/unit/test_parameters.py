# SPDX-License-Identifier: BSD-3-Clause
"""Values of parameters are converted, clipped, or refused with the reason."""
import math

import pytest

from m2wr_navigation.parameters import Parameter, converted, flag, names, read, text, unknown

TABLE = {"rate": Parameter(5.0, "Hz", 0.0, 100.0, "rate"), "width": Parameter(10, "m", 0, 50, "width"),
         "enabled": flag(True, "whether it works"), "topic": text("map", "name"),
         "layers": names(["a"], "layers")}


@pytest.mark.parametrize("name, given, value", [
    ("rate", 7, 7.0), ("rate", "1e1", 10.0), ("rate", 1e9, 100.0), ("rate", -1, 0.0), ("width", 40.0, 40),
    ("enabled", 0, False), ("enabled", True, True), ("topic", "scan", "scan"), ("layers", ["b", "c"], ["b", "c"])])
def test_a_usable_value_gets_type_and_range(name, given, value):
    result = converted(TABLE[name], given)
    assert result == value and type(result) is type(value)


@pytest.mark.parametrize("name, given", [
    ("rate", "fast"), ("rate", math.nan), ("rate", True), ("rate", [1]), ("enabled", 2), ("enabled", "yes"),
    ("topic", 3), ("width", {}), ("layers", "b"), ("layers", [1])])
def test_an_unusable_value_is_named_and_the_default_used(name, given):
    values, warnings = read(TABLE, {name: given}, "~x")
    assert values[name] == TABLE[name].default
    assert len(warnings) == 1 and "~x/" + name in warnings[0] and "expected" in warnings[0]


def test_a_clipped_value_is_told_with_its_range():
    values, warnings = read(TABLE, {"rate": 200.0}, "~x")
    assert values["rate"] == 100.0 and "0 to 100 Hz" in warnings[0]


def test_a_value_that_fits_gives_no_warning():
    assert read(TABLE, {"rate": 7, "width": 40.0, "other": 1}, "~x")[1] == []


def test_an_unknown_name_is_told_with_the_nearest_known_one():
    assert unknown(["rates", "rate", "qqq"], TABLE, "~x") == [
        "parameter ~x/qqq has no effect", "parameter ~x/rates has no effect; did you mean rate?"]


def test_an_old_name_of_a_limit_is_told_with_the_new_one():
    names = ["max_vel_theta", "max_vel_trans", "max_vel_x"]
    for old, new in (("max_vel_rot", "max_vel_theta"), ("max_trans_vel", "max_vel_trans")):
        assert unknown([old], names, "~DWAPlannerROS") == [
            "parameter ~DWAPlannerROS/{} has no effect; did you mean {}?".format(old, new)]
