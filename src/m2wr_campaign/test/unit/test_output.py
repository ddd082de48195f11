# SPDX-License-Identifier: BSD-3-Clause
"""The error that explains why a program gave no result is found in what it wrote."""
import pytest

from m2wr_campaign.programs.output import LONGEST, last_error

OLD = """started with pid [9]
  File "/tmp/x/motion_plan/go_to_point.py", line 44
    print 'State changed to [%s]' % state_
    ^^^^^^^^
SyntaxError: Missing parentheses in call to 'print'. Did you mean print(...)?
[go_to_point-2] process has died [pid 10, exit code 1]
"""


def test_the_last_error_is_told_with_its_place():
    text = "ValueError: the first\n" + OLD
    assert last_error(text) == ("; it wrote: SyntaxError: Missing parentheses in call to 'print'. Did you mean "
                                "print(...)? (go_to_point.py, line 44)")


@pytest.mark.parametrize("text, told", [
    ("", ""), ("all is well\nno Error: here\n", ""),
    ("rospy.exceptions.ROSInitException: no master\n", "; it wrote: rospy.exceptions.ROSInitException: no master"),
    ("RLException: unused args [x]\n", "; it wrote: RLException: unused args [x]")])
def test_other_output(text, told):
    assert last_error(text) == told


def test_a_long_error_is_cut():
    assert len(last_error("KeyError: " + "x" * 10000)) < LONGEST + 20
