# SPDX-License-Identifier: BSD-3-Clause
"""m2wr_node.numbers: what counts as a number in a parameter."""
import pytest

from m2wr_node.numbers import number


@pytest.mark.parametrize("value, expected", [
    (3, 3), (0.5, 0.5), ("1e-3", 0.001), ("5E2", 500.0), ("1.5e3", 1500.0), (".5e+1", 5.0), ("-2e0", -2.0)])
def test_numbers_and_what_yaml_does_not_read_as_one(value, expected):
    assert number(value) == expected


@pytest.mark.parametrize("value", [True, False, "3", "e5", "1e", "1e5 ", "nan", "", None, [1.0]])
def test_everything_else_is_none(value):
    assert number(value) is None
