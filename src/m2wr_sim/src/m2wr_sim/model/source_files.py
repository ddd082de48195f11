# SPDX-License-Identifier: BSD-3-Clause
"""Which files a model or world is read from, so that it can be used again while they have not changed.

Whatever opens a file, or decides by whether there is one, calls :func:`note_file` before.
"""
from __future__ import annotations

import os
import threading
from contextlib import contextmanager
from typing import Dict, Iterator, List, Optional, Tuple

#: Time of the last change [ns], size [bytes] and inode of a file; None if there is none.
Stamp = Optional[Tuple[int, int, int]]


class _Readers(threading.local):
    """The open lists of the calling thread."""

    def __init__(self) -> None:
        self.lists: List[Dict[str, Stamp]] = []


_readers = _Readers()


def stamp_of(path: str) -> Stamp:
    """Return the stamp of a file or folder, None if it does not exist or cannot be seen."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):               # ValueError: a path that no file can have
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def note_file(path: str) -> None:
    """Add a file or folder, or that there is none, to the lists that are open in this thread."""
    for stamps in _readers.lists:
        if path not in stamps:                  # the first stamp: a change while it is read must not be missed
            stamps[path] = stamp_of(path)


@contextmanager
def noted_files() -> Iterator[Dict[str, Stamp]]:
    """Return a dictionary that gets the stamp of each file that is noted inside the block, by path."""
    stamps: Dict[str, Stamp] = {}
    _readers.lists.append(stamps)
    try:
        yield stamps
    finally:
        _readers.lists.pop()


def unchanged(stamps: Dict[str, Stamp]) -> bool:
    """Return whether all files still have these stamps."""
    return all(stamp_of(path) == stamp for path, stamp in stamps.items())
