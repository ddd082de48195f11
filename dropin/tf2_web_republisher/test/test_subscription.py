# SPDX-License-Identifier: BSD-3-Clause
"""Which transforms a page is sent, and requests that are refused."""
import math

import pytest

from web_transforms.subscription import FASTEST, MOST_FRAMES, Pose, Subscription, angle


def pose(x=0.0, yaw=0.0):
    return Pose((x, 0.0, 0.0), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)))


def names(subscription, poses):
    """The frames that are sent when these transforms are known."""
    return [source for source, _ in subscription.changed(lambda _, source: poses.get(source))]


def test_a_transform_is_sent_at_first_and_then_after_a_change():
    wanted = Subscription(["/base", "hand"], "/odom", 0.1, 0.01, 10.0)
    assert wanted.target == "odom"
    assert names(wanted, {}) == []
    assert names(wanted, {"base": pose()}) == ["base"]
    assert names(wanted, {"base": pose(0.009, 0.09), "hand": pose()}) == ["hand"]
    assert names(wanted, {"base": pose(0.011), "hand": pose()}) == ["base"]
    assert names(wanted, {"base": pose(0.011, 0.11), "hand": pose()}) == ["base"]


def test_small_changes_add_up_until_they_are_sent():
    wanted = Subscription(["base"], "odom", 1.0, 0.01, 10.0)
    sent = [number for number in range(30) if names(wanted, {"base": pose(0.004 * number)})]
    assert sent == list(range(0, 30, 3))


def test_without_a_threshold_all_is_sent_each_time():
    wanted = Subscription(["base"], "odom", 0.0, 0.01, 10.0)
    assert [names(wanted, {"base": pose()}) for _ in range(2)] == [["base"], ["base"]]


def test_the_angle_is_the_shorter_of_two_ways():
    assert angle(pose(yaw=3.0), pose(yaw=-3.0)) == pytest.approx(2.0 * math.pi - 6.0)


def test_a_frame_that_is_named_twice_is_sent_once():
    assert names(Subscription(["base", "/base"], "odom", 1.0, 1.0, 10.0), {"base": pose()}) == ["base"]


def test_a_high_rate_is_limited():
    assert Subscription(["base"], "odom", 1.0, 1.0, 1e9).period == 1.0 / FASTEST


@pytest.mark.parametrize("changes, words", [
    ({"sources": ["a"] * (MOST_FRAMES + 1)}, "source_frames"), ({"sources": [""]}, "frame ''"),
    ({"sources": ["a\0b"]}, "frame"), ({"target": "x" * 2000}, "frame"), ({"rate": 0.0}, "rate is 0"),
    ({"rate": math.nan}, "rate is nan"), ({"angle_threshold": -1.0}, "angular_thres"),
    ({"distance_threshold": math.inf}, "trans_thres")])
def test_what_cannot_be_done_is_refused_with_its_name(changes, words):
    given = dict(sources=["a"], target="b", angle_threshold=1.0, distance_threshold=1.0, rate=1.0)
    given.update(changes)
    with pytest.raises(ValueError, match=words):
        Subscription(**given)
