# SPDX-License-Identifier: BSD-3-Clause
"""Parameters as robots write them, and those that cannot be used."""
import math

import pytest

from sensor_fusion.settings import SettingsError, read

CONFIG = [False] * 6 + [True, True, False] + [False] * 2 + [True] + [False] * 3
GOOD = {"odom0": "wheels/odom", "odom0_config": CONFIG}


def test_defaults_are_those_of_the_original():
    found = read(GOOD)
    assert (found.frequency, found.sensor_timeout, found.world_frame) == (30.0, 1.0 / 30.0, "odom")
    assert found.publish_tf and not found.two_d_mode and found.process_noise is None and not found.warnings
    topic, = found.topics
    assert (topic.kind, topic.topic, topic.queue) == ("odom", "wheels/odom", 10)
    assert topic.settings.pose_threshold == math.inf


def test_matrices_may_be_given_as_diagonal():
    whole = [0.0] * 225
    whole[16] = "1e-2"
    found = read(dict(GOOD, process_noise_covariance=whole, initial_estimate_covariance=[1] * 15))
    assert found.process_noise[1, 1] == 0.01 and found.initial[3, 3] == 1.0 and found.initial[3, 2] == 0.0


def test_frames_lose_the_slash_and_topics_keep_it():
    found = read(dict(GOOD, odom_frame="/odom", world_frame="/odom", odom0="/odom"))
    assert found.world_frame == "odom" and found.topics[0].topic == "/odom"


@pytest.mark.parametrize("change, words", [
    ({"odom0_config": CONFIG[:14]}, "15 truth values"), ({"frequency": 0}, "frequency is 0"),
    ({"frequency": True}, "frequency is True"), ({"world_frame": "earth"}, "expected the map_frame"),
    ({"base_link_frame": "odom"}, "expected three names"), ({"two_d_mode": "yes"}, "true or false"),
    ({"process_noise_covariance": [1.0] * 14}, "14 entries"), ({"process_noise_covariance": "x"}, "'x'"),
    ({"initial_estimate_covariance": [-1.0] * 15}, "negative variance"), ({"odom0_queue_size": 0}, "queue_size"),
    ({"odom0": 5}, "odom0 is 5"), ({"process_noise_covariance": [math.nan] * 15}, "expected 225 numbers")])
def test_bad_values_are_named(change, words):
    with pytest.raises(SettingsError, match=words):
        read(dict(GOOD, **change))


def test_no_sensor_is_an_error():
    with pytest.raises(SettingsError, match="there is no sensor"):
        read({})


def test_what_has_no_effect_is_reported():
    found = read(dict(GOOD, use_control=True, frequncy=5, odom0_differential=True, odom0_relative=True, debug=False,
                      imu0="imu", imu0_config=[False] * 15))
    text = "\n".join(found.warnings)
    assert "use_control is not supported" in text and "frequncy is no parameter" in text
    assert "relative has no effect" in text and "imu0 has all" in text and len(found.warnings) == 4
