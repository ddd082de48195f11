# SPDX-License-Identifier: BSD-3-Clause
"""Stand-in packages are built only where no real package of their name is found."""
import os
import pathlib
import re
import shutil
import subprocess

import pytest

import workspace_tree as tree

REAL = '<package><name>%s</name><maintainer email="someone@elsewhere.org">s</maintainer></package>'
OWN = '<package><name>%s</name><maintainer email="maintainers@m2wr.example">m</maintainer></package>'


@pytest.fixture
def workspace(tmp_path):
    """A workspace with two stand-ins, an empty system and an empty ROS."""
    (tmp_path / "ws" / "tools").mkdir(parents=True)
    shutil.copy(os.path.join(tree.ROOT, "tools", "dropins.sh"), str(tmp_path / "ws" / "tools"))
    for name in ("xacro", "gazebo_ros"):
        (tmp_path / "ws" / "dropin" / name).mkdir(parents=True)
    return tmp_path


def arrange(workspace, **environment):
    """Run the script; returns the stand-ins that are left out, and its output."""
    environment = dict(os.environ, M2WR_SYSTEM_PREFIX=str(workspace / "usr"), CMAKE_PREFIX_PATH=environment.pop(
        "prefixes", ""), M2WR_NOETIC_PREFIX=str(workspace / "noetic"), **environment)
    done = subprocess.run(["bash", str(workspace / "ws" / "tools" / "dropins.sh")], env=environment, timeout=60,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    assert done.returncode == 0, done.stdout
    left_out = [path.parent.name for path in sorted((workspace / "ws" / "dropin").glob("*/CATKIN_IGNORE"))]
    return left_out, done.stdout


def install(workspace, prefix, name, text=REAL):
    folder = workspace / prefix / "share" / name
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(text % name)


def test_without_real_packages_all_are_built_silently(workspace):
    assert arrange(workspace) == ([], "")


@pytest.mark.parametrize("prefix", ["usr", "noetic"])
def test_a_stand_in_is_built_only_without_the_real_package(workspace, prefix):
    install(workspace, prefix, "xacro")
    left_out, said = arrange(workspace)
    assert left_out == ["xacro"] and "dropin/xacro is left out" in said
    assert arrange(workspace) == (["xacro"], "")
    shutil.rmtree(str(workspace / prefix))
    left_out, said = arrange(workspace)
    assert left_out == [] and "dropin/xacro is built" in said


def test_a_package_in_the_sources_counts_unless_it_is_ignored(workspace):
    folder = workspace / "ws" / "src" / "others" / "the xacro"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(REAL % "xacro")
    own = workspace / "ws" / "src" / "gazebo_ros"
    own.mkdir()
    (own / "package.xml").write_text(OWN % "gazebo_ros")
    left_out, said = arrange(workspace)
    assert left_out == ["xacro"] and "others/the xacro/package.xml" in said
    (workspace / "ws" / "src" / "others" / "CATKIN_IGNORE").write_text("")
    assert arrange(workspace)[0] == []


def test_a_sourced_workspace_counts_whether_installed_or_built(workspace):
    install(workspace, "overlay one", "gazebo_ros")
    source = workspace / "source" / "xacro"
    source.mkdir(parents=True)
    (source / "package.xml").write_text(REAL % "xacro")
    config = workspace / "devel" / "share" / "xacro" / "cmake"
    config.mkdir(parents=True)
    (config / "xacroConfig.cmake").write_text("if(TRUE)\n  set(xacro_SOURCE_PREFIX %s)\nendif()\n" % source)
    prefixes = "%s:%s" % (workspace / "overlay one", workspace / "devel")
    assert arrange(workspace, prefixes=prefixes)[0] == ["gazebo_ros", "xacro"]


def test_our_own_installed_package_is_not_a_real_one(workspace):
    install(workspace, "usr", "gazebo_ros", OWN)
    assert arrange(workspace)[0] == []


def test_a_stand_in_can_be_kept(workspace):
    install(workspace, "usr", "gazebo_ros")
    install(workspace, "usr", "xacro")
    assert arrange(workspace, M2WR_KEEP_DROPINS="other gazebo_ros")[0] == ["xacro"]


def test_the_list_names_each_stand_in_once():
    with open(os.path.join(tree.ROOT, "dropin", "README.md"), encoding="utf-8") as file:
        listed = re.findall(r"^\| \[(\w+)\]\((\w+)/README\.md\) \|", file.read(), re.M)
    folders = [path.parent.name for path in sorted(pathlib.Path(tree.ROOT, "dropin").glob("*/package.xml"))]
    assert sorted(name for name, _ in listed) == folders and all(name == folder for name, folder in listed)
