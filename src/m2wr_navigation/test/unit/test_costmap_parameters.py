# SPDX-License-Identifier: BSD-3-Clause
"""Parameter files of all layouts give the same layers; what has no effect is named."""
import pytest

from m2wr_navigation.costmap.costmap_parameters import (
    COSTMAP_PARAMETERS,
    footprint_of,
    layer_settings,
    size_fault,
    source_settings,
    unknown_names,
)
from m2wr_navigation.parameters import read

SCAN = {"sensor_frame": "base_scan", "data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True}
OLD = {"static_map": True, "obstacle_range": 3.0, "raytrace_range": 3.5, "inflation_radius": 1.0,
       "cost_scaling_factor": 3.0, "observation_sources": "scan", "scan": SCAN, "map_type": "costmap"}
NEW = {"plugins": [{"name": "static", "type": "costmap_2d::StaticLayer"},
                   {"name": "obstacles_layer", "type": "costmap_2d::ObstacleLayer"},
                   {"name": "inflater_layer", "type": "costmap_2d::InflationLayer"}],
       "obstacles_layer": {"observation_sources": "scan", "scan": SCAN, "obstacle_range": 3.0, "raytrace_range": 3.5},
       "inflater_layer": {"inflation_radius": 0.3}, "static_map": True}


def by_name(given):
    layers, warnings = layer_settings(given, "~map")
    return {layer.name: layer for layer in layers}, warnings


def test_the_layout_before_2014_becomes_three_layers():
    layers, warnings = by_name(OLD)
    assert list(layers) == ["static_layer", "obstacle_layer", "inflation_layer"] and not warnings
    assert layers["inflation_layer"].given == {"inflation_radius": 1.0, "cost_scaling_factor": 3.0}
    sources, warnings = source_settings(layers["obstacle_layer"], "~map")
    assert not warnings and sources["scan"]["topic"] == "scan" and sources["scan"]["raytrace_range"] == 3.5
    assert "static_layer" not in by_name(dict(OLD, static_map=False))[0]


def test_a_list_of_plugins_gives_the_layers_and_their_names():
    layers, warnings = by_name(NEW)
    assert [layer.kind for layer in layers.values()] == [entry["type"] for entry in NEW["plugins"]]
    assert layers["inflater_layer"].given == {"inflation_radius": 0.3}
    assert warnings == ["parameter ~map/static_map has no effect beside plugins"]
    assert source_settings(layers["obstacles_layer"], "~map")[0]["scan"]["obstacle_range"] == 3.0


def test_parameters_beside_plugins_count_for_their_layers():
    layers, _ = by_name(dict(NEW, inflation_radius=0.9, cost_scaling_factor=2.0))
    assert layers["inflater_layer"].given == {"inflation_radius": 0.3, "cost_scaling_factor": 2.0}


def test_a_source_beside_the_layer_beats_a_written_one():
    """The node writes the values of each source below its layer, where the next start of the node finds them."""
    layers, _ = by_name(dict(OLD, obstacle_layer={"scan": dict(SCAN, topic="before"), "enabled": False}))
    assert layers["obstacle_layer"].given["scan"]["topic"] == "scan"
    assert layers["obstacle_layer"].given["enabled"] is False


def test_old_files_give_their_heights_to_the_voxel_layer():
    heights = {"origin_z": 0.1, "z_resolution": 0.1, "z_voxels": 8, "unknown_threshold": 4, "mark_threshold": 1,
               "publish_voxel_map": True}
    given = dict(OLD, map_type="voxel", obstacle_layer={"mark_threshold": 2}, **heights)
    layers, warnings = by_name(given)
    assert layers["obstacle_layer"].kind == "costmap_2d::VoxelLayer" and not warnings
    assert {name: layers["obstacle_layer"].given[name] for name in heights} == dict(heights, mark_threshold=2)
    assert unknown_names(given, list(layers.values()), "~map") == []
    flat = dict(given, map_type="costmap")
    assert not set(by_name(flat)[0]["obstacle_layer"].given) & (set(heights) - {"mark_threshold"})
    assert unknown_names(flat, list(by_name(flat)[0].values()), "~map") == [
        "parameter ~map/obstacle_layer/mark_threshold has no effect"]


@pytest.mark.parametrize("plugins", ["static", [{"name": "a"}], [3], [{"name": 1, "type": "x"}]])
def test_malformed_plugins_are_named(plugins):
    layers, warnings = layer_settings({"plugins": plugins}, "~map")
    assert not layers and (plugins == "static" or "expected a name and a type" in warnings[0])


@pytest.mark.parametrize("change, sentence", [
    (dict(data_type="Range"), "expected LaserScan, PointCloud or PointCloud2; the source is not used"),
    (dict(raytrace_range=1.0, obstacle_range=2.5), "obstacles between stay for ever"),
    (dict(marking="yes"), "expected true or false"), (dict(clering=True), "did you mean clearing?")])
def test_settings_of_a_source_that_do_not_work_are_named(change, sentence):
    layers, _ = by_name(dict(NEW, obstacles_layer={"observation_sources": "scan", "scan": dict(SCAN, **change)}))
    assert any(sentence in warning for warning in source_settings(layers["obstacles_layer"], "~map")[1])


def test_a_source_without_parameters_is_named():
    layers, _ = by_name(dict(NEW, obstacles_layer={"observation_sources": "scan bump"}))
    sources, warnings = source_settings(layers["obstacles_layer"], "~map")
    assert sources == {} and "~map/obstacles_layer/bump has no parameters" in " ".join(warnings)


def test_names_without_effect_are_told_with_the_nearest_one():
    given = dict(NEW, updte_frequency=3.0, inflater_layer={"inflation_radios": 0.3})
    sentences = unknown_names(given, layer_settings(given, "~map")[0], "~map")
    assert sentences == ["parameter ~map/updte_frequency has no effect; did you mean update_frequency?",
                         "parameter ~map/inflater_layer/inflation_radios has no effect; did you mean inflation_radius?"]


def test_names_of_files_in_use_cause_no_warning():
    for given in (OLD, NEW):
        assert unknown_names(given, layer_settings(given, "~map")[0], "~map") == []


@pytest.mark.parametrize("outline, corners, fault", [
    ("[]", 16, ""), ([], 16, ""), ([[-0.1, -0.1], [0.2, -0.1], [0.0, 0.3]], 3, ""), ([[0, 0], [1, 1]], 16, "2 corners"),
    ("[[-0.1,-0.1],[0.2,-0.1],[0.0,0.3]]", 3, "")])
def test_a_footprint_is_read_or_replaced_by_the_circle(outline, corners, fault):
    values = read(COSTMAP_PARAMETERS, {"robot_radius": 0.3}, "~map")[0]
    found, said = footprint_of({"footprint": outline}, values)
    assert len(found) == corners and fault in said and bool(said) == bool(fault)


def test_a_size_beyond_memory_is_refused():
    values = read(COSTMAP_PARAMETERS, {"width": 50000.0, "height": 50000.0, "resolution": 0.01}, "~map")[0]
    assert "expected at most" in size_fault(values)
    assert size_fault(read(COSTMAP_PARAMETERS, {"width": 40.0}, "~map")[0]) == ""
