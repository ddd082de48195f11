# SPDX-License-Identifier: BSD-3-Clause
"""Finds in each folder of submissions the program that is to be run."""
from __future__ import annotations

import os
from typing import List, Sequence, Tuple

from m2wr_campaign.study.factors import StudyMethod
from m2wr_campaign.study.programs import Program, ProgramError, digest_of, files_of, read_program

PREFERRED = ("bug2.launch", "bug2.py")      # names of the report


class SubmissionsError(ValueError):
    """A folder that has no submissions."""


def submissions(folder: str, name: str = "") -> Tuple[StudyMethod, ...]:
    """Return the program of each submission as a method; one without a program fails with its reason.

    Parameters
    ----------
    folder : str
        Has a folder for each submission.
    name : str, optional
        Of the launch file or script that is run; empty: ``bug2.launch``, the only launch file, ``bug2.py``, or the only
        script, in this order.

    Raises
    ------
    SubmissionsError
        If it is no folder, or has none.
    """
    if not os.path.isdir(folder):
        raise SubmissionsError("{}: there is no such folder; expected one with a folder for each submission".format(
            folder))
    names = sorted(one for one in os.listdir(folder)
                   if not one.startswith(".") and os.path.isdir(os.path.join(folder, one)))
    if not names:
        raise SubmissionsError("{}: it has no folders; expected one for each submission".format(folder))
    return tuple(StudyMethod(one, (), _program(os.path.join(folder, one), name)) for one in names)


def _program(folder: str, name: str) -> Program:
    try:
        return read_program(_chosen(folder, list(files_of(folder)), name), folder)
    except (ProgramError, OSError) as error:
        try:
            digest = digest_of(folder)
        except (ProgramError, OSError):
            digest = "unreadable"
        return Program(os.path.join(folder, "program"), folder, digest, (), str(error))


def _chosen(folder: str, paths: Sequence[str], name: str) -> str:
    """Return the path of the program of a submission."""
    launches = [path for path in paths if path.endswith(".launch")]
    scripts = [path for path in paths if path.endswith(".py") and os.path.basename(path) != "setup.py"]
    tries: List[Tuple[str, List[str]]] = [(name, [path for path in paths if os.path.basename(path) == name])] \
        if name else [(PREFERRED[0], [path for path in launches if os.path.basename(path) == PREFERRED[0]]),
                      ("launch file", launches),
                      (PREFERRED[1], [path for path in scripts if os.path.basename(path) == PREFERRED[1]]),
                      ("script", scripts)]
    for what, found in tries:
        if len(found) == 1:
            return found[0]
        if found:
            raise ProgramError("there are {} of {}: {}; expected one, or its name with --program".format(
                len(found), what, ", ".join(os.path.relpath(path, folder) for path in found[:5])))
    raise ProgramError("there is no {}".format(name or "launch file and no script"))
