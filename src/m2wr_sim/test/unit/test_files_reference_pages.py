# SPDX-License-Identifier: BSD-3-Clause
"""The tables in docs/reference agree with the code."""
import os
import re

from m2wr_sim.model.sdf import elements as sdf_elements
from m2wr_sim.model.urdf import gazebo_tags
from m2wr_sim.plugins.registry import PLUGINS
from m2wr_sim.ros.gazebo_services.table import SERVICES

_PAGES = os.path.join(os.path.dirname(__file__), "..", "..", "..", "..", "docs", "reference")


def _text(name):
    with open(os.path.join(_PAGES, name), encoding="utf-8") as stream:
        return stream.read()


def test_every_service_is_in_the_table():
    listed = re.findall(r"^\| `(\w+)` \|", _text("services.md"), re.M)
    assert listed == sorted(list(SERVICES) + ["get_loggers", "set_logger_level", "set_parameters"])


def test_the_table_of_sdf_is_the_codes_own():
    assert "\n".join(sdf_elements.table()) in _text("sdf.md")


def test_every_tag_of_gazebo_blocks_is_in_the_table():
    listed = set(re.findall(r"`<?(\w+)>?`", _text("urdf.md")))
    known = (gazebo_tags._COLLISION_TAGS | gazebo_tags._LINK_TAGS | gazebo_tags._LINK_BLOBS | gazebo_tags._LINK_QUIET
             | gazebo_tags._JOINT_TAGS | gazebo_tags._JOINT_QUIET | gazebo_tags._MODEL_TAGS | gazebo_tags._MODEL_QUIET)
    assert known <= listed


def test_every_tag_and_attribute_of_urdf_is_in_the_table():
    text = _text("urdf.md")
    assert {"floating", "planar"} <= set(re.findall(r"`(\w+)`", text))
    for tag in ("inertial", "limit", "dynamics", "axis", "mimic", "origin", "surface"):
        assert "<%s" % tag in text, tag


def test_every_plugin_is_in_the_table():
    listed = set(re.findall(r"`(lib\w+\.so)`", _text("plugins.md")))
    assert listed == set(PLUGINS)
