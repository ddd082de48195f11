# SPDX-License-Identifier: BSD-3-Clause
"""Files that a comparison writes: checked before the first drive, replaced as a whole."""
from __future__ import annotations

import errno
import json
import os
import tempfile
from typing import Any

from m2wr_files.atomic_files import write_atomically


def check_writable(path: str) -> None:
    """Raise OSError if a file cannot be written; the file itself is not changed."""
    folder = os.path.dirname(os.path.abspath(path))
    if os.path.isdir(path):
        raise IsADirectoryError(errno.EISDIR, "this is a folder; expected the name of a file", path)
    if not os.path.isdir(folder):
        raise FileNotFoundError(errno.ENOENT, "there is no such folder", folder)
    with tempfile.TemporaryFile(dir=folder):
        pass


def write_text(path: str, text: str) -> None:
    """Replace a file.

    Parameters
    ----------
    path : str
    text : str

    Raises
    ------
    OSError
        With the name of the file.
    """
    write_atomically((path, [text.encode("utf-8")]))


def write_json(path: str, value: Any) -> None:
    """Replace a file of JSON; numbers that are not finite are an error, because JSON has none.

    Parameters
    ----------
    path : str
    value : object
    """
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")
