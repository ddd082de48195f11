# SPDX-License-Identifier: BSD-3-Clause
"""The wheel of the simulator: complete, and usable in a virtual environment without ROS."""
import filecmp
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import zipfile

import pytest

from workspace_tree import ROOT

#: What the wheel asks for, and what that needs itself; nothing of ROS but rospkg, which is on the package index.
MODULES = ("numpy", "numba", "llvmlite", "lxml", "yaml", "rospkg", "catkin_pkg", "distro", "urdf_parser_py", "xacro",
           "pyparsing", "dateutil", "docutils", "six", "importlib_metadata", "zipp", "pkg_resources")
COMPILE = """
import numpy as np
from m2wr_sim.rendering.output_kernels import metres
out = np.zeros(2, np.float32)
metres(out, np.array([0.5, 2.0], np.float32), 0.1, 8.0)
print(out.tolist())
"""
DRIVE = """
from m2wr_sim import messages
from m2wr_sim.api import Sim
with Sim("world02", "m2wr", pose=(0.0, 8.0, 0.0), seed=1) as sim:
    now = sim.step((0.5, 0.2), 2.0)
    print(messages.WITH_ROS, messages.__file__)
    print(repr((now.pose, now.odometry, now.scan.ranges.tolist(), now.time)))
"""


def run(*words, **options):
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=200,
                          check=False, **options)
    assert done.returncode == 0, done.stdout
    return done.stdout


def take_compiled_kernels(site):
    """Copy what numba has compiled in the workspace to modules that are the same in the wheel.

    numba finds it by the date of a module. Without it the drive compiles its kernels, which takes a minute.
    """
    for package in ("m2wr_node", "m2wr_sim", "m2wr_view"):
        top = os.path.join(ROOT, "src", package, "src")
        for folder, _, files in os.walk(os.path.join(top, package)):
            target = os.path.join(site, os.path.relpath(folder, top))
            if os.path.basename(folder) == "__pycache__" and os.path.isdir(os.path.dirname(target)):
                os.makedirs(target, exist_ok=True)
                for name in files:
                    if name.endswith((".nbi", ".nbc", ".sha1")):
                        shutil.copy(os.path.join(folder, name), target)
            for name in files:
                here, there = os.path.join(folder, name), os.path.join(target, name)
                if name.endswith(".py") and os.path.exists(there) and filecmp.cmp(here, there, shallow=False):
                    stat = os.stat(here)
                    os.utime(there, ns=(stat.st_atime_ns, stat.st_mtime_ns))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Return the path of the wheel, built from a copy of the sources."""
    setuptools = pytest.importorskip("setuptools")
    if int(setuptools.__version__.split(".")[0]) < 61:
        pytest.skip("setuptools %s cannot read pyproject.toml; version 61 or newer can" % setuptools.__version__)
    top = tmp_path_factory.mktemp("wheel")
    for name in ("m2wr_node", "m2wr_view", "m2wr_sim", "m2wr_description"):
        shutil.copytree(os.path.join(ROOT, "src", name), str(top / "src" / name),
                        ignore=shutil.ignore_patterns("__pycache__", "test"))
    for name in ("pyproject.toml", "LICENSE"):
        shutil.copy(os.path.join(ROOT, name), str(top))
    run(sys.executable, "-c", "from setuptools import build_meta; build_meta.build_wheel('dist')", cwd=str(top))
    found = list((top / "dist").glob("*.whl"))
    assert len(found) == 1
    return str(found[0])


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Return the Python of a virtual environment with the wheel and the modules that it asks for."""
    top = tmp_path_factory.mktemp("empty")
    run(sys.executable, "-m", "venv", "--without-pip", str(top))
    program = str(top / "bin" / "python")
    site = run(program, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    for name in MODULES:
        spec = importlib.util.find_spec(name)
        if spec is not None:
            path = os.path.dirname(spec.origin) if spec.submodule_search_locations else spec.origin
            os.symlink(path, os.path.join(site, os.path.basename(path)))
    with zipfile.ZipFile(wheel) as archive:         # as pip does: modules to the packages, the data to the prefix
        for name in archive.namelist():
            data = re.fullmatch(r"[^/]*\.data/data/(.*)", name)
            target = os.path.join(str(top), data.group(1)) if data else os.path.join(site, name)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            with archive.open(name) as source, open(target, "wb") as stream:
                shutil.copyfileobj(source, stream)
    take_compiled_kernels(site)
    return program


def without_ros():
    """Return the environment without what a shell with ROS sets."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "PYTHON", "CMAKE"))}


class TestWheel:
    def test_it_has_all_modules_without_ros(self, wheel):
        with zipfile.ZipFile(wheel) as archive:
            names = set(archive.namelist())
        top = os.path.join(ROOT, "src", "m2wr_sim", "src")
        expected = {os.path.relpath(os.path.join(folder, name), top)
                    for folder, _, files in os.walk(os.path.join(top, "m2wr_sim")) for name in files
                    if name.endswith(".py") and "/m2wr_sim/ros" not in folder}
        assert len(expected) > 100
        assert expected - names == set()
        assert not [name for name in names if name.startswith("m2wr_sim/ros/")]

    def test_it_has_all_worlds_models_and_the_robot(self, wheel):
        with zipfile.ZipFile(wheel) as archive:
            names = {name.partition(".data/data/share/")[2] for name in archive.namelist()}
        for package, folder in (("m2wr_sim", "worlds"), ("m2wr_sim", "models"), ("m2wr_description", "urdf")):
            top = os.path.join(ROOT, "src", package)
            for path, _, files in os.walk(os.path.join(top, folder)):
                for name in files:
                    assert os.path.join(package, os.path.relpath(os.path.join(path, name), top)) in names

    def test_its_version_is_that_of_the_package(self, wheel):
        with open(os.path.join(ROOT, "src", "m2wr_sim", "package.xml")) as stream:
            version = re.search(r"<version>(.*)</version>", stream.read()).group(1)
        assert os.path.basename(wheel).split("-")[1] == version

    def test_a_drive_without_ros_gives_the_same_numbers(self, python):
        alone = run(python, "-c", DRIVE, env=without_ros()).splitlines()
        here = run(sys.executable, "-c", DRIVE).splitlines()
        assert alone[0].startswith("False " + os.path.dirname(os.path.dirname(python)))
        assert here[0].startswith("True ")
        assert alone[-1] == here[-1]

    def test_numba_compiles_a_kernel_there(self, python, tmp_path):
        said = run(python, "-c", COMPILE, env=dict(without_ros(), NUMBA_CACHE_DIR=str(tmp_path)))
        assert said.strip() == "[0.5, 2.0]"
        assert list(tmp_path.rglob("*metres*.nbc"))

    def test_no_module_of_ros_can_be_imported_there(self, python):
        run(python, "-c", "import importlib.util as u; assert not any(map(u.find_spec, ('rospy', 'genpy', 'roslib')))")
