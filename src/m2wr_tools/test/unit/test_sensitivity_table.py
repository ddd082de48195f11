# SPDX-License-Identifier: BSD-3-Clause
"""What the table of the sensitivity says about half and twice a constant."""
import math

import pytest

from m2wr_tools.slam_benchmark import sensitivity_table as table

BASE = {"a": 0.05, "b": 0.1, "c": 0.5}      # c is lost already


def changed(**errors):
    return dict(BASE, **errors)


def test_median_worst_and_lost_logs_are_counted():
    assert table.summary(BASE) == dict(median=0.1, worst=0.5, lost=1)
    assert table.summary(changed(a=None)) == dict(median=0.5, worst=math.inf, lost=2)


@pytest.mark.parametrize("others, said", [
    ([BASE, BASE], "moves nothing"),
    ([changed(a=0.0504), BASE], "moves nothing"),       # less than a millimetre
    ([changed(a=0.06), BASE], ""),
    ([BASE, changed(b=0.31)], "breaks"),                # lost, and was not
    ([BASE, changed(c=None)], ""),                      # was lost before
    ([BASE, changed(b=None)], "breaks"),
    ([changed(a=0.16, b=0.16)], "breaks"),              # median
    ([], "")])
def test_the_mark_of_a_constant(others, said):
    assert table.mark(BASE, others) == said


def test_the_table_has_a_row_for_each_constant():
    rows = [dict(constant="SCANS.slide", value=0.02, unit="1", errors={0.5: BASE, 2.0: changed(b=0.4)}),
            dict(constant="SLIPS.left", value=(0.05, 0.05, 0.03), unit="m, m, rad", errors={0.5: BASE})]
    text = table.markdown(BASE, rows, [0.5, 2.0])
    assert "as they are, 3 logs: 0.100, 0.50, 1" in text
    assert "| SCANS.slide | 0.02 | 1 | 0.100, 0.50, 1 | 0.400, 0.50, 2 | breaks |" in text
    assert "| SLIPS.left | 0.05, 0.05, 0.03 | m, m, rad | 0.100, 0.50, 1 |  | moves nothing |" in text
