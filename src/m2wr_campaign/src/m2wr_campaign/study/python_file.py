# SPDX-License-Identifier: BSD-3-Clause
"""A study that a Python program makes, such as one whose values are computed."""
from __future__ import annotations

import os
import runpy
import traceback
from typing import Any

from m2wr_campaign.study.fields import DEEPEST, StudyError

NAME = "STUDY"              # the variable that has the study


def run_python(path: str) -> Any:
    """Run a Python program and return its STUDY, as YAML would give it.

    The program has all rights of the user, as every program that is run by its name.

    Parameters
    ----------
    path : str

    Raises
    ------
    StudyError
        If it fails or sets no STUDY; with the line.
    """
    file = os.path.basename(path)
    try:
        found = runpy.run_path(path, run_name="m2wr_study")
    except (Exception, SystemExit) as error:        # whatever a program may do
        where = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
        line = getattr(error, "lineno", None) or (where[-1] if where else None)
        raise StudyError("{}: {}{}: {}; expected a program that sets {}".format(
            file, "line {}: ".format(line) if line else "", type(error).__name__, error, NAME)) from None
    if NAME not in found:
        raise StudyError("{}: it sets no {}; expected a mapping of that name".format(file, NAME))
    return _plain(found[NAME], file)


def _plain(value: Any, file: str, depth: int = 0) -> Any:
    """Return mappings, sequences and numbers of any library as those of Python."""
    if depth > DEEPEST:
        raise StudyError("{}: more than {} lists and mappings in one another".format(file, DEEPEST))
    if isinstance(value, dict):
        return {key: _plain(inner, file, depth + 1) for key, inner in value.items()}
    if hasattr(value, "tolist"):                    # arrays and numbers of NumPy
        value = value.tolist()
    if isinstance(value, (list, tuple, range, set, frozenset)):
        ordered = sorted(value) if isinstance(value, (set, frozenset)) else value
        return [_plain(inner, file, depth + 1) for inner in ordered]
    return value
