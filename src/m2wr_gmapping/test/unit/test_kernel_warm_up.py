# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm, and the library has every kernel that Python calls."""
import ast
import importlib
import os

import pytest

from m2wr_gmapping.kernel_warm_up import compile_kernels
from m2wr_node import kernel
from m2wr_node.kernel_progress import kernels

FOLDER = kernel.package_folder(compile_kernels)
LIBRARY = kernel.loaded("m2wr_gmapping", FOLDER)


def compiled():
    return {name: len(getattr(found, "signatures", ())) for name, found in kernels("m2wr_gmapping").items()}


def refuse(self):
    raise AssertionError("%s is called with arguments that the library does not have" % self.py_func.__name__)


def test_warm_up_compiles_every_kernel(mapped, monkeypatch):
    compile_kernels()
    before = compiled()
    assert len(before) > 100
    monkeypatch.setattr(kernel.Kernel, "dispatcher", property(refuse))
    for parameters in (dict(minimumScore=1000.0), dict(compatible=True, laps=0.2), dict(lskip=1)):
        mapper, _, _ = mapped(**dict(dict(laps=1.2), **parameters))
        mapper.finish()
        mapper.occupancy()
        mapper.close()
    assert compiled() == before


def kernel_calls(path):
    """Yield (module, name) of each function of a kernel module that the source of another module calls."""
    with open(path, encoding="utf-8") as stream:
        tree = ast.parse(stream.read())
    imported = {one.asname or one.name: (node.module, one.name) for node in ast.walk(tree)
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("m2wr_gmapping")
                for one in node.names}
    for node in ast.walk(tree):
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Name) and called.id in imported:
            yield imported[called.id]
        elif isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) and called.value.id in imported:
            yield ".".join(imported[called.value.id]), called.attr


@pytest.mark.skipif(LIBRARY is None, reason="no library of kernels; make build makes it")
def test_library_has_every_kernel_that_python_calls():
    sources = [os.path.join(folder, name) for folder, _, files in os.walk(FOLDER) for name in files
               if name.endswith(".py") and not name.endswith("kernels.py")]
    called = {pair for path in sources for pair in kernel_calls(path) if pair[0].endswith("kernels")}
    called = {found for found in (getattr(importlib.import_module(module), name) for module, name in called)
              if isinstance(found, kernel.Kernel)}
    assert len(called) > 40
    assert not [found for found in called if kernel.name_in_package(found.py_func) not in LIBRARY]
