# SPDX-License-Identifier: BSD-3-Clause
"""Files are noted with their stamps, and what was read is outdated as soon as one of them differs."""
import os

import pytest

from m2wr_sim.model.source_files import note_file, noted_files, stamp_of, unchanged


def test_a_missing_file_has_no_stamp_and_another_size_another(tmp_path):
    path = tmp_path / "a.txt"
    assert stamp_of(str(path)) is None and stamp_of("nul\0byte") is None
    path.write_text("one")
    first = stamp_of(str(path))
    path.write_text("three")
    assert first is not None and stamp_of(str(path)) != first


@pytest.mark.parametrize("change", [
    lambda path: path.write_text("longer text"), lambda path: os.utime(str(path), ns=(1, 1)),
    lambda path: path.unlink()])
def test_a_changed_file_is_noticed(tmp_path, change):
    path = tmp_path / "a.txt"
    path.write_text("text")
    with noted_files() as stamps:
        note_file(str(path))
    assert unchanged(stamps)
    change(path)
    assert not unchanged(stamps)


def test_a_file_that_appears_is_noticed(tmp_path):
    with noted_files() as stamps:
        note_file(str(tmp_path / "later.txt"))
    assert unchanged(stamps)
    (tmp_path / "later.txt").write_text("here")
    assert not unchanged(stamps)


def test_a_change_during_reading_is_noticed(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with noted_files() as stamps:
        note_file(str(path))
        path.write_text("newer")        # after it was opened
        note_file(str(path))
    assert not unchanged(stamps)


def test_inner_lists_add_to_outer_ones_and_end(tmp_path):
    with noted_files() as outer:
        with noted_files() as inner:
            note_file("a")
        note_file("b")
    note_file("c")
    assert list(outer) == ["a", "b"] and list(inner) == ["a"]
