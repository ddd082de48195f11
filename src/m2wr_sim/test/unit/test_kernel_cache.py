"""Compiled kernels on disk are dropped when any module beside them has changed."""
import os

import pytest

from m2wr_sim import kernel_cache


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "numbers.py").write_text("SIZE = 3\n")
    (tmp_path / "kernels.py").write_text("from numbers import SIZE\n")
    kernel_cache.refresh(str(tmp_path / "__init__.py"))
    return tmp_path


def fill(folder):
    for name in ("kernels.run-7.py311.nbi", "kernels.run-7.py311.1.nbc", "kernels.cpython-311.pyc"):
        (folder / "__pycache__" / name).write_bytes(b"x")


def cached(folder):
    return sorted(name for name in os.listdir(str(folder / "__pycache__")) if name.startswith("kernels.run"))


def test_caches_stay_while_nothing_changes(folder):
    fill(folder)
    kernel_cache.refresh(str(folder / "__init__.py"))
    assert len(cached(folder)) == 2


@pytest.mark.parametrize("name, text", [("numbers.py", "SIZE = 4\n"), ("more.py", "")])
def test_a_change_beside_the_kernels_drops_them_and_only_them(folder, name, text):
    fill(folder)
    (folder / name).write_text(text)
    kernel_cache.refresh(str(folder / "__init__.py"))
    assert cached(folder) == []
    assert (folder / "__pycache__" / "kernels.cpython-311.pyc").exists()
    fill(folder)
    kernel_cache.refresh(str(folder / "__init__.py"))
    assert len(cached(folder)) == 2


def test_a_folder_that_cannot_be_read_is_left_alone(tmp_path):
    kernel_cache.refresh(str(tmp_path / "nowhere" / "__init__.py"))
    assert not (tmp_path / "nowhere").exists()
