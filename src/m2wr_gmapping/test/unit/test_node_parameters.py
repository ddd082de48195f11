# SPDX-License-Identifier: BSD-3-Clause
"""Private parameters of the node; needs no master."""
import pytest
import rospy

from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.ros import node_parameters as params
from m2wr_gmapping.ros.node_parameters import NODE_PARAMETERS, NodeOptions, read_parameters, tf_prefix, with_prefix


def test_node_parameters_are_separated_and_checked():
    config, options, warnings = read_parameters(
        {"particles": 12.0, "save_on_exit": "plan", "scan_queue": "many", "settle_time": 2, "bogus": 1,
         "sigma": "wide"})
    assert config["particles"] == 12
    assert options == NodeOptions(save_on_exit="plan", settle_time=2.0)
    text = "\n".join(warnings)
    assert "scan_queue: 'many'" in text and "~bogus" in text and "sigma: 'wide'" in text
    assert len(warnings) == 3


@pytest.mark.parametrize("given, wanted", [({}, (None, None)), ({"maxRange": 8}, (8.0, None)),
                                           ({"maxUrange": 3.5, "particles": 4}, (None, 3.5)),
                                           ({"maxRange": -1}, (7.0, 6.0)), ({"maxRange": "far"}, (None, None))])
def test_ranges_are_read_at_the_first_scan(monkeypatch, given, wanted):
    monkeypatch.setattr(params, "private_parameters", lambda: given)
    monkeypatch.setattr(params.rospy, "logwarn", lambda *_: None)
    config = params.read_ranges(GmappingConfig.from_mapping({"maxRange": 7, "maxUrange": 6, "particles": 9}))
    assert (config["maxRange"], config["maxUrange"], config["particles"]) == wanted + (9,)


@pytest.mark.parametrize("given, fits", [({}, True), ({"odom_frame": "map"}, False), ({"base_frame": "/odom"}, False),
                                         ({"map_frame": "odom", "odom_frame": "map"}, True),
                                         ({"odom_frame": "/"}, False)])
def test_frames_must_differ(given, fits):
    config = GmappingConfig.from_mapping(given)
    if fits:
        params.check_frames(config)
    else:
        with pytest.raises(ConfigError, match="expected three different frames"):
            params.check_frames(config)


def test_unwritable_save_on_exit_is_reported_at_start(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert not params.save_on_exit_warnings("") and not params.save_on_exit_warnings("~/plan")
    assert "there is no folder" in params.save_on_exit_warnings("~/nowhere/plan")[0]
    monkeypatch.setattr(params.os, "access", lambda *_: False)              # the tests may be root, who may do anything
    assert "may not write into" in params.save_on_exit_warnings("~/plan")[0]


def test_every_node_option_is_documented():
    assert set(NODE_PARAMETERS) == set(NodeOptions.__dataclass_fields__)


@pytest.mark.parametrize("prefix, given, wanted", [
    ("", {}, ("base_link", "odom", "map")), ("r1", {}, ("r1/base_link", "r1/odom", "r1/map")),
    ("r1", {"odom_frame": "/odom", "map_frame": "r1/map"}, ("r1/base_link", "odom", "r1/map")),
    ("a/b", {"base_frame": "a/b/foot"}, ("a/b/foot", "a/b/odom", "a/b/map"))])
def test_frames_get_the_prefix(prefix, given, wanted):
    config = with_prefix(GmappingConfig.from_mapping(given), prefix)
    assert (config["base_frame"], config["odom_frame"], config["map_frame"]) == wanted


@pytest.mark.parametrize("value, wanted", [("/r1/", "r1"), ("r1", "r1"), ("", ""), (3, "")])
def test_the_prefix_is_searched_upwards(monkeypatch, value, wanted):
    monkeypatch.setattr(rospy, "search_param", lambda name: "/robots/" + name)
    monkeypatch.setattr(rospy, "get_param", lambda name: {"/robots/tf_prefix": value}[name])
    assert tf_prefix() == wanted
    monkeypatch.setattr(rospy, "search_param", lambda name: None)
    assert tf_prefix() == ""
