# SPDX-License-Identifier: BSD-3-Clause
"""Every habit of Gazebo that the README of this package lists has an existing test."""
import os
import re

import pytest

_FOLDER = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def rows():
    """Return (file, test) of each row of the table."""
    with open(os.path.join(_FOLDER, "README.md"), encoding="utf-8") as stream:
        section = stream.read().split("## Habits of Gazebo")[1].split("\n## ")[0]
    return re.findall(r"^\| .+ \| `([\w./]+)` \| `(test_\w+)` \|$", section, re.M)


def test_the_table_is_read():
    assert len(rows()) > 20


@pytest.mark.parametrize("file, test", sorted(set(rows())))
def test_the_test_exists(file, test):
    with open(os.path.join(_FOLDER, file), encoding="utf-8") as stream:
        assert re.search(r"^ *def %s\(" % test, stream.read(), re.M), "%s has no %s" % (file, test)
