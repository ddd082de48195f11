# SPDX-License-Identifier: BSD-3-Clause
"""The cycle collector while a world is built."""
from __future__ import annotations

import gc

import pytest

from m2wr_sim.collector import paused_collector


def is_in(generation, wanted):
    return any(found is wanted for found in gc.get_objects(generation=generation))


@pytest.fixture(autouse=True)
def collector_as_before():
    was_on = gc.isenabled()
    gc.enable()
    yield
    (gc.enable if was_on else gc.disable)()


def test_new_objects_are_old_afterwards_without_a_collection():
    count = gc.get_stats()[2]["collections"]
    with paused_collector():
        assert not gc.isenabled()
        made = [[]]
        assert is_in(0, made)
    assert gc.isenabled()
    assert is_in(2, made) and gc.get_stats()[2]["collections"] == count


def test_a_collector_that_was_stopped_stays_so():
    gc.disable()
    with paused_collector():
        made = [[]]
    assert not gc.isenabled() and is_in(0, made)


def test_frozen_objects_of_others_stay_frozen():
    mine = [[]]
    gc.freeze()
    try:
        frozen = gc.get_freeze_count()
        with paused_collector():
            pass
        assert gc.get_freeze_count() == frozen and not is_in(2, mine)
    finally:
        gc.unfreeze()
