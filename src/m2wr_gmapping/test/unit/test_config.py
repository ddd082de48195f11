# SPDX-License-Identifier: BSD-3-Clause
"""Parameters: conversion as the C++ client does it, ranges, unknown names."""
import math
import re

import pytest
import yaml

from m2wr_gmapping.config import PARAMETERS, ConfigError, GmappingConfig
from m2wr_node.numbers import number


def test_defaults_equal_those_of_gmapping():
    config = GmappingConfig.from_mapping()
    wanted = dict(throttle_scans=1, base_frame="base_link", map_frame="map", odom_frame="odom",
                  map_update_interval=5.0, transform_publish_period=0.05, tf_delay=0.05, occ_thresh=0.25,
                  maxRange=None, maxUrange=None, sigma=0.05, kernelSize=1, lstep=0.05, astep=0.05, iterations=5,
                  lsigma=0.075, ogain=3.0, lskip=0, minimumScore=0.0, llsamplerange=0.01, llsamplestep=0.01,
                  lasamplerange=0.005, lasamplestep=0.005, srr=0.1, srt=0.2, str=0.1, stt=0.2, linearUpdate=1.0,
                  angularUpdate=0.5, temporalUpdate=-1.0, resampleThreshold=0.5, particles=30, xmin=-100.0,
                  ymin=-100.0, xmax=100.0, ymax=100.0, delta=0.05, compatible=False)
    assert {name: config[name] for name in wanted} == wanted


@pytest.mark.parametrize("name, given, value", [
    ("particles", 29.6, 30), ("particles", 80.0, 80), ("kernelSize", 1.4, 1), ("delta", 1, 1.0),
    ("throttle_scans", 0, 1),
    ("maxUrange", 6, 6.0), ("compatible", 1, True)])
def test_numbers_are_converted(name, given, value):
    found = GmappingConfig.from_mapping({name: given})[name]
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize("name, given", [("particles", "many"), ("delta", None), ("map_frame", 3), ("delta", math.nan),
                                         ("particles", True), ("particles", math.inf)])
def test_values_of_a_wrong_type_keep_the_default(name, given):
    config = GmappingConfig.from_mapping({name: given})
    assert config[name] == PARAMETERS[name].default and config.unusable[0].startswith(name)


@pytest.mark.parametrize("given, words", [
    (dict(delta=0.0), "delta is 0.0; expected 0.001"), (dict(delta=-1), "delta"), (dict(particles=0), "particles is 0"),
    (dict(particles=10001), "particles"), (dict(srr=math.inf), "srr is inf"), (dict(stt=1e10), "stt"),
    (dict(xmin=1, xmax=1), "xmin 1.0 and xmax 1.0"), (dict(ymin=5, ymax=-5), "ymin")])
def test_out_of_range_error_names_the_range(given, words):
    with pytest.raises(ConfigError, match=re.escape(words)):
        GmappingConfig.from_mapping(given)


@pytest.mark.parametrize("text", ["1e-3", "+5E2", "-2e0", "1.5e3", ".5e1", "3.e2"])
def test_numbers_in_yaml_strings_are_read(text):
    assert isinstance(yaml.safe_load(text), str)
    assert number(text) == float(text)
    assert GmappingConfig.from_mapping({"minimumScore": text})["minimumScore"] == float(text)


@pytest.mark.parametrize("text", ["5", "e5", ".e5", "1e", "0x1e5", "1e5 m", "", "inf", "1_0e3"])
def test_other_strings_are_not_numbers(text):
    assert number(text) is None and GmappingConfig.from_mapping({"particles": text}).unusable


def test_unknown_names_are_listed():
    config = GmappingConfig.from_mapping(dict(particels=3, inverted_laser=True, particles=10000))
    assert config.unknown == ("particels",) and config["particles"] == 10000


def test_noise_parameters_have_their_places():
    noise = GmappingConfig.from_mapping(dict(srr=1, srt=2, str=3, stt=4)).noise
    assert noise.tolist() == [[1, 3], [2, 4]]


def test_initial_map_with_too_many_cells_is_refused():
    with pytest.raises(ConfigError, match="200000 x 200000 cells of delta 0.001 m; expected at most"):
        GmappingConfig.from_mapping({"delta": 0.001})
    assert GmappingConfig.from_mapping({"delta": 0.01})["delta"] == 0.01


@pytest.mark.parametrize("compatible, effect", [(True, "no scan will be matched"), (False, "half the beams")])
def test_a_score_above_the_number_of_beams_causes_a_warning(compatible, effect):
    config = GmappingConfig.from_mapping({"minimumScore": 90, "lskip": 1, "compatible": compatible})
    assert config.score_warning(182) is None
    warning = config.score_warning(180)
    assert "minimumScore 90 can never be reached" in warning and "90 here" in warning and effect in warning
