# SPDX-License-Identifier: BSD-3-Clause
"""Every test in the tree is registered with the build, and every registration names an existing test.

A test that no CMakeLists.txt names never runs, and no other check would detect it.
"""
import os
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter

import pytest

import workspace_tree as tree

ROSTEST = re.compile(r"\badd_rostest(?:_gtest)?\s*\(([^)]*)\)")
PYTEST = re.compile(r"\bcatkin_run_tests_target\s*\(([^)]*)\)")
SOURCE_DIR = "${CMAKE_CURRENT_SOURCE_DIR}/"
PACKAGES = tree.packages()


def cmake_text(folder):
    """CMakeLists.txt of a package without comments."""
    return re.sub(r"#.*", "", tree.read(os.path.join(folder, "CMakeLists.txt")))


def registered_rostests(folder):
    """Paths, relative to the package, that its CMakeLists.txt passes to add_rostest (or add_rostest_gtest)."""
    found = []
    for arguments in ROSTEST.findall(cmake_text(folder)):
        found.extend(word for word in arguments.split() if word.endswith((".test", ".launch")))
    return [path.replace(SOURCE_DIR, "") for path in found]


def registered_unit_paths(folder):
    """Folders and files, relative to the package, that its CMakeLists.txt passes to pytest."""
    found = []
    for arguments in PYTEST.findall(cmake_text(folder)):
        if "pytest" in arguments:
            found.extend(re.findall(re.escape(SOURCE_DIR) + r"([^\s\"']+)", arguments))
    return [path.rstrip("/") for path in found]


def inside(folder, wanted):
    """Relative paths of the package's files for which ``wanted(path)`` holds; test data is not a test."""
    paths = (os.path.relpath(path, folder) for path in tree.files_below(folder))
    return [path for path in paths if wanted(path) and "data" not in path.split(os.sep)[:-1]]


def unregistered(folder):
    """Test files of a package that its CMakeLists.txt does not register, relative to the package."""
    rostests, units = registered_rostests(folder), registered_unit_paths(folder)
    missing = [path for path in inside(folder, lambda p: p.endswith(".test")) if path not in rostests]
    for path in inside(folder, lambda p: re.match(r"test_.*\.py$", os.path.basename(p)) is not None):
        if not any(path == unit or path.startswith(unit + os.sep) for unit in units):
            missing.append(path)
    return missing


def absent(folder):
    """Registrations of a package whose file or folder does not exist (or, a folder, holds no test)."""
    missing = [path for path in registered_rostests(folder) if not os.path.isfile(os.path.join(folder, path))]
    for path in registered_unit_paths(folder):
        full = os.path.join(folder, path)
        tests = [full] if os.path.isfile(full) else tree.files_below(full)
        if not any(re.match(r"test_.*\.py$", os.path.basename(test)) for test in tests if os.path.isfile(test)):
            missing.append(path)
    return missing


def tags_of(folder):
    """(file, pkg, type, test-name) of each <test> in the .test and .launch files of a package."""
    found = []
    for path in inside(folder, lambda p: p.endswith((".test", ".launch"))):
        for tag in ElementTree.parse(os.path.join(folder, path)).getroot().iter("test"):
            found.append((path, tag.get("pkg"), tag.get("type"), tag.get("test-name") or ""))
    return found


def ids(packages):
    return [package.name for package in packages]


TAGS = [(package,) + tag for package in PACKAGES for tag in tags_of(package.folder)]


def test_this_file_sees_itself():
    own = [package for package in PACKAGES if package.name == "m2wr_test"]
    assert len(own) == 1
    assert os.path.join("unit", "test_registered.py") in inside(own[0].folder, lambda p: p.endswith(".py"))
    assert "unit" in registered_unit_paths(own[0].folder)


@pytest.mark.parametrize("package", PACKAGES, ids=ids(PACKAGES))
def test_every_test_file_is_registered(package):
    missing = unregistered(package.folder)
    assert not missing, "{}/CMakeLists.txt does not register {}".format(
        tree.relative(package.folder), ", ".join(missing))


@pytest.mark.parametrize("package", PACKAGES, ids=ids(PACKAGES))
def test_every_registration_names_a_test(package):
    missing = absent(package.folder)
    assert not missing, "{}/CMakeLists.txt registers {}, where there is no test".format(
        tree.relative(package.folder), ", ".join(missing))


@pytest.mark.parametrize("package", PACKAGES, ids=ids(PACKAGES))
def test_names_of_results_are_unique(package):
    names = Counter(name for _, _, _, name in tags_of(package.folder) if "$(" not in name)
    shared = sorted(name for name, number in names.items() if number > 1)
    assert not shared, "{}: test-name {} is used more than once; the results overwrite each other".format(
        package.name, ", ".join(shared))
    results = Counter(re.findall(r"[\w.-]+\.xml", " ".join(
        arguments.split("COMMAND")[0] for arguments in PYTEST.findall(cmake_text(package.folder)))))
    assert all(number == 1 for number in results.values()), results


@pytest.mark.parametrize("package", PACKAGES, ids=ids(PACKAGES))
def test_every_check_is_started_by_a_test(package):
    checks = {os.path.basename(path) for path in inside(package.folder, lambda p: "nodes" in p.split(os.sep))
              if os.path.basename(path).startswith("check_")}
    started = {kind for _, _, pkg, kind, _ in TAGS if pkg == package.name}
    assert not checks - started, "no .test starts {}".format(", ".join(sorted(checks - started)))


@pytest.mark.parametrize("package", PACKAGES, ids=ids(PACKAGES))
def test_every_started_check_exists_and_is_executable(package):
    for _, path, pkg, kind, _ in TAGS:
        if pkg != package.name:
            continue
        found = [other for other in tree.files_below(package.folder) if os.path.basename(other) == kind]
        assert found, "{}: {} starts {}/{}, which does not exist".format(package.name, path, pkg, kind)
        assert os.access(found[0], os.X_OK), "{} is not executable".format(tree.relative(found[0]))


@pytest.mark.parametrize("package", PACKAGES, ids=ids(PACKAGES))
def test_checks_do_not_skip(package):
    """rosunit reports a skipped test as passed, so a check that cannot run must fail."""
    for _, _, pkg, kind, _ in TAGS:
        if pkg == package.name:
            for path in tree.files_below(package.folder):
                if os.path.basename(path) == kind and tree.is_python(path):
                    skips = re.findall(r"\bskip(?:Test|If|Unless)?\b\s*\(", tree.read(path))
                    assert not skips, "{} skips; rostest would report that as passed".format(tree.relative(path))


def write(folder, **files):
    """Files by name, ``__`` standing for a slash and ``_dot_`` for a dot."""
    for name, text in files.items():
        path = os.path.join(str(folder), name.replace("__", os.sep).replace("_dot_", "."))
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)


UNIT = ('catkin_run_tests_target("pytest" "unit" "unit.xml"\n'
        ' COMMAND "x -m pytest ${CMAKE_CURRENT_SOURCE_DIR}/test/unit")')


def test_a_forgotten_test_is_found(tmp_path):
    write(tmp_path, CMakeLists_dot_txt=UNIT + "\n# add_rostest(test/rostest/b.test)\nadd_rostest(test/rostest/a.test)",
          test__unit__test_a_dot_py="", test__test_b_dot_py="", test__rostest__a_dot_test="<launch/>",
          test__rostest__b_dot_test="<launch/>", test__data__test_c_dot_py="")
    assert unregistered(str(tmp_path)) == [os.path.join("test", "rostest", "b.test"), os.path.join("test", "test_b.py")]
    assert absent(str(tmp_path)) == []


def test_a_registration_of_nothing_is_found(tmp_path):
    write(tmp_path, CMakeLists_dot_txt=UNIT + "\nadd_rostest(test/rostest/a.test ARGS x:=1)",
          test__unit__notes_dot_txt="")
    assert absent(str(tmp_path)) == [os.path.join("test", "rostest", "a.test"), os.path.join("test", "unit")]
