# SPDX-License-Identifier: BSD-3-Clause
"""Keeps numba's caches on disk true: numba looks only at the file of a function, not at those it calls into.

A kernel that calls kernels of another file, or takes constants from there, would go on with what it was compiled with
after that other file has changed.  So all caches of a folder are dropped when any module in it has changed.

Nor does numba read what was compiled when the package was installed if it cannot write there too: then each user gets
a copy, which is quicker than to compile anew.
"""
import hashlib
import os
import shutil

try:
    from numba import njit
except ImportError:             # then there are no compiled kernels
    njit = None

_STAMP = "kernels.sha1"


def refresh(path):
    """Drop the cached kernels of the folder of the file ``path`` if a module there is not what it was.

    To be called by a package of kernels when it is imported, before any of them.  The kernels lie where numba keeps
    them: beside the modules, or in a folder of the user's where those cannot be written, as after an installation by
    root.  Dates are not asked: an installation may keep those of the files it copies.
    """
    if njit is None:
        return
    folder = os.path.dirname(os.path.abspath(path))
    digest = hashlib.sha1()
    try:
        modules = sorted(name for name in os.listdir(folder) if name.endswith(".py"))
        cache = _place(os.path.join(folder, modules[0])) if modules else None
        if cache is None:
            return
        for name in modules:
            digest.update(name.encode())
            with open(os.path.join(folder, name), "rb") as stream:
                digest.update(stream.read())
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
    except OSError:
        return


def _copy(source, cache):
    """Copy compiled kernels; their indices last, so that whoever reads one finds what it names."""
    for name in sorted(os.listdir(source), key=lambda name: name.endswith(".nbi")):
        if name.endswith((".nbi", ".nbc")):
            begun = os.path.join(cache, "%s.%d" % (name, os.getpid()))
            shutil.copyfile(os.path.join(source, name), begun)
            os.replace(begun, os.path.join(cache, name))


def _place(module):
    """Return the folder in which numba keeps what it compiles of a file; None where it keeps nothing."""
    probe = {"__name__": "probe"}
    exec(compile("def probe():\n    pass\n", module, "exec"), probe)      # a function of that file, as numba sees it
    try:
        return njit(cache=True)(probe["probe"]).stats.cache_path
    except (AttributeError, RuntimeError):      # it does not compile at all; nothing can be written anywhere
        return None


def _read(path):
    try:
        with open(path) as stream:
            return stream.read()
    except OSError:
        return ""


def _remove(path):
    try:
        os.remove(path)
    except FileNotFoundError:
        pass                    # another process, started at the same moment, was faster
