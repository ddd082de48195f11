# SPDX-License-Identifier: BSD-3-Clause
"""What the programs become."""
import pytest

from m2wr_nodelet import programs


class Became(Exception):
    """The process would be another one now."""


@pytest.fixture(autouse=True)
def processes(monkeypatch):
    def become(path, command):
        raise Became(path, command)
    monkeypatch.setattr(programs.os, "execv", become)


def test_a_nodelet_with_a_stand_in_becomes_the_node():
    with pytest.raises(Became) as caught:
        programs.nodelet(["nodelet", "load", "depthimage_to_laserscan/DepthImageToLaserScanNodelet", "manager",
                          "scan:=/s", "__name:=eyes"])
    path, command = caught.value.args
    assert path.endswith("/depthimage_to_laserscan") and command == [path, "scan:=/s", "__name:=eyes"]


@pytest.mark.parametrize("words", [["manager"], ["load", "gone_package/Class", "manager", "a:=b"], []])
def test_all_else_becomes_the_systems_program(monkeypatch, words):
    monkeypatch.setattr(programs, "system_program", lambda name, own, environ: "/system/" + name)
    with pytest.raises(Became) as caught:
        programs.nodelet(["nodelet"] + words)
    assert caught.value.args == ("/system/nodelet", ["/system/nodelet"] + words)


def test_a_program_that_is_not_installed_is_named(monkeypatch, capsys):
    monkeypatch.setattr(programs, "system_program", lambda name, own, environ: None)
    assert programs.forward("list_nodelets", ["list_nodelets"]) == 1
    assert "list_nodelets of the package nodelet is not installed" in capsys.readouterr().err


def test_a_node_that_is_not_built_is_named(monkeypatch, capsys):
    monkeypatch.setattr(programs.roslib.packages, "find_node", lambda package, node, packages: [])
    assert programs.nodelet(["nodelet", "standalone", "depthimage_to_laserscan/DepthImageToLaserScanNodelet"]) == 1
    assert "not built" in capsys.readouterr().err


def test_a_program_that_cannot_start_is_named(monkeypatch, capsys):
    def refuse(path, command):
        raise PermissionError(13, "Permission denied")
    monkeypatch.setattr(programs.os, "execv", refuse)
    monkeypatch.setattr(programs, "system_program", lambda name, own, environ: "/system/" + name)
    assert programs.forward("nodelet", ["nodelet"]) == 1
    assert "/system/nodelet cannot be started" in capsys.readouterr().err
