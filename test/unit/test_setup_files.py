# SPDX-License-Identifier: BSD-3-Clause
"""Each setup.py names every Python package beside it; an installed one would lack the others."""
import os
import runpy

import pytest
import setuptools

import workspace_tree as tree

FOLDERS = [one.folder for one in tree.packages() if os.path.exists(os.path.join(one.folder, "setup.py"))]


@pytest.mark.parametrize("folder", FOLDERS, ids=os.path.basename)
def test_every_python_package_is_installed(folder, monkeypatch):
    given = {}
    monkeypatch.chdir(folder)
    monkeypatch.setattr(setuptools, "setup", lambda **words: given.update(words))
    runpy.run_path("setup.py")
    assert sorted(given.get("packages", [])) == sorted(setuptools.find_packages(given["package_dir"][""]))
