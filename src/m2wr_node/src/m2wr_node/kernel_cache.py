# SPDX-License-Identifier: BSD-3-Clause
"""Keeps numba's caches on disk up to date.

numba checks only the file that defines a function.  A kernel may also call kernels of another file, or use constants
from there.  After a change of that other file, numba would still load the old compiled kernel.  Therefore all caches of
a folder are deleted when any module in it has changed.

numba also ignores kernels that were compiled during installation if their folder cannot be written.  Each user then
gets a copy, which is faster than compiling again.
"""
from __future__ import annotations

import hashlib
import os
import shutil
from typing import Any, Callable, Dict, Optional, Tuple

from m2wr_node import kernel

_STAMP = "kernels.sha1"


def _nothing(source: str) -> object:
    """Return the same for every source text."""
    return None


def refresh(path: str, endings: Tuple[str, ...] = (".py",), further: Callable[[str], object] = _nothing,
            used: Tuple[str, ...] = ()) -> None:
    """Delete the cached kernels of the folder that contains the file ``path`` if a module that they use has changed.

    A package of kernels calls this when it is imported, before it imports a kernel.  numba stores compiled kernels
    beside the modules, or in a folder of the user if the former cannot be written.  Changes are found by a checksum and
    not by dates, because an installation may keep the dates of the files that it copies.

    Parameters
    ----------
    path : str
        File of the package.
    endings : tuple of str
        Ends of the names of the modules that count: kernels, and what kernels import from this folder.
    further : callable
        Returns for the source text of such a module what else its kernels depend on, with a ``repr`` of its own.
    used : tuple of str
        Files of other folders with kernels that those of this folder call.
    """
    if kernel.loaded(_top_folder(path)) is not None:
        kernel.before_numba.append(lambda: _refresh(path, endings, further, used))
        return
    _refresh(path, endings, further, used)


def _top_folder(path: str) -> str:
    """Return the folder of the top package that contains a file."""
    folder = os.path.dirname(os.path.abspath(path))
    while os.path.exists(os.path.join(os.path.dirname(folder), "__init__.py")):
        folder = os.path.dirname(folder)
    return folder


def _refresh(path: str, endings: Tuple[str, ...], further: Callable[[str], object], used: Tuple[str, ...]) -> None:
    folder = os.path.dirname(os.path.abspath(path))
    digest = hashlib.sha1()
    try:
        modules = sorted(name for name in os.listdir(folder) if name.endswith(endings))
        cache = _place(os.path.join(folder, modules[0])) if modules else None
        if cache is None:
            return
        for name in modules:
            with open(os.path.join(folder, name), encoding="utf-8") as stream:
                source = stream.read()
            digest.update(repr((name, source, further(source))).encode())
        for name in used:
            with open(name, encoding="utf-8") as stream:
                digest.update(stream.read().encode())
        stamp, now = os.path.join(cache, _STAMP), digest.hexdigest()
        if _read(stamp) == now:
            return
        os.makedirs(cache, exist_ok=True)
        for name in os.listdir(cache):
            if name.endswith((".nbi", ".nbc")):
                _remove(os.path.join(cache, name))
        beside = os.path.join(folder, "__pycache__")
        if os.path.realpath(cache) != os.path.realpath(beside) and _read(os.path.join(beside, _STAMP)) == now:
            _copy(beside, cache)
        with open(stamp + ".%d" % os.getpid(), "w") as stream:
            stream.write(now)
        os.replace(stamp + ".%d" % os.getpid(), stamp)
    except (OSError, UnicodeError):
        return


def _copy(source: str, cache: str) -> None:
    """Copy compiled kernels. The indices are copied last, so that each index refers to existing files."""
    for name in sorted(os.listdir(source), key=lambda name: name.endswith(".nbi")):
        if name.endswith((".nbi", ".nbc")):
            temporary = os.path.join(cache, "%s.%d" % (name, os.getpid()))
            shutil.copyfile(os.path.join(source, name), temporary)
            os.replace(temporary, os.path.join(cache, name))


def _place(module: str) -> Optional[str]:
    """Return the folder in which numba caches the compiled kernels of a file; None if it caches nothing."""
    try:
        from numba import njit
    except ImportError:                         # without numba no kernel is compiled
        return None
    probe: Dict[str, Any] = {"__name__": "probe"}
    exec(compile("def probe():\n    pass\n", module, "exec"), probe)      # for numba, a function of that file
    try:
        return njit(cache=True)(probe["probe"]).stats.cache_path
    except (AttributeError, RuntimeError):      # the compiler is off, or there is no writable folder
        return None


def _read(path: str) -> str:
    try:
        with open(path) as stream:
            return stream.read()
    except OSError:
        return ""


def _remove(path: str) -> None:
    try:
        os.remove(path)
    except FileNotFoundError:
        pass                    # another process has removed it
