# SPDX-License-Identifier: BSD-3-Clause
"""Finished runs of a benchmark, so that an interrupted one can be resumed."""
from __future__ import annotations

import glob
import hashlib
import json
import os
from typing import Any, Dict, List, Optional

from m2wr_gmapping import config

ENDING = ".run"


def program_digest() -> str:
    """Return a checksum of the sources of mapper and benchmark; results of other versions are not reused."""
    total = hashlib.sha256()
    for module in (config.__file__, __file__):
        root = os.path.dirname(os.path.abspath(module))
        for path in sorted(glob.glob(os.path.join(root, "**", "*.py"), recursive=True)):
            with open(path, "rb") as stream:
                total.update(os.path.relpath(path, root).encode() + b"\0" + stream.read())
    return total.hexdigest()


def key(**values: object) -> str:
    """Return a checksum of the inputs of a run."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def file_mark(path: str) -> List[Any]:
    """Return path, size and time of a file, which identify its content."""
    found = os.stat(path)
    return [os.path.abspath(path), found.st_size, found.st_mtime_ns]


def load(out: str, expected: str) -> Optional[Dict[str, Any]]:
    """Return the stored result of a run, or None if there is none for these inputs.

    Parameters
    ----------
    out : str
        Path of the run's files, without suffix.
    expected : str
        Checksum of the inputs.
    """
    try:
        with open(out + ENDING, encoding="utf-8") as stream:
            kept = json.load(stream)
        return kept["result"] if kept["key"] == expected else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(out: str, made: str, result: Dict[str, Any]) -> None:
    """Store the result of a run.

    Parameters
    ----------
    out : str
        Path of the run's files, without suffix.
    made : str
        Checksum of the inputs.
    result : dict
        Result.
    """
    with open(out + ENDING + "~", "w", encoding="utf-8") as stream:
        json.dump(dict(key=made, result=result), stream)
    os.replace(out + ENDING + "~", out + ENDING)
