# SPDX-License-Identifier: BSD-3-Clause
"""What catkin_prepare_release needs: readable changelogs, and one version in all packages that are released."""
import os
import re

import pytest

import workspace_tree as tree

changelog = pytest.importorskip("catkin_pkg.changelog")
PACKAGES = tree.packages()
RELEASED = [package for package in PACKAGES if not tree.relative(package.folder).startswith("dropin" + os.sep)]


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_changelog_can_be_read(package, capsys):
    found = changelog.get_changelog_from_path(package.folder)
    assert found is not None
    assert capsys.readouterr().err == ""


def test_released_packages_have_one_version():
    versions = {re.search(r"<version>(.*)</version>", tree.read(os.path.join(package.folder, "package.xml"))).group(1)
                for package in RELEASED}
    assert len(versions) == 1 and len(RELEASED) > 5
