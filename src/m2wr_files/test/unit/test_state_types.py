# SPDX-License-Identifier: BSD-3-Clause
"""Stored attributes: what is taken is given back, and what is not allowed is refused."""
import math

import numpy as np
import pytest

from m2wr_files.state_store import KindError, Store
from m2wr_files.state_types import Array, Generator, Group, ListedRecord, Many, Maybe, Number, Part, Text

STEP = ListedRecord(lambda values: Step(**values), {"at": Array("float64", "2", -9.0, 9.0), "length": Number(float)})
WALK = {"name": Text(4), "count": Number(int, 0, below="steps"), "steps": Many(STEP, "steps"),
        "rays": Many(Array("int8", "2 H")), "last": Maybe(Group(Number(int), Number(bool))), "rng": Generator()}


class Step:
    def __init__(self, at, length):
        self.at, self.length = at, length


class Walk:
    """An object with all types of attributes, and one that is not stored."""

    def __init__(self, **values):
        self.name, self.count, self.last, self.rng = "east", 1, (3, True), np.random.default_rng(4)
        self.steps = [Step(np.array([1.0, 2.0]), 0.5), Step(np.array([-1.0, 8.0]), 2.5)]
        self.rays = [np.zeros((2, 3), np.int8), np.ones((2, 1), np.int8)]
        self.config = "not stored"
        vars(self).update(values)


def part(**changed):
    return Part(dict(WALK, **changed), ("config",))


def stored(**values):
    store = Store()
    part().take(Walk(**values), "", store)
    return Store(store.values, store.arrays)


def given(store):
    """A walk with other values, filled from a store."""
    walk = Walk(name="", count=0, last=None, rng=None, steps=[], rays=[])
    ordered = dict(WALK)
    ordered["count"] = ordered.pop("count")         # after the list whose length it must not reach
    Part(ordered, ("config",)).give_to(walk, "", store)
    return walk


def test_object_round_trip():
    walk = given(stored())
    assert (walk.name, walk.count, walk.last, walk.config) == ("east", 1, (3, True), "not stored")
    assert [step.at.tolist() for step in walk.steps] == [[1.0, 2.0], [-1.0, 8.0]]
    assert [step.length for step in walk.steps] == [0.5, 2.5]
    assert [ray.shape for ray in walk.rays] == [(2, 3), (2, 1)]
    assert walk.rng.normal() == np.random.default_rng(4).normal()


def test_missing_object_is_none():
    assert given(stored(last=None)).last is None


@pytest.mark.parametrize("values, words", [
    ({"count": 2}, "count is 2; expected 0 to .*, below 2"), ({"count": -1}, "count is -1"),
    ({"steps": [Step(np.array([1.0, math.nan]), 0.0)] * 2}, "steps.at is nan; expected -9 to 9"),
    ({"steps": [Step(np.array([1.0, 10.0]), 0.0)] * 2}, "steps.at is 10")])
def test_value_outside_its_range_is_refused(values, words):
    with pytest.raises(KindError, match=words):
        given(stored(**values))


@pytest.mark.parametrize("change, words", [
    (lambda store: store.values.pop("name"), "it has no name"),
    (lambda store: store.values.update(name="eastward"), "a word of at most 4 letters"),
    (lambda store: store.values.update(count=True), "count is True; expected int"),
    (lambda store: store.values.update(rng=["MT19937", 1, 1, 0, 0]), "rng: no state of a random generator"),
    (lambda store: store.arrays.pop("steps.at"), "it has no steps.at"),
    (lambda store: store.arrays.update({"steps.length": np.zeros(2, np.float32)}), "is of float32; expected float64"),
    (lambda store: store.arrays.update({"steps.length": np.zeros(3)}), "steps: its parts are of different length"),
    (lambda store: store.arrays.update({"rays.lengths": np.array([3, 2])}), "does not fit the lengths of its parts"),
    (lambda store: store.arrays.update({"last.0": np.array([1, 2]), "last.1": np.array([True, True])}),
     "last: 2 where one is expected")])
def test_changed_store_is_refused(change, words):
    store = stored()
    change(store)
    with pytest.raises(KindError, match=words):
        given(store)


def test_attribute_that_is_not_declared_is_refused():
    with pytest.raises(KindError, match="Walk has other attributes than this program stores: news"):
        part().take(Walk(news=1), "", Store())


def test_array_of_another_type_is_refused():
    with pytest.raises(KindError, match="rays is int64 with 2 axes; expected int8 with 2"):
        part().take(Walk(rays=[np.zeros((2, 3), np.int64)]), "", Store())
