"""The README's tables say what the code says."""
import os
import re
from dataclasses import MISSING, fields

import pytest

from m2wr_sim.model import gazebo_tags, sdf, sdf_joint, sdf_light, sdf_model, sdf_physics, sdf_sensor, sdf_shapes
from m2wr_sim.plugins.registry import PLUGINS
from m2wr_sim.ros.api_table import SERVICES
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


SDF_TABLE = {
    "world": (sdf._WORLD_READ, sdf._WORLD_SILENT),
    "physics": (sdf_physics._PHYSICS_READ, sdf_physics._PHYSICS_SILENT),
    "ode": (sdf_physics._SOLVER_READ | sdf_physics._CONSTRAINTS_READ, sdf_physics._SOLVER_SILENT),
    "include": (sdf_model._INCLUDE_READ, ()), "model": (sdf_model._MODEL_READ, sdf_model._MODEL_SILENT),
    "link": (sdf_model._LINK_READ, sdf_model._LINK_SILENT), "geometry": (sdf_shapes.READABLE, ()),
    "joint": (sdf_joint._READ, ("sensor", "gearbox_ratio", "gearbox_reference_body", "thread_pitch")),
    "axis": (sdf_joint._AXIS_READ, ("initial_position",)),
    "sensor": (sdf_sensor._SENSOR_READ, sdf_sensor._SENSOR_SILENT),
    "ray": (sdf_sensor._RAY_READ | sdf_sensor._NOISE_READ, ()), "light": (sdf_light._READ, ()),
}


@pytest.mark.parametrize("element", sorted(SDF_TABLE))
def test_every_element_of_sdf_is_in_the_table(element):
    section = _text().split("## SDF")[1].split("\n## ")[0]
    row, = re.findall(r"^\| `<%s>` \| (.*) \|(.*)\|$" % element, section, re.M)
    assert [set(re.findall(r"`(\w+)`", cell)) for cell in row] == [set(names) for names in SDF_TABLE[element]]


def test_every_tag_of_gazebo_blocks_is_in_the_table():
    section = _text().split("## URDF")[1].split("\n## ")[0]
    listed = set(re.findall(r"`<?(\w+)>?`", section))
    known = (gazebo_tags._COLLISION_TAGS | gazebo_tags._LINK_TAGS | gazebo_tags._JOINT_TAGS | gazebo_tags._MODEL_TAGS
             | gazebo_tags._JOINT_SILENT)
    assert known <= listed


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
