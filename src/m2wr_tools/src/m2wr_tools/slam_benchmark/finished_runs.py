# SPDX-License-Identifier: BSD-3-Clause
"""Runs that a benchmark has finished, so that one that was ended can go on where it was."""
import glob
import hashlib
import json
import os

from m2wr_gmapping import config

ENDING = ".run"


def program_digest():
    """Return a checksum of the sources of mapper and benchmark: results of another version are not reused."""
    total = hashlib.sha256()
    for module in (config.__file__, __file__):
        root = os.path.dirname(os.path.abspath(module))
        for path in sorted(glob.glob(os.path.join(root, "**", "*.py"), recursive=True)):
            with open(path, "rb") as stream:
                total.update(os.path.relpath(path, root).encode() + b"\0" + stream.read())
    return total.hexdigest()


def key(**values):
    """Return a checksum of what a run depends on."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def file_mark(path):
    """Return what tells a file from another one that takes its place (list)."""
    found = os.stat(path)
    return [os.path.abspath(path), found.st_size, found.st_mtime_ns]


def load(out, expected):
    """Return the result kept beside ``out``, or None where there is none or it was made otherwise."""
    try:
        with open(out + ENDING, encoding="utf-8") as stream:
            kept = json.load(stream)
        return kept["result"] if kept["key"] == expected else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(out, made, result):
    """Keep a result beside ``out``."""
    with open(out + ENDING + "~", "w", encoding="utf-8") as stream:
        json.dump(dict(key=made, result=result), stream)
    os.replace(out + ENDING + "~", out + ENDING)
