# SPDX-License-Identifier: BSD-3-Clause
"""The libraries of compiled kernels have every kernel that Python calls, so that a node does not import numba."""
import ast
import importlib
import json
import os
import subprocess
import sys

import pytest

from m2wr_node import kernel
from m2wr_node.kernel_progress import kernels

PACKAGES = ("m2wr_maps", "m2wr_gmapping", "m2wr_navigation", "m2wr_exploration", "m2wr_elevation")


def kernel_calls(path):
    """Yield (module, name) of each imported function that the source of a module calls."""
    with open(path, encoding="utf-8") as stream:
        tree = ast.parse(stream.read())
    imported = {one.asname or one.name: (node.module, one.name) for node in ast.walk(tree)
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("m2wr_") for one in node.names}
    for node in ast.walk(tree):
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Name) and called.id in imported:
            yield imported[called.id]
        elif isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) and called.value.id in imported:
            yield ".".join(imported[called.value.id]), called.attr


def called_kernels(folder):
    """Return the kernels that the other modules of a package call."""
    sources = [os.path.join(place, name) for place, _, files in os.walk(folder) for name in files
               if name.endswith(".py") and not name.endswith("kernels.py")]
    called = {pair for path in sources for pair in kernel_calls(path) if pair[0].endswith("kernels")}
    found = {getattr(importlib.import_module(module), name) for module, name in called}
    return {one for one in found if isinstance(one, kernel.Kernel)}


def described(package):
    """Return a package's folder, and the names of the kernels that its library has, or leaves out for their types."""
    folder = kernel.package_folder(next(iter(kernels(package).values())).py_func)
    if kernel.loaded(folder) is None:
        pytest.skip("no library of kernels that fits the sources; make build makes it")
    with open(kernel.paths(folder)[1]) as stream:
        about = json.load(stream)
    return folder, set(about["kernels"]) | set(about["left_out"])


@pytest.mark.parametrize("package", PACKAGES)
def test_library_has_every_kernel_that_python_calls(package):
    called = called_kernels(described(package)[0])
    names = {one: described(one)[1] for one in PACKAGES}
    assert len(called) > 2
    assert sorted(kernel.name_in_package(one.py_func) for one in called
                  if kernel.name_in_package(one.py_func) not in names[one.__module__.split(".")[0]]) == []


@pytest.mark.parametrize("planner, numba", [("NavfnROS", False), ("GlobalPlanner", False), ("RRT", True)])
def test_move_base_loads_numba_for_few_planners_only(planner, numba):
    """Before: for all, because its warm-up called every planner."""
    described("m2wr_navigation")
    code = ("import sys\nfrom m2wr_navigation import kernel_warm_up as warm_up, registry\n"
            "warm_up.compile_controller_kernels()\nwarm_up.compile_costmap_kernels()\n"
            "warm_up.compile_planner_kernels(registry.find(registry.PLANNERS, {!r}))\n"
            "print('numba' in sys.modules)".format(planner))
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, universal_newlines=True, check=True,
                          timeout=120)
    assert done.stdout.split() == [str(numba)]
