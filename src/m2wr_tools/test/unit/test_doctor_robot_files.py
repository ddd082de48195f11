# SPDX-License-Identifier: BSD-3-Clause
"""Descriptions are read in a process of its own, with limits."""
import os

from m2wr_tools.doctor import robot_files


def test_a_description_without_end_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(robot_files, "PATIENCE", 0.01)
    assert "takes longer" in robot_files.read_apart("robot", "m2wr", {}, dict(os.environ)).error


def test_a_process_that_fails_is_an_error(tmp_path):
    report = robot_files.read_apart("robot", "m2wr", {}, {"PATH": "/usr/bin"})
    assert report.error and not report.plugins


def test_bad_descriptions_give_the_simulators_words(tmp_path):
    (tmp_path / "a.urdf").write_text("<robot name='a'><link name='b'/></robot>")
    assert "no link has mass" in robot_files.report_on("robot", str(tmp_path / "a.urdf"), {}).error
    assert robot_files.report_on("world", str(tmp_path / "gone.world"), {}).error


def test_a_world_is_reported_with_its_models():
    report = robot_files.report_on("world", "world01", {})
    assert not report.error and not report.left_out
