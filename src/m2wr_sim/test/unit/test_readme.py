# SPDX-License-Identifier: BSD-3-Clause
"""The README's tables say what the code says."""
import os
import re
from dataclasses import MISSING, fields

from m2wr_sim.model.sdf import elements as sdf_elements
from m2wr_sim.model.urdf import gazebo_tags
from m2wr_sim.plugins.registry import PLUGINS
from m2wr_sim.ros.gazebo_services.table import SERVICES
from m2wr_sim.ros.params import NodeConfig

_README = os.path.join(os.path.dirname(__file__), "..", "..", "README.md")


def _text():
    with open(_README, encoding="utf-8") as stream:
        return stream.read()


def test_parameter_table_equals_the_config():
    rows = dict(re.findall(r"^\| `~(\w+)` \| ([^|]+?) \| ", _text(), re.M))
    helps = dict(re.findall(r"^\| `~(\w+)` \| [^|]+? \| ([^|]+?) \|$", _text(), re.M))
    expected = {}
    for entry in fields(NodeConfig):
        default = entry.default_factory() if entry.default is MISSING else entry.default
        expected[entry.name] = "unset" if default is None else "`%s`" % (default,)
        assert helps.get(entry.name) == entry.metadata["help"], entry.name
    assert rows == expected


def test_every_service_is_in_the_table():
    section = _text().split("## Services")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `(\w+)` \|", section, re.M)
    assert listed == sorted(list(SERVICES) + ["get_loggers", "set_logger_level", "set_parameters"])


def test_the_table_of_sdf_is_the_codes_own():
    section = _text().split("## SDF\n")[1].split("\n## ")[0]
    assert "\n".join(sdf_elements.table()) in section


def test_every_tag_of_gazebo_blocks_is_in_the_table():
    section = _text().split("## URDF")[1].split("\n## ")[0]
    listed = set(re.findall(r"`<?(\w+)>?`", section))
    known = (gazebo_tags._COLLISION_TAGS | gazebo_tags._LINK_TAGS | gazebo_tags._LINK_BLOBS | gazebo_tags._LINK_QUIET
             | gazebo_tags._JOINT_TAGS | gazebo_tags._JOINT_QUIET | gazebo_tags._MODEL_TAGS | gazebo_tags._MODEL_QUIET)
    assert known <= listed


def test_every_tag_and_attribute_of_urdf_is_in_the_table():
    section = _text().split("## URDF")[1].split("\n## ")[0]
    kinds = re.findall(r"`(\w+)`", section)
    assert {"floating", "planar"} <= set(kinds)
    for tag in ("inertial", "limit", "dynamics", "axis", "mimic", "origin", "surface"):
        assert "<%s" % tag in section, tag


def test_every_plugin_is_in_the_table():
    listed = set(re.findall(r"`(lib\w+\.so)`", _text()))
    assert listed == set(PLUGINS)


def test_every_launch_argument_of_bug2_is_in_the_table():
    launch = os.path.join(os.path.dirname(__file__), "..", "..", "launch", "bug2.launch")
    with open(launch, encoding="utf-8") as stream:
        arguments = set(re.findall(r'<arg name="(\w+)" default="[^"]*" doc=', stream.read()))
    section = _text().split("## Launch arguments of bug2.launch")[1].split("\n## ")[0]
    assert arguments and arguments == set(re.findall(r"`(\w+)`", "".join(
        line.split("|")[1] for line in section.splitlines() if line.startswith("| `"))))
