# SPDX-License-Identifier: BSD-3-Clause
"""Which command lines load a nodelet that has a node in its place, and where the system's program is found."""
import os

import pytest
import rospkg

from m2wr_nodelet.stand_in import Node, node_for, remappings, system_program, wanted

PACKAGE = """<package format="2"><name>eyes</name><version>1.0.0</version><description>d</description>
<maintainer email="a@b.example">a</maintainer><license>BSD-3-Clause</license>
<export><m2wr_nodelet type="eyes/Left" node="left_eye"/><m2wr_nodelet type="eyes/Right" node="right_eye"/></export>
</package>"""


@pytest.fixture
def packages(tmp_path):
    (tmp_path / "eyes").mkdir()
    (tmp_path / "eyes" / "package.xml").write_text(PACKAGE)
    return rospkg.RosPack([str(tmp_path)])


@pytest.mark.parametrize("line, nodelet", [
    ("load eyes/Left manager", "eyes/Left"), ("standalone eyes/Left a:=b", "eyes/Left"),
    ("__name:=n load eyes/Left manager --no-bond image:=/a", "eyes/Left"),
    ("manager", None), ("unload eyes/Left manager", None), ("load eyes", None), ("load", None), ("", None)])
def test_load_and_standalone_want_a_nodelet(line, nodelet):
    assert wanted(line.split()) == nodelet


def test_a_declared_node_stands_in(packages):
    assert node_for("eyes/Left", packages) == Node("eyes", "left_eye")
    assert node_for("eyes/Right", packages) == Node("eyes", "right_eye")


@pytest.mark.parametrize("nodelet", ["eyes/Third", "gone/Left", "eyes/", "/Left"])
def test_other_nodelets_are_left_to_the_system(packages, nodelet):
    assert node_for(nodelet, packages) is None


def test_a_file_that_is_no_xml_is_left_to_the_system(tmp_path):
    (tmp_path / "package.xml").write_text(PACKAGE.replace("</package>", ""))
    assert node_for("eyes/Left", rospkg.RosPack([str(tmp_path)])) is None


def test_the_node_gets_all_remappings():
    line = "load eyes/Left manager image:=/a __name:=left --no-bond"
    assert remappings(line.split()) == ["image:=/a", "__name:=left"]


def program(folder, text):
    path = folder / "lib" / "nodelet" / "nodelet"
    path.parent.mkdir(parents=True)
    path.write_text(text)
    path.chmod(0o755)
    return str(path)


def test_the_systems_program_is_the_first_that_is_not_ours(tmp_path):
    own = program(tmp_path / "own", "#!/usr/bin/python3\nfrom m2wr_nodelet.programs import nodelet\n")
    program(tmp_path / "other", "#!/usr/bin/python3\n# of another build\nfrom m2wr_nodelet.programs import nodelet\n")
    real = program(tmp_path / "real", "\x7fELF m2wr_nodelet")
    prefixes = os.pathsep.join(str(tmp_path / name) for name in ("own", "gone", "other", "real"))
    assert system_program("nodelet", own, {"CMAKE_PREFIX_PATH": prefixes}) == real


def test_without_a_program_of_the_system_there_is_none(tmp_path, monkeypatch):
    monkeypatch.setattr("m2wr_nodelet.stand_in.PREFIXES", ())
    own = program(tmp_path / "own", "#!/bin/sh\n")
    assert system_program("nodelet", own, {"CMAKE_PREFIX_PATH": str(tmp_path / "own")}) is None
    assert system_program("nodelet", own, {}) is None
