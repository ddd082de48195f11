# SPDX-License-Identifier: BSD-3-Clause
"""The set-up starts only on a known platform; its refusal names the platform found and the supported ones."""
import os
import subprocess

import pytest

import workspace_tree as tree

DETECT = 'source "$1/tools/common.sh"; detect_platform; echo "platform=$PLATFORM"'


def detect(tmp_path, os_release, noetic=False):
    """Run the platform check on a made-up os-release file; returns the finished process."""
    path = tmp_path / "os-release"
    if os_release is not None:
        path.write_text(os_release)
    prefix = tmp_path / "noetic"
    if noetic:
        prefix.mkdir()
        (prefix / "setup.bash").write_text("")
    environment = dict(os.environ, M2WR_OS_RELEASE=str(path), M2WR_NOETIC_PREFIX=str(prefix))
    return subprocess.run(["bash", "-c", DETECT, "bash", tree.ROOT], env=environment, universal_newlines=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=30)


def test_debian_12_is_known(tmp_path):
    done = detect(tmp_path, 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\nVERSION_ID="12"\nID=debian\n')
    assert (done.returncode, done.stdout.strip()) == (0, "platform=debian12")


def test_focal_with_noetic_is_known(tmp_path):
    done = detect(tmp_path, 'ID=ubuntu\nID_LIKE=debian\nVERSION_ID="20.04"\n', noetic=True)
    assert (done.returncode, done.stdout.strip()) == (0, "platform=noetic")


def test_focal_without_noetic_gets_installation_advice(tmp_path):
    done = detect(tmp_path, 'ID=ubuntu\nVERSION_ID="20.04"\n')
    assert done.returncode == 1
    assert "ros-noetic-ros-base" in done.stderr and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("os_release, found", [
    ('ID=fedora\nVERSION_ID=40\n', "fedora 40"),
    ('ID=ubuntu\nVERSION_ID="22.04"\n', "ubuntu 22.04"),
    ('ID=debian\nVERSION_ID="11"\n', "debian 11"),
    ('ID=debian\n', "debian no VERSION_ID"),
    ('NAME=nothing\n', "no ID"),
])
def test_other_platforms_are_refused_by_name(tmp_path, os_release, found):
    done = detect(tmp_path, os_release, noetic=True)
    assert done.returncode == 1 and "platform=" not in done.stdout
    assert found in done.stderr and "Debian 12" in done.stderr and "Ubuntu 20.04" in done.stderr


def test_no_os_release_is_refused(tmp_path):
    done = detect(tmp_path, None)
    assert done.returncode == 1 and "cannot read" in done.stderr and "Debian 12" in done.stderr


def test_setup_refuses_before_it_changes_anything(tmp_path):
    path = tmp_path / "os-release"
    path.write_text("ID=arch\n")
    done = subprocess.run(["bash", os.path.join(tree.ROOT, "tools", "setup.sh")], universal_newlines=True, timeout=30,
                          env=dict(os.environ, M2WR_OS_RELEASE=str(path)), stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE)
    assert done.returncode == 1 and "arch" in done.stderr and done.stdout == ""
