# SPDX-License-Identifier: BSD-3-Clause
"""States of any program: what is written is read again, and another program's files are refused."""
import json
import re
import zipfile

import numpy as np
import pytest

from m2wr_files import state_file
from m2wr_files.state_file import Format, StateError

KIND = Format("walk state", 3, "walker", "walk again")
ARRAYS = {"path": np.arange(6.0).reshape(2, 3), "seen": np.array([True, False]), "none": np.zeros((0, 4), np.int32)}


@pytest.fixture
def path(tmp_path):
    name = str(tmp_path / "a.state")
    state_file.write(name, KIND, {"values": {"steps": 2}}, ARRAYS)
    return name


def test_state_round_trip(path):
    document, arrays = state_file.read(path, KIND)
    assert document == {"format": "walk state", "version": 3, "values": {"steps": 2}}
    assert set(arrays) == set(ARRAYS)
    for name, wanted in ARRAYS.items():
        assert arrays[name].dtype == wanted.dtype and arrays[name].flags.owndata
        np.testing.assert_array_equal(arrays[name], wanted)


def test_numpy_reads_the_arrays_too(path):
    np.testing.assert_array_equal(np.load(path)["path"], ARRAYS["path"])


@pytest.mark.parametrize("kind, words", [
    (Format("run state", 3, "runner", ""), "state.json: expected a state that runner saved"),
    (Format("walk state", 4, "walker", ""), "a state of version 3; this program reads version 4 only")])
def test_state_of_another_kind_is_refused(path, kind, words):
    with pytest.raises(StateError, match=re.escape("{}: {}".format(path, words))):
        state_file.read(path, kind)


@pytest.mark.parametrize("content, words", [
    (b"walk state\n{\"version\": 2}\n", "a state of version 2: it is a pickle.*reads version 3 only: walk again"),
    (b"walk state\n?", "a state of an old version: it is a pickle"),
    (b"text", "begins with b'text'; expected a state that walker saved"),
    (b"PK\3\4", "damaged or cut off: 4 bytes")])
def test_other_content_is_named(tmp_path, content, words):
    (tmp_path / "b.state").write_bytes(content)
    with pytest.raises(StateError, match=words):
        state_file.read(str(tmp_path / "b.state"), KIND)


def test_folder_and_missing_file_are_named(tmp_path):
    with pytest.raises(StateError, match="is no regular file; expected a state that walker saved"):
        state_file.read(str(tmp_path), KIND)
    with pytest.raises(StateError, match="cannot read the state .*No such file"):
        state_file.read(str(tmp_path / "none.state"), KIND)


def test_archive_without_document_is_refused(tmp_path):
    with zipfile.ZipFile(str(tmp_path / "c.state"), "w") as archive:
        archive.writestr("path.npy", b"x" * 100)
    with pytest.raises(StateError, match="no member state.json; expected a state that walker saved"):
        state_file.read(str(tmp_path / "c.state"), KIND)


def test_deep_document_is_refused(tmp_path):
    held = []
    for _ in range(state_file.MOST_DEPTH):
        held = [held]
    with zipfile.ZipFile(str(tmp_path / "d.state"), "w") as archive:
        archive.writestr("state.json", json.dumps({"format": KIND.name, "version": KIND.version, "values": held}))
    with pytest.raises(StateError, match="nested more than"):
        state_file.read(str(tmp_path / "d.state"), KIND)


def test_unwritable_place_is_named(tmp_path):
    with pytest.raises(StateError, match="cannot write the state .*nowhere.*what was there before is kept"):
        state_file.write(str(tmp_path / "nowhere" / "a.state"), KIND, {}, {})
