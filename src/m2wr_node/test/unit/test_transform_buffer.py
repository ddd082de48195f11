# SPDX-License-Identifier: BSD-3-Clause
"""Stamps that end a process inside tf2 do not come that far."""
import os

import pytest
import rospy
from geometry_msgs.msg import TransformStamped

from m2wr_node.ros import transform_buffer
from m2wr_node.ros.transform_buffer import FARTHEST, LATEST, TransformBuffer, fault_of_transform, is_out_of_range


def transform(secs):
    made = TransformStamped(child_frame_id="b")
    made.header.frame_id, made.transform.rotation.w = "a", 1.0
    made.header.stamp.secs = secs
    return made


def exit_code(work):
    """Return how a process of its own ends that does ``work()``: 0, or below it for a signal."""
    pid = os.fork()
    if not pid:
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)
    _, status = os.waitpid(pid, 0)
    return -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)


@pytest.mark.parametrize("secs", [LATEST, LATEST + 5, 2**32 - 70, 2**32 - 1, 2**32 + 3])
def test_a_stamp_that_tf2_cannot_use_is_refused(secs, monkeypatch):
    said = []
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: said.append(text))

    def work():
        buffer = TransformBuffer(debug=False)
        for more in (0, 1):
            buffer.set_transform(transform(secs + more), "a node")
        buffer.set_transform_static(transform(secs), "a node")
        buffer.set_transform(transform(10), "a friend")
        assert buffer.lookup_transform_core("a", "b", rospy.Time(0)).header.stamp.secs == 10
        assert len(said) == 3 and str(secs) in said[0] and str(LATEST) in said[0]

    assert exit_code(work) == 0


def test_up_to_the_limit_all_are_taken():
    def work():
        buffer = TransformBuffer(debug=False)
        for secs in (LATEST - 5, LATEST - 1):
            buffer.set_transform(transform(secs), "a friend")
        assert buffer.lookup_transform_core("a", "b", rospy.Time(LATEST - 3)).header.stamp.secs == LATEST - 3

    assert exit_code(work) == 0
    assert not is_out_of_range(rospy.Time(LATEST - 1)) and transform_buffer.is_out_of_range(rospy.Time(LATEST))


@pytest.mark.parametrize("name", ["x", "y", "z"])
@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan"), 1e300, -2e9])
def test_a_translation_that_is_infinite_or_huge_is_refused(name, value):
    made = transform(10)
    assert not fault_of_transform(made)
    setattr(made.transform.translation, name, value)
    assert "translation" in fault_of_transform(made) and "%g" % value in fault_of_transform(made)


def test_the_farthest_translation_is_taken():
    made = transform(10)
    made.transform.translation.x = -FARTHEST
    assert not fault_of_transform(made)


def test_a_rotation_that_is_not_finite_is_refused():
    made = transform(10)
    made.transform.rotation.w = float("inf")
    assert "rotation" in fault_of_transform(made)
