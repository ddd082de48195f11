# SPDX-License-Identifier: BSD-3-Clause
"""The progress says done, rate, time left and failures."""
import io

import pytest

from m2wr_campaign.runner.progress import CampaignProgress, duration


def test_runs_of_earlier_do_not_count_for_the_rate():
    now = [100.0]
    stream = io.StringIO()
    progress = CampaignProgress(10, 4, stream, lambda: now[0])
    for failed in (False, True):
        now[0] += 2.0
        progress.add(failed)
    assert progress.line() == "6 of 10 runs, 0.5 runs/s, 8 s left, 1 failed" and stream.getvalue() == ""
    now[0] += 20.0
    progress.add(False)
    assert stream.getvalue().count("\n") == 1


def test_the_last_run_is_always_told():
    stream = io.StringIO()
    CampaignProgress(1, 0, stream, lambda: 5.0).add(False)
    assert stream.getvalue().startswith("1 of 1 runs")


@pytest.mark.parametrize("seconds, text", [(5.0, "5 s"), (600.0, "10 min"), (7200.0, "2.0 h")])
def test_durations_are_short(seconds, text):
    assert duration(seconds) == text
