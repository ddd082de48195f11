# SPDX-License-Identifier: BSD-3-Clause
"""ROS programs as methods of a study: a launch file or a node's script, with the package that it belongs to."""
from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from typing import Iterator, Tuple

KINDS = (".launch", ".py")
MOST_FILES, MOST_BYTES = 5000, 200_000_000      # of a package
LEFT_OUT = (".git", "__pycache__")


class ProgramError(ValueError):
    """A program that cannot be used."""


@dataclass(frozen=True)
class Program:
    """A program under test.

    Attributes
    ----------
    path : str
        Launch file or script.
    folder : str
        Of its package: the nearest one above with a ``package.xml``, or its own.
    digest : str
        Of all files of the folder: another one is another method.
    arguments : tuple of (str, str)
        Of the launch file, or private parameters of the node.
    problem : str
        Why it cannot be run; empty: it can.
    """

    path: str
    folder: str
    digest: str
    arguments: Tuple[Tuple[str, str], ...] = ()
    problem: str = ""


def read_program(path: str, folder: str = "", arguments: Tuple[Tuple[str, str], ...] = ()) -> Program:
    """Return the record of a program.

    Parameters
    ----------
    path : str
        Launch file or script.
    folder : str, optional
        That travels with it; empty: the nearest one above with a ``package.xml``, or its own.
    arguments : tuple of (str, str), optional

    Raises
    ------
    ProgramError
        If there is no such file, or its package is too large.
    """
    path = os.path.abspath(path)
    if os.path.splitext(path)[1] not in KINDS or not os.path.isfile(path):
        raise ProgramError("{}: there is no such file; expected a launch file or a script ({})".format(
            path, ", ".join(KINDS)))
    folder = os.path.abspath(folder) if folder else package_above(path)
    return Program(path, folder, digest_of(folder), arguments)


def package_above(path: str) -> str:
    """Return the nearest folder above a file that has a ``package.xml``, or the file's own."""
    own = folder = os.path.dirname(path)
    while folder != os.path.dirname(folder):
        if os.path.isfile(os.path.join(folder, "package.xml")):
            return folder
        folder = os.path.dirname(folder)
    return own


def files_of(folder: str) -> Iterator[str]:
    """Yield the paths of all regular files of a package, sorted; links are not followed.

    Raises
    ------
    ProgramError
        If they are too many or too large.
    """
    count = size = 0
    for here, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name not in LEFT_OUT)
        for name in sorted(names):
            path = os.path.join(here, name)
            if os.path.islink(path) or not os.path.isfile(path):
                continue
            count, size = count + 1, size + os.path.getsize(path)
            if count > MOST_FILES or size > MOST_BYTES:
                raise ProgramError("{}: more than {} files or {} MB; expected a package".format(
                    folder, MOST_FILES, MOST_BYTES // 1_000_000))
            yield path


def digest_of(folder: str) -> str:
    """Return what changes with any file of a package."""
    found = hashlib.sha256()
    for path in files_of(folder):
        with open(path, "rb") as file:
            content = hashlib.sha256(file.read()).hexdigest()
        found.update("{}\0{}\n".format(os.path.relpath(path, folder), content).encode("utf-8", "surrogateescape"))
    return found.hexdigest()[:16]
