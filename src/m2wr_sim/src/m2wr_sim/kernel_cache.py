"""Keeps numba's caches on disk true: numba looks only at the file of a function, not at those it calls into.

A kernel that calls kernels of another file, or takes constants from there, would go on with what it was compiled with
after that other file has changed.  So all caches of a folder are dropped when any module in it has changed.
"""
import hashlib
import os

_STAMP = "kernels.sha1"


def refresh(path):
    """Drop the cached kernels beside the file ``path`` if a module of that folder is not what it was.

    To be called by a package of kernels when it is imported, before any of them.  A folder that cannot be written is
    left alone: whoever installs there anew gives all files new dates, which numba does look at.
    """
    folder = os.path.dirname(os.path.abspath(path))
    cache = os.path.join(folder, "__pycache__")
    digest = hashlib.sha1()
    try:
        for name in sorted(name for name in os.listdir(folder) if name.endswith(".py")):
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
        with open(stamp + ".%d" % os.getpid(), "w") as stream:
            stream.write(now)
        os.replace(stamp + ".%d" % os.getpid(), stamp)
    except OSError:
        return


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
