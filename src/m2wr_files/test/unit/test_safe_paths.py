# SPDX-License-Identifier: BSD-3-Clause
"""Restriction of file names from clients to one folder."""
import os

import pytest

from m2wr_files.safe_paths import OutsideError, confined


@pytest.fixture
def folder(tmp_path):
    inner = tmp_path / "states"
    (inner / "sub").mkdir(parents=True)
    (tmp_path / "states_beside").mkdir()
    (tmp_path / "secret").write_text("x")
    (inner / "link").symlink_to(tmp_path / "secret")
    (inner / "out").symlink_to(tmp_path)
    (inner / "kept.state").write_text("x")
    (inner / "inner_link").symlink_to(inner / "kept.state")
    os.mkfifo(str(inner / "pipe"))
    (inner / "device").symlink_to("/dev/zero")
    return inner


@pytest.mark.parametrize("name", ["a.state", "sub/a.state", "kept.state", "inner_link"])
def test_names_inside_the_folder_are_accepted(folder, name):
    assert confined(str(folder), name, "~state_folder").startswith(str(folder.resolve()) + "/")
    assert confined(str(folder), str(folder / name), "~state_folder") == confined(str(folder), name, "~state_folder")


@pytest.mark.parametrize("name", [
    "../secret", "sub/../../secret", "/etc/passwd", "~/a", "~root/a", "link", "out/secret", "pipe", "device", "sub",
    ".", "", "a\0b", "x" * 2000, "x" * 300 + "/y", "kept.state/a", "../states_beside/a", "..", "/"])
def test_names_outside_the_folder_are_refused(folder, name):
    with pytest.raises(OutsideError) as caught:
        confined(str(folder), name, "~state_folder")
    assert str(folder) in str(caught.value) and "~state_folder" in str(caught.value)
    assert len(str(caught.value)) < 500 + len(str(folder))


def test_folder_is_created(tmp_path):
    assert confined(str(tmp_path / "new"), "a", "~p") == str(tmp_path / "new" / "a") and (tmp_path / "new").is_dir()
