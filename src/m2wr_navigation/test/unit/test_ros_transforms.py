# SPDX-License-Identifier: BSD-3-Clause
"""A transform that is missing or late names its frames, age, tolerance, and the node that sends it."""
import pytest
import rospy
from geometry_msgs.msg import TransformStamped

from m2wr_navigation.ros.transforms import TransformError, Transforms
from m2wr_node.ros.transform_buffer import TransformBuffer


@pytest.fixture
def transforms(monkeypatch):
    """Return transforms without a master; the time is 10 s."""
    monkeypatch.setattr(rospy, "get_time", lambda: 10.0)
    found = Transforms.__new__(Transforms)
    found.buffer = TransformBuffer(rospy.Duration(30.0), debug=False)
    return found


def send(transforms, parent, child, stamp, sender):
    message = TransformStamped()
    message.header.frame_id, message.child_frame_id, message.header.stamp = parent, child, rospy.Time.from_sec(stamp)
    message.transform.rotation.w = 1.0
    if stamp:
        transforms.buffer.set_transform(message, sender)
    else:
        transforms.buffer.set_transform_static(message, sender)


def tree(transforms, of_amcl=9.9, of_simulator=9.9):
    for newest in (False, True):
        send(transforms, "map", "odom", of_amcl if newest else 1.0, "/amcl")
        send(transforms, "odom", "base_link", of_simulator if newest else 1.0, "/simulator")
    send(transforms, "base_link", "laser", 0.0, "/robot_state_publisher")


@pytest.mark.parametrize("late, sender", [({"of_amcl": 5.0}, "from odom to map, which /amcl sends"),
                                          ({"of_simulator": 5.0}, "from base_link to odom, which /simulator sends")])
def test_an_old_transform_names_age_tolerance_and_sender(transforms, late, sender):
    tree(transforms, **late)
    with pytest.raises(TransformError) as caught:
        transforms.fresh_pose("map", "/laser", 0.3)
    assert str(caught.value) == ("the transform from laser to map is 5.00 s old; expected at most 0.3 s "
                                 "(transform_tolerance); the oldest part is that " + sender)


def test_a_transform_of_now_that_lags_names_its_sender(transforms):
    tree(transforms, of_amcl=9.0)
    with pytest.raises(TransformError, match="at 9.500: .*extrapolation.*; the oldest part is that from odom to map, "
                                             "which /amcl sends"):
        transforms.pose("map", "laser", rospy.Time.from_sec(9.5))
    assert transforms.fresh_pose("map", "laser", 1.5).tolist() == [0.0, 0.0, 0.0]       # the newest that all have


def test_a_frame_without_a_sender_is_named(transforms):
    tree(transforms)
    send(transforms, "world", "camera", 9.9, "/other")
    for missing in ("sonar", "camera"):
        with pytest.raises(TransformError, match="there is no transform from {} to map: .*".format(missing)) as caught:
            transforms.fresh_pose("map", missing, 0.3)
        assert "oldest" not in str(caught.value)


def test_fixed_transforms_are_never_too_old(transforms):
    tree(transforms)
    assert transforms.fresh_pose("base_link", "laser", 0.1).tolist() == [0.0, 0.0, 0.0]
