# SPDX-License-Identifier: BSD-3-Clause
"""Kernels of a library: same results without numba, and numba for all that the library does not have."""
import json
import os
import shutil
import subprocess
import sys

import pytest

pytest.importorskip("numba", reason="without numba there are no compiled kernels")

KERNELS = '''
import numpy as np
from m2wr_node.kernel import kernel
from robot.factor import FACTOR


@kernel
def scaled(value):
    return FACTOR * value


@kernel
def add_scaled(values, by, out):
    for k in range(values.size):
        out[k] = scaled(values[k]) + by
    return out.sum(), values.size


@kernel
def zeros(count):
    return np.zeros(count)


@kernel
def quotient(a, b):
    return a / b


@kernel
def corner(grid, start):
    return grid[0, 0] + 10.0 * grid[1, 0] + start[0]
'''
WARM_UP = '''
import numpy as np
from robot.some_kernels import add_scaled, corner, quotient, zeros


def compile_kernels():
    add_scaled(np.ones(3), 1.0, np.zeros(3))
    zeros(2)
    quotient(1.0, 2.0)
    corner(np.ones((2, 3)).T, (1, 2))
'''
BEGIN = '''
import logging, sys
import numpy as np
logging.basicConfig(format="%(levelname)s %(message)s")
from robot.some_kernels import add_scaled, corner, quotient, scaled, zeros
'''


def write_package(folder):
    """Write a package with kernels in two modules, and with their warm-up."""
    (folder / "robot").mkdir()
    for file, text in (("__init__", ""), ("factor", "FACTOR = 3.0\n"), ("some_kernels", KERNELS),
                       ("kernel_warm_up", WARM_UP)):
        (folder / "robot" / (file + ".py")).write_text(text)


def run(folder, code, **changes):
    """Run Python code that finds a package in a folder; return what it prints."""
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(folder)] + sys.path), NUMBA_DISABLE_JIT="0",
                       NUMBA_CACHE_DIR=str(folder / "numba"))
    environment.update(changes)
    done = subprocess.run([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True, timeout=300)
    assert done.returncode == 0, done.stdout
    return done.stdout.strip()


def update(folder, **changes):
    """Compile the kernels, then make their library; return what is told."""
    run(folder, "from robot.kernel_warm_up import compile_kernels; compile_kernels()")
    code = "from m2wr_node.kernel_library import update; print(update('robot'))"
    return run(folder, code, **changes)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A package with its library; it is not to be changed."""
    folder = tmp_path_factory.mktemp("made")
    write_package(folder)
    assert update(folder) == "robot: a library of 4 kernels compiled"
    return folder


@pytest.fixture
def copy(made, tmp_path):
    """A copy that may be changed."""
    shutil.copytree(str(made), str(tmp_path / "copy"))
    return tmp_path / "copy"


def call(folder, code, **changes):
    """Return the output of code that imports the kernels, and whether it has imported numba."""
    return run(folder, BEGIN + code + "\nprint('numba' in sys.modules)", **changes).splitlines()


def test_a_library_runs_without_numba(made):
    assert call(made, "print(add_scaled(np.arange(3.0), 0.5, np.zeros(3)), zeros(2))") == [
        "(10.5, 3) [0. 0.]", "False"]


@pytest.mark.parametrize("grid, start, result, imports", [
    ("np.arange(6.0).reshape(2, 3).T", "(1, 2)", 11.0, False), ("np.arange(6.0).reshape(3, 2)", "(1, 2)", 21.0, True),
    ("np.arange(6.0).reshape(2, 3).T", "(1.5, 2)", 11.5, True), ("np.arange(6.0).reshape(2, 3).T", "(1,)", 11.0, True)])
def test_order_of_arrays_and_tuples_are_checked(made, grid, start, result, imports):
    assert call(made, "print(corner(%s, %s))" % (grid, start)) == [str(result), str(imports)]


def test_division_by_zero_is_that_of_numpy(made):
    assert call(made, "print(quotient(1.0, 0.0))") == ["inf", "False"]


def test_the_library_is_made_once(made):
    assert update(made) == "robot: the library of kernels is up to date"


@pytest.mark.parametrize("arguments, result", [
    ("np.arange(6.0)[::2], 0.5, np.zeros(3)", "(19.5, 3)"),                        # not contiguous
    ("np.arange(3, dtype=np.int64), 0.5, np.zeros(3)", "(10.5, 3)"),               # as many bytes, another type
    ("np.arange(3.0), 1, np.zeros(3)", "(12.0, 3)"),
    ("np.frombuffer(np.arange(3.0).tobytes()), 0.5, np.zeros(3)", "(10.5, 3)"),    # not writable
], ids=["strided", "integers", "integer", "read-only"])
def test_numba_compiles_for_other_arguments(made, arguments, result):
    assert call(made, "print(add_scaled(%s))" % arguments) == [result, "True"]


def test_numba_compiles_what_the_warm_up_did_not_call(made):
    assert call(made, "print(scaled(2.0))") == ["6.0", "True"]


def test_too_few_arguments_are_a_type_error(made):
    out = call(made, "try:\n    quotient(1.0)\nexcept TypeError as error:\n    print('refused')")
    assert out == ["refused", "True"]


@pytest.mark.parametrize("changes, kind", [
    ({"M2WR_KERNEL_LIBRARY": "0"}, "CPUDispatcher"), ({"NUMBA_DISABLE_JIT": "1"}, "function")])
def test_the_environment_switches_the_library_off(made, changes, kind):
    assert call(made, "print(type(zeros).__name__, zeros(2))", **changes) == [kind + " [0. 0.]", "True"]


def test_a_library_of_other_sources_is_not_used(copy):
    (copy / "robot" / "factor.py").write_text("FACTOR = 5.0\n")
    shutil.rmtree(str(copy / "numba"))
    assert call(copy, "print(add_scaled(np.arange(3.0), 0.5, np.zeros(3)))") == ["(16.5, 3)", "True"]
    assert update(copy) == "robot: a library of 4 kernels compiled"
    assert call(copy, "print(add_scaled(np.arange(3.0), 0.5, np.zeros(3)))") == ["(16.5, 3)", "False"]


def library(folder, suffix):
    cache = folder / "robot" / "__pycache__"
    return cache / [name for name in os.listdir(str(cache)) if "compiled" in name and name.endswith(suffix)][0]


def broken_library(folder):
    library(folder, ".so").write_bytes(b"no library")


def broken_description(folder):
    library(folder, ".json").write_text("{")


def missing_kernel(folder):
    path = library(folder, ".json")
    about = json.loads(path.read_text())
    about["kernels"]["some_kernels.zeros"][0][0] = "nothing"
    path.write_text(json.dumps(about))


@pytest.mark.parametrize("damage", [broken_library, broken_description, missing_kernel])
def test_a_damaged_library_is_reported_and_not_used(copy, damage):
    damage(copy)
    out = call(copy, "print(zeros(2))")
    assert out[0].startswith("WARNING the compiled kernels ") and "cannot be loaded" in out[0]
    assert out[1:] == ["[0. 0.]", "True"]


def test_a_damaged_library_is_made_again(copy):
    broken_library(copy)
    assert update(copy).endswith("robot: a library of 4 kernels compiled")
    assert call(copy, "print(zeros(2))") == ["[0. 0.]", "False"]


@pytest.mark.parametrize("start, compiler, reason", [
    ("import sys; sys.modules['numba.pycc'] = None", "cc", "this numba has no ahead-of-time compiler"),
    ("", "/nowhere/cc", "")], ids=["numba", "C"])
def test_without_a_compiler_the_reason_is_told(tmp_path, start, compiler, reason):
    write_package(tmp_path)
    (tmp_path / "sitecustomize.py").write_text(start)
    told = update(tmp_path, CC=compiler)
    assert told.startswith("robot: no library of kernels, numba compiles at run time: " + reason)
    assert not [name for name in os.listdir(str(tmp_path / "robot" / "__pycache__")) if "compiled" in name]
