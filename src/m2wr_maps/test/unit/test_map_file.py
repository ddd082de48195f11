# SPDX-License-Identifier: BSD-3-Clause
"""Map files: their bytes, and that an older map survives whatever goes wrong."""
import errno
import os
import tempfile

import numpy as np
import pytest
import yaml

from m2wr_maps import map_file

DATA = np.array([[-1, 0, 100], [25, 26, 65]], np.int8)


def test_picture_has_three_grey_levels_and_the_top_row_first():
    assert map_file.picture(DATA).tolist() == [[254, 205, 0], [205, 254, 0]]


def test_map_server_reads_the_files(tmp_path):
    name = str(tmp_path / "plan")
    paths = map_file.save(name, DATA, 0.05, [-1.0, 2.0, 0.0])
    assert paths == [name + ".pgm", name + ".yaml"]
    content = (tmp_path / "plan.pgm").read_bytes()
    assert content.startswith(b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n3 2\n255\n") and len(content) == 48 + 6
    described = yaml.safe_load((tmp_path / "plan.yaml").read_text())
    assert described == dict(image="plan.pgm", resolution=0.05, origin=[-1.0, 2.0, 0.0], negate=0, occupied_thresh=0.65,
                             free_thresh=0.196)


@pytest.mark.parametrize("fault", ["mkstemp", "fsync"])
def test_full_disk_keeps_the_old_map(tmp_path, monkeypatch, fault):
    name = str(tmp_path / "plan")
    map_file.save(name, DATA, 0.05, [0.0, 0.0, 0.0])
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile if fault == "mkstemp" else os, fault, full)
    with pytest.raises(map_file.MapFileError, match="No space left.*is kept"):
        map_file.save(name, DATA + 1, 0.1, [0.0, 0.0, 0.0])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_missing_folder_is_named(tmp_path):
    with pytest.raises(map_file.MapFileError, match="nowhere"):
        map_file.save(str(tmp_path / "nowhere" / "plan"), DATA, 0.05, [0.0, 0.0, 0.0])


@pytest.mark.parametrize("arguments, words", [
    (dict(free=70, occupied=65), "thresholds"), (dict(data=np.zeros((0, 3))), "shape"),
    (dict(resolution=0.0), "resolution"), (dict(name=""), "name"), (dict(name="/tmp/"), "name")])
def test_invalid_arguments_are_refused(tmp_path, arguments, words):
    values = dict(name=str(tmp_path / "plan"), data=DATA, resolution=0.05, origin=[0.0, 0.0, 0.0])
    values.update(arguments)
    with pytest.raises(ValueError, match=words):
        map_file.save(**values)
    assert not list(tmp_path.iterdir())
