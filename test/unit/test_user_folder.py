# SPDX-License-Identifier: BSD-3-Clause
"""Only one module determines the user's folder: the variable PWD may be outdated."""
import os

import pytest

import workspace_tree as tree

KNOWS = ("m2wr_node/src/m2wr_node/user_folder.py", "m2wr_node/test/unit/test_user_folder.py")


@pytest.mark.parametrize("package", tree.packages(), ids=lambda package: package.name)
def test_nothing_reads_pwd(package):
    faults = []
    for path in tree.files_below(package.folder):
        if not (path.endswith((".launch", ".test")) or tree.is_python(path)) or path.endswith(KNOWS) \
                or os.path.samefile(path, __file__):
            continue
        for number, line in enumerate(tree.read(path).splitlines(), 1):
            if "'PWD'" in line or '"PWD"' in line or "env PWD" in line:
                faults.append("%s:%d: %s" % (tree.relative(path), number, line.strip()))
    assert not faults, "\n".join(faults)
