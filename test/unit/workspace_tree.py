# SPDX-License-Identifier: BSD-3-Clause
"""The packages of this workspace and their files; shared by the tests of its structure."""
import os
import re
from collections import namedtuple

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
PACKAGE_TOPS = ("src", "dropin", "test")
NOT_SOURCES = {"__pycache__", ".pytest_cache", ".git", ".venv"}

Package = namedtuple("Package", "name folder")


def packages(root=ROOT):
    """Every catkin package of the workspace.

    Returns
    -------
    list of Package
        Name from package.xml, absolute folder; ordered by folder.

    Raises
    ------
    LookupError
        If there is none, so that no test passes without packages.
    """
    found = []
    for top in PACKAGE_TOPS:
        for folder, folders, files in os.walk(os.path.join(root, top)):
            folders[:] = sorted(set(folders) - NOT_SOURCES)
            if "package.xml" in files:
                folders[:] = []
                with open(os.path.join(folder, "package.xml"), encoding="utf-8") as stream:
                    found.append(Package(re.search(r"<name>\s*([^<\s]+)", stream.read()).group(1), folder))
    if not found:
        raise LookupError("no package.xml under {} of {}".format(", ".join(PACKAGE_TOPS), root))
    return found


def files_below(folder):
    """Absolute paths of the files in a folder and below, ordered, without caches."""
    found = []
    for where, folders, files in os.walk(folder):
        folders[:] = sorted(set(folders) - NOT_SOURCES)
        found.extend(os.path.join(where, name) for name in sorted(files))
    return found


def is_python(path):
    """Whether a file is Python source: by its name, or by its first line if it has no extension."""
    if path.endswith(".py"):
        return True
    if os.path.splitext(path)[1]:
        return False
    with open(path, "rb") as stream:
        return re.match(rb"#!.*\bpython", stream.readline()) is not None


def read(path):
    """Text of a file."""
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def relative(path, root=ROOT):
    """Path relative to the root of the workspace, for messages."""
    return os.path.relpath(path, root)
