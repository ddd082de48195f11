# SPDX-License-Identifier: BSD-3-Clause
"""Progress of compilation: names and counts, from what numba has compiled."""
import threading

import pytest

from m2wr_node.kernel_progress import KernelProgress, kernels


class Stats:
    def __init__(self, misses):
        self.cache_misses = misses


class Kernel:
    """A function that numba compiles, or has read from its cache."""

    def __init__(self):
        self.overloads, self.stats = {}, Stats({})

    def compile(self, from_cache=False):
        self.stats = Stats({} if from_cache else {"int": 1})
        self.overloads["int"] = True


def test_each_newly_compiled_kernel_is_counted_and_named():
    watched = {name: Kernel() for name in ("first", "second", "third")}
    said, heard = [], threading.Event()

    def say(line):
        said.append(line)
        heard.set()

    with KernelProgress("thing", say, watched, interval=0.01):
        for name in ("first", "second"):
            heard.clear()
            watched[name].compile()
            assert heard.wait(10.0)
            assert said[-1].endswith("of 3 kernels compiled: " + name)
        watched["third"].compile(from_cache=True)
    assert said[0].startswith("thing: 1 of 3") and said[1].startswith("thing: 2 of 3")
    assert said[-1] == "thing: 3 kernels ready, 2 of them compiled now"


def test_long_work_on_one_kernel_is_not_silence():
    said, heard = [], threading.Event()
    with KernelProgress("thing", lambda line: (said.append(line), heard.set()), {"first": Kernel()}, interval=0.01):
        assert heard.wait(10.0)
    assert said[0] == "thing: 0 of 1 kernels compiled, still compiling"


def test_an_error_in_the_body_passes_without_a_word_of_success():
    said = []
    with pytest.raises(ZeroDivisionError):
        with KernelProgress("thing", said.append, {"first": Kernel()}):
            raise ZeroDivisionError
    assert said == []


def test_kernels_of_a_package_are_those_in_its_kernel_modules(tmp_path, monkeypatch):
    folder = tmp_path / "made_up" / "inner"
    folder.mkdir(parents=True)
    (tmp_path / "made_up" / "__init__.py").write_text("")
    (folder / "__init__.py").write_text("")
    (folder / "some_kernels.py").write_text("""
class Kernel:
    def __init__(self, function):
        self.py_func, self.overloads = function, {}

@Kernel
def one():
    pass

def plain():
    pass
""")
    (folder / "other.py").write_text("raise RuntimeError('not to be imported')")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert list(kernels("made_up")) == ["inner.some_kernels.one"]
