# SPDX-License-Identifier: BSD-3-Clause
"""The name of a test file tells which module or which behaviour it tests; CONTRIBUTING.md has the rule.

``test_<module>.py``, or ``test_<folder>_<module>.py`` if two modules of the package have this name; an aspect may
follow. A folder alone stands for its modules. Other first words are in the table of CONTRIBUTING.md.
"""
import os
import re

import pytest

import workspace_tree as tree

HEADING = "| first word of a test file |"
PACKAGES = [package for package in tree.packages() if tree.relative(package.folder).startswith("src" + os.sep)]


def first_words():
    """The first words in the table of CONTRIBUTING.md."""
    text = tree.read(os.path.join(tree.ROOT, "CONTRIBUTING.md"))
    table = text[text.index(HEADING):].split("\n\n")[0]
    return re.findall(r"^\| `(\w+)_` \|", table, re.M)


def modules_of(folder):
    """The modules of a package, each as a tuple of its folders and its name below the package's Python root."""
    root = os.path.join(folder, "src")
    paths = (os.path.relpath(path, root) for path in tree.files_below(root) if path.endswith(".py"))
    return [tuple(path[:-len(".py")].split(os.sep))[1:] for path in paths if not path.endswith("__init__.py")]


def fault(name, modules, words):
    """Why ``test_<name>.py`` breaks the rule, or an empty text.

    Parameters
    ----------
    name : str
    modules : list of tuple of str
        As returned by :func:`modules_of`.
    words : list of str
        First words for tests that belong to no module.

    Returns
    -------
    str
    """
    same = [module for module in modules if module[-1] == name]
    if len(same) > 1:
        return "is the name of %s; name the folder too" % " and ".join("/".join(module) for module in same)
    known = {module[-1] for module in modules} | {folder for module in modules for folder in module[:-1]}
    parts = name.split("_")
    beginnings = {"_".join(parts[:count]) for count in range(1, len(parts) + 1)}
    if not beginnings & known and parts[0] not in words:
        return "begins with no module, no folder of modules and none of the words %s" % ", ".join(words)
    return ""


@pytest.mark.parametrize("package", PACKAGES, ids=[package.name for package in PACKAGES])
def test_a_test_file_names_what_it_tests(package):
    folder = os.path.join(package.folder, "test", "unit")
    files = os.listdir(folder) if os.path.isdir(folder) else []
    helpers = [(name[:-len(".py")],) for name in files if name.endswith(".py") and not name.startswith("test_")]
    modules, words = modules_of(package.folder) + helpers, first_words()
    names = sorted(re.findall(r"^test_(\w+)\.py$", "\n".join(files), re.M))
    wrong = [(name, fault(name, modules, words)) for name in names]
    found = ["%s/test_%s.py: %s" % (tree.relative(folder), name, words) for name, words in wrong if words]
    assert not found, "\n".join(found)


MODULES = [("sensors", "laser"), ("plugins", "laser"), ("runtime", "event_queue"), ("model", "sdf", "node")]


@pytest.mark.parametrize("name", ["event_queue", "event_queue_order", "sensors_laser", "sdf", "sdf_node", "node",
                                  "behaviour_determinism"])
def test_accepted_names(name):
    assert fault(name, MODULES, ["behaviour"]) == ""


@pytest.mark.parametrize("name, reason", [("laser", "sensors/laser and plugins/laser"), ("events", "no module"),
                                          ("queue_event", "no module"), ("behaviours_all", "no module")])
def test_refused_names(name, reason):
    assert reason in fault(name, MODULES, ["behaviour"])
