# SPDX-License-Identifier: BSD-3-Clause
"""Prints the progress of compiling a package's kernels: how many of how many, and the last one.

numba compiles for minutes on a slow machine and prints nothing.  A thread asks it for its progress, so that no part of
numba has to be replaced, in any version.
"""
from __future__ import annotations

import importlib
import pkgutil
import sys
import threading
from typing import Any, Callable, Dict, List, Optional

from m2wr_node.kernel import name_in_package

_INTERVAL = 1.0         # s between two checks
_QUIET = 15             # checks without progress after which a line says that the work continues


def kernels(package: str) -> Dict[str, Any]:
    """Import all modules of a package whose names end in ``kernels``; return {name: compiled function}."""
    found = {}
    top = importlib.import_module(package)
    for module in pkgutil.walk_packages(top.__path__, package + ".", onerror=lambda name: None):
        if not module.name.endswith("kernels"):
            continue
        for value in vars(importlib.import_module(module.name)).values():
            function = getattr(value, "py_func", None)
            if function is not None and function.__module__.startswith(package + "."):
                found[name_in_package(function)] = value
    return found


class KernelProgress:
    """Watches the kernels of a package while the body of a ``with`` statement calls them.

    Parameters
    ----------
    package : str
        Name of the Python package.
    say : callable
        Takes each line.
    watched : dict, optional
        {name: compiled function}, by default :func:`kernels` of the package.
    interval : float
        Seconds between two looks.
    """

    def __init__(self, package: str, say: Optional[Callable[[str], object]] = None,
                 watched: Optional[Dict[str, Any]] = None, interval: float = _INTERVAL) -> None:
        self._package, self._say, self._interval = package, say or _print, interval
        self._kernels = kernels(package) if watched is None else watched
        self._compiled: List[str] = []
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="kernel progress", daemon=True)

    def __enter__(self) -> KernelProgress:
        self._thread.start()
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        self._done.set()
        self._thread.join()
        self._look()
        if error is None:
            self._say("%s: %d kernels ready, %d of them compiled now" % (
                self._package, len(self._kernels), len(self._compiled)))

    def _look(self) -> List[str]:
        """Return the names of those that were compiled since the last look."""
        news = [name for name, kernel in self._kernels.items()
                if name not in self._compiled and getattr(kernel, "overloads", None) and kernel.stats.cache_misses]
        self._compiled += news
        return news

    def _watch(self) -> None:
        quiet = 0
        while not self._done.wait(self._interval):
            news = self._look()
            quiet = 0 if news else quiet + 1
            if news:
                self._say("%s: %d of %d kernels compiled: %s" % (
                    self._package, len(self._compiled), len(self._kernels), news[-1]))
            elif quiet % _QUIET == 0:
                self._say("%s: %d of %d kernels compiled, still compiling" % (
                    self._package, len(self._compiled), len(self._kernels)))


def _print(line: str) -> None:
    print("   " + line)
    sys.stdout.flush()
