# SPDX-License-Identifier: BSD-3-Clause
"""Atomic writing of files: each is complete, or unchanged if the program fails.

A file is written to a temporary file in the same folder, synchronised to disk and renamed. The writer holds a lock on
the temporary file. One without a lock was left by a dead process; the next writer in the folder removes it.
"""
from __future__ import annotations

import fcntl
import os
import re
import stat
import tempfile
from typing import BinaryIO, Iterable, List, Set, Tuple, Union

PREFIX = ".whole-"
_TEMPORARY = re.compile(re.escape(PREFIX) + r"[A-Za-z0-9_]{8}")       # as tempfile names them
Part = Union[bytes, memoryview]      # of a file
STREAMS = ("/dev/stdout", "/dev/stderr", "/dev/fd/", "/proc/self/fd/")


def write_atomically(*files: Tuple[str, Iterable[Part]]) -> None:
    """Write files; all are complete on disk before the first one replaces an older file.

    A symbolic link is kept and its target replaced. Devices, pipes and standard streams are written to, not replaced.

    Parameters
    ----------
    files : tuple of (str, sequence)
        Path, and parts: bytes-like objects.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    waiting: List[Tuple[str, int, str]] = []
    folders: Set[str] = set()
    try:
        for path, parts in files:
            if _is_stream(path):
                with open(path, "ab") as stream:
                    _put(stream, parts)
                continue
            path = os.path.realpath(path)
            folder = os.path.dirname(path)
            if folder not in folders:
                remove_stale(folder)
                folders.add(folder)
            waiting.append(_complete(folder, parts) + (path,))
        for temporary, lock, path in list(waiting):
            os.replace(temporary, path)
            os.close(lock)
            waiting.remove((temporary, lock, path))
        for folder in folders:
            _sync(folder)
    finally:
        for temporary, lock, _ in waiting:
            _remove(temporary)
            os.close(lock)


def remove_stale(folder: str) -> List[str]:
    """Remove the temporary files of dead writers in a folder; returns their paths.

    Nothing is removed if the folder cannot be read or the file system has no locks.
    """
    removed: List[str] = []
    try:
        names = [name for name in os.listdir(folder) if _TEMPORARY.fullmatch(name)]
    except OSError:
        return removed
    for name in names:
        path = os.path.join(folder, name)
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except OSError:
            continue
        try:
            if stat.S_ISREG(os.fstat(descriptor).st_mode):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(path)
                removed.append(path)
        except OSError:
            pass            # its writer is active, or it cannot be removed
        finally:
            os.close(descriptor)
    return removed


def _is_stream(path: str) -> bool:
    path = os.path.abspath(path)
    return path.startswith(STREAMS) or (os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path))


def _put(stream: BinaryIO, parts: Iterable[Part]) -> None:
    for part in parts:
        stream.write(part)
    stream.flush()


def _temporary(folder: str) -> Tuple[int, str]:
    """Return descriptor and path of a new locked temporary file in ``folder``."""
    while True:
        descriptor, path = tempfile.mkstemp(prefix=PREFIX, dir=folder)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        except OSError:
            return descriptor, path         # a file system without locks
        if os.fstat(descriptor).st_nlink:
            return descriptor, path
        os.close(descriptor)                # another writer removed it before it was locked


def _complete(folder: str, parts: Iterable[Part]) -> Tuple[str, int]:
    """Write parts to a temporary file in ``folder`` and to disk; return its path and locked descriptor."""
    descriptor, path = _temporary(folder)
    try:
        with os.fdopen(descriptor, "wb", closefd=False) as stream:
            _put(stream, parts)
        os.fsync(descriptor)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(path, 0o666 & ~mask)
    except BaseException:
        _remove(path)
        os.close(descriptor)
        raise
    return path, descriptor


def _remove(path: str) -> None:
    try:
        os.unlink(path)
    except OSError:
        pass            # it does not exist any more


def _sync(folder: str) -> None:
    """Synchronise a folder's entries to disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
