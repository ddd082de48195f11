"""The README's tables say what the code says."""
import os
import re
from dataclasses import MISSING, fields

from m2wr_sim.plugins.registry import PLUGINS
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
