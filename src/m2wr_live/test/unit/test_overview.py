# SPDX-License-Identifier: BSD-3-Clause
"""Lists of nodes, frames, parameters and controllers."""
from types import SimpleNamespace

import pytest

from m2wr_live.ros.graph import _controllers
from m2wr_live.scene import overview
from m2wr_sim.errors import SimError


def test_nodes_have_their_topics():
    section = overview.nodes_section([("/scan", ["/gazebo"]), ("/rosout", ["/gazebo", "/quiet"])],
                                     [("/scan", ["/bug2"]), ("/cmd_vel", ["/gazebo"])])
    assert section.lines == ((0, "/bug2"), (1, "reads /scan"), (0, "/gazebo"), (1, "publishes /scan"),
                             (1, "reads /cmd_vel"), (0, "/quiet"))


def test_frames_are_a_tree():
    section = overview.frames_section({"odom": "map", "base": "odom", "wheel": "base", "laser": "base", "b": "a"})
    assert section.lines == ((0, "a"), (1, "b"), (0, "map"), (1, "odom"), (2, "base"), (3, "laser"), (3, "wheel"))


def test_a_loop_of_frames_is_told_and_ends():
    section = overview.frames_section({"a": "b", "b": "a", "c": "map"})
    assert section.lines == ((0, "map"), (1, "c"), (0, "a: its parents form a loop"), (0, "b: its parents form a loop"))


def test_parameters_are_values_of_nodes():
    section = overview.parameters_section({"/planner": {"rate": 5.0, "use": True, "inner": {"a": 1}}, "/a": {}})
    assert section.lines == ((0, "/a"), (0, "/planner"), (1, "rate = 5.0"), (1, "use = True"))


def test_controllers_are_those_of_managers_that_answer():
    def ask(name):
        if name.startswith("/gone"):
            raise SimError("it has ended")
        claim = SimpleNamespace(resources=["left", "right"])
        return SimpleNamespace(controller=[SimpleNamespace(
            name="drive", type="diff_drive_controller/DiffDriveController", state="running",
            claimed_resources=[claim])])

    found = _controllers(["/cm", "/gone"], ask)
    assert list(found) == ["/cm"]
    assert overview.controllers_section(found).lines == (
        (0, "/cm"), (1, "drive: running"), (2, "diff_drive_controller/DiffDriveController"), (2, "left"), (2, "right"))


def test_a_manager_without_its_messages_is_left_out():
    def ask(_):
        raise ImportError("no such package")
    assert _controllers(["/cm"], ask) == {}


@pytest.mark.parametrize("count", [overview.MOST_LINES, 100_000])
def test_lists_are_bounded(count):
    section = overview.frames_section({"f%06d" % number + "x" * 500: "map" for number in range(count)})
    assert len(section.lines) == overview.MOST_LINES + 1
    assert section.lines[-1] == (0, "and %d more" % (count + 1 - overview.MOST_LINES))
    assert max(len(text) for _, text in section.lines) == overview.LONGEST


def test_a_deep_chain_of_frames_is_listed():
    section = overview.frames_section({"f%d" % (number + 1): "f%d" % number for number in range(5000)})
    assert section.lines[:2] == ((0, "f0"), (1, "f1"))
    assert "padding-left:200px" in overview.html_of([section])


def test_a_name_with_markup_is_text():
    text = overview.html_of([overview.nodes_section([("/<b>", ["/<script>"])], []), overview.Section("Empty", ())])
    assert "<script>" not in text and "&lt;script&gt;" in text and "<b>" not in text and "Empty" not in text


def test_nothing_is_shown_of_nothing():
    assert overview.html_of([]) == "" == overview.html_of([overview.frames_section({})])
