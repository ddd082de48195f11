# SPDX-License-Identifier: BSD-3-Clause
"""Warnings about rejected messages: at most one in 5 s of simulated time, and at once after a reset."""
import logging
from types import SimpleNamespace

from m2wr_sim.plugins.rejections import Rejections

S = 1000000000


def test_one_warning_in_five_seconds_of_simulated_time(caplog):
    rejections = Rejections(SimpleNamespace(log=logging.getLogger("m2wr_sim.plugins")))
    for second in range(11):
        rejections.warn(second * S, "robot: %d rejected", second)
    assert [record.getMessage() for record in caplog.records] == [
        "robot: %d rejected" % second for second in (0, 5, 10)]


def test_a_reset_ends_the_pause(caplog):
    rejections = Rejections(SimpleNamespace(log=logging.getLogger("m2wr_sim.plugins")))
    rejections.warn(4 * S, "one")
    rejections.reset()
    rejections.warn(0, "two")
    assert caplog.messages == ["one", "two"]
