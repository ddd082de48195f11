# SPDX-License-Identifier: BSD-3-Clause
"""Tuned constants of the mapper have a unit, a meaning and a source, and are used."""
import dataclasses
import glob
import math
import os

import pytest

from m2wr_gmapping import tuning
from m2wr_tools.slam_benchmark.tuned_constants import constants, derived

ROOT = os.path.dirname(tuning.__file__)
MODULES = sorted(path for folder in ("", "frontend", "filter", "backend", "io", "ros")
                 for path in glob.glob(os.path.join(ROOT, folder, "*.py")))
CONSTANTS, FOLLOWING = list(constants()), list(derived())


def read(path):
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def components(value):
    return value if isinstance(value, tuple) else (value,)


@pytest.mark.parametrize("constant", CONSTANTS, ids=lambda one: one.group + "." + one.name)
def test_a_constant_has_value_unit_meaning_and_source(constant):
    values, units = components(constant.value), constant.unit.split(", ")
    assert all(isinstance(value, (int, float)) and math.isfinite(value) and value > 0.0 for value in values)
    assert all(units) and (len(units) == len(values) or len(values) == 1)
    assert constant.meaning[0].isupper() and constant.meaning.endswith(".") and constant.source


def read_values():
    """All values that modules read, constants and what follows from them."""
    return {name: value for path in MODULES for name, value in tuning.read_by(read(path)).items()}


@pytest.mark.parametrize("constant", CONSTANTS, ids=lambda one: one.group + "." + one.name)
def test_every_constant_changes_what_some_module_reads(constant, monkeypatch):
    before, group = read_values(), getattr(tuning, constant.group)
    much = tuple(3 * value for value in components(constant.value))
    monkeypatch.setattr(tuning, constant.group, dataclasses.replace(
        group, **{constant.name: much if isinstance(constant.value, tuple) else much[0]}))
    assert read_values() != before


def test_what_follows_is_read_and_is_told_with_its_unit():
    inside = read(tuning.__file__)
    for one in FOLLOWING:
        name = one.group + "." + one.name
        assert name in read_values() or name in inside or "self." + one.name in inside, name
        values = components(one.value)
        assert all(math.isfinite(value) and value > 0.0 for value in values) and one.meaning[0].isupper(), name
        assert one.unit and len(values) in (1, len(one.unit.split(", "))), name
