# SPDX-License-Identifier: BSD-3-Clause
"""Compiled kernels on disk are dropped when any module beside them has changed."""
import os
import subprocess
import sys

import pytest

from m2wr_node import kernel_cache

numba = pytest.importorskip("numba", reason="without numba there are no compiled kernels")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 0)
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


def test_a_changed_value_from_elsewhere_drops_the_kernels(folder):
    for size, kept in ((1, 0), (1, 2), (2, 0)):
        kernel_cache.refresh(str(folder / "__init__.py"), ("kernels.py",), lambda source, size=size: {"SIZE": size})
        assert len(cached(folder)) == kept
        fill(folder)
    (folder / "numbers.py").write_text("# a module that does not count\n")
    kernel_cache.refresh(str(folder / "__init__.py"), ("kernels.py",), lambda source: {"SIZE": 2})
    assert len(cached(folder)) == 2


def test_a_change_of_kernels_elsewhere_drops_the_kernels(folder, tmp_path_factory):
    used = tmp_path_factory.mktemp("elsewhere") / "base_kernels.py"
    for text, kept in (("SIZE = 1", 0), ("SIZE = 1", 2), ("SIZE = 2", 0)):
        used.write_text(text)
        kernel_cache.refresh(str(folder / "__init__.py"), ("kernels.py",), used=(str(used),))
        assert len(cached(folder)) == kept
        fill(folder)


def test_who_cannot_write_where_the_kernels_are_gets_a_copy(folder, tmp_path, monkeypatch):
    fill(folder)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "users"))
    kernel_cache.refresh(str(folder / "__init__.py"))
    elsewhere, = (tmp_path / "users").iterdir()
    assert sorted(path.name for path in elsewhere.iterdir()) == ["kernels.run-7.py311.1.nbc", "kernels.run-7.py311.nbi",
                                                                 "kernels.sha1"]
    for name in cached(folder):         # once only: what the user has compiled since then stays
        (elsewhere / name).write_bytes(b"of the user")
    kernel_cache.refresh(str(folder / "__init__.py"))
    assert {(elsewhere / name).read_bytes() for name in cached(folder)} == {b"of the user"}


def test_kernels_of_other_modules_are_not_copied(folder, tmp_path, monkeypatch):
    fill(folder)
    (folder / "numbers.py").write_text("SIZE = 5\n")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "users"))
    kernel_cache.refresh(str(folder / "__init__.py"))
    elsewhere, = (tmp_path / "users").iterdir()
    assert [path.name for path in elsewhere.iterdir()] == ["kernels.sha1"]


def test_kernels_that_numba_keeps_elsewhere_are_dropped_there(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "users"))     # as where the modules are root's
    kernel_cache.refresh(str(folder / "__init__.py"))
    elsewhere, = (tmp_path / "users").iterdir()
    kernel, other = elsewhere / "kernels.run-7.py311.1.nbc", tmp_path / "users" / "of_another_user.nbc"
    for path in (kernel, other):
        path.write_bytes(b"x")
    kernel_cache.refresh(str(folder / "__init__.py"))
    assert kernel.exists()
    times = (folder / "numbers.py").stat()
    (folder / "numbers.py").write_text("SIZE = 4\n")
    os.utime(str(folder / "numbers.py"), ns=(times.st_atime_ns, times.st_mtime_ns))
    kernel_cache.refresh(str(folder / "__init__.py"))
    assert not kernel.exists() and other.exists()


def test_a_kernel_is_compiled_again_when_a_callee_changes(tmp_path):
    """In separate processes: a stale kernel, which numba itself would use, is not used."""
    package = tmp_path / "work"
    package.mkdir()
    (package / "__init__.py").write_text("from m2wr_node import kernel_cache\nkernel_cache.refresh(__file__)\n")
    (package / "kernels.py").write_text("from numba import njit\nfrom work.inner import inner\n\n\n"
                                        "@njit(cache=True)\ndef outer():\n    return inner()\n")
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(tmp_path)] + sys.path), NUMBA_DISABLE_JIT="0",
                       PYTHONDONTWRITEBYTECODE="1",         # whose dates are whole seconds, and both texts are as long
                       NUMBA_CACHE_DIR=str(tmp_path / "users"))
    for number in (3, 4):
        (package / "inner.py").write_text("from numba import njit\n\n\n@njit(cache=True)\ndef inner():\n"
                                          "    return %d\n" % number)
        told = subprocess.check_output([sys.executable, "-c", "from work.kernels import outer; print(outer())"],
                                       env=environment, timeout=300)
        assert int(told) == number


def test_a_folder_that_cannot_be_read_is_left_alone(tmp_path):
    kernel_cache.refresh(str(tmp_path / "nowhere" / "__init__.py"))
    assert not (tmp_path / "nowhere").exists()
