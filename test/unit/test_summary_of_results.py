# SPDX-License-Identifier: BSD-3-Clause
"""The summary of `make test` counts correctly and accepts no missing, stale, empty or overwritten result."""
import io
import os
import sys

import pytest

import workspace_tree as tree

sys.path.insert(0, os.path.join(tree.ROOT, "tools"))
import test_again as again  # noqa: E402
import test_summary as summary  # noqa: E402

PASS = '<testcase classname="c" name="test_a" time="0.5"/>'
FAIL = '<testcase classname="c" name="test_b"><failure message="short">1 != 2</failure></testcase>'
ERROR = '<testcase classname="c" name="test_c"><error>boom</error></testcase>'
SKIP = '<testcase classname="c" name="test_d"><skipped message="no display"/></testcase>'
WRAPPER = '<testcase classname="rostest.runner.RosTest" name="testdrive"/>'


@pytest.fixture(name="workspace")
def _workspace(tmp_path):
    """A workspace with one package ``alpha`` that declares one result file."""
    add_package(tmp_path, "alpha", ["pytest-unit.xml"])
    return tmp_path


def add_package(root, name, promised):
    package = root / "src" / name
    (package / "test").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>{}</name></package>".format(name))
    (package / "test" / "test_x.py").write_text("")
    build = root / "catkin_build" / name
    (build / "test_results" / name).mkdir(parents=True)
    (build / "CTestTestfile.cmake").write_text("".join(
        'add_test(_ctest_{0} "env.sh" "python3" "/opt/catkin/test/run_tests.py" "{1}" "--return-code" "x")\n'
        .format(name, build / "test_results" / name / result) for result in promised))


def result(root, name, *cases, package="alpha"):
    path = root / "catkin_build" / package / "test_results" / package / name
    path.write_text("<testsuite>{}</testsuite>".format("".join(cases)))
    return path


def run(root, *arguments):
    """Exit code, whole text and last line of the summary."""
    out = io.StringIO()
    code = summary.main([str(root), *arguments], out)
    return code, out.getvalue(), out.getvalue().rstrip("\n").rpartition("\n")[2]


def test_counts_and_last_line(workspace):
    result(workspace, "pytest-unit.xml", PASS, PASS, SKIP)
    assert run(workspace)[::2] == (0, "2 passed, 0 failed, 1 skipped")


def test_failures_and_errors_fail_and_are_reported(workspace):
    result(workspace, "pytest-unit.xml", PASS, FAIL, ERROR)
    code, text, last = run(workspace)
    assert (code, last) == (1, "1 passed, 2 failed, 0 skipped")
    assert "1 != 2" in text and "boom" in text


def test_missing_result_fails(workspace):
    add_package(workspace, "beta", ["pytest-unit.xml"])
    result(workspace, "pytest-unit.xml", PASS)
    code, text, last = run(workspace)
    assert (code, last) == (1, "1 passed, 1 failed, 0 skipped")
    assert "missing" in text and "beta" in text


def test_result_of_an_earlier_run_does_not_count(workspace):
    path = result(workspace, "pytest-unit.xml", PASS)
    os.utime(str(path), (1000.0, 1000.0))
    assert run(workspace)[0] == 0
    assert run(workspace, "--since", "2000")[::2] == (1, "0 passed, 1 failed, 0 skipped")


@pytest.mark.parametrize("text", ["", "<testsuite><testcase", "<testsuite tests='0'/>"])
def test_result_without_a_test_fails(workspace, text):
    result(workspace, "pytest-unit.xml").write_text(text)
    assert run(workspace)[::2] == (1, "0 passed, 1 failed, 0 skipped")


def test_nothing_ran_fails(workspace):
    result(workspace, "pytest-unit.xml", SKIP)
    assert run(workspace)[::2] == (1, "0 passed, 0 failed, 1 skipped")


def test_package_that_registers_nothing_fails(workspace):
    add_package(workspace, "beta", [])
    result(workspace, "pytest-unit.xml", PASS)
    code, text, _ = run(workspace)
    assert code == 1 and "registers none" in text


def test_wrapper_of_a_rostest_is_not_counted_twice(workspace):
    result(workspace, "pytest-unit.xml", PASS)
    result(workspace, "rostest-drive.xml", WRAPPER)
    result(workspace, "rosunit-drive.xml", PASS, PASS)
    assert run(workspace)[::2] == (0, "3 passed, 0 failed, 0 skipped")


def test_overwritten_rostest_result_fails(workspace):
    result(workspace, "pytest-unit.xml", PASS)
    result(workspace, "rostest-one.xml", WRAPPER)
    result(workspace, "rostest-two.xml", WRAPPER)
    result(workspace, "rosunit-drive.xml", PASS)
    code, text, _ = run(workspace)
    assert code == 1 and "test-name drive" in text


def test_problem_from_outside_fails(workspace):
    result(workspace, "pytest-unit.xml", PASS)
    code, text, last = run(workspace, "--problem", "the run was ended")
    assert (code, last) == (1, "1 passed, 1 failed, 0 skipped") and "the run was ended" in text


def test_package_whose_only_tests_are_registered_checks_counts(workspace):
    """A launch file check has no test file of its own."""
    add_package(workspace, "beta", ["roslaunch-check.xml"])
    (workspace / "src" / "beta" / "test" / "test_x.py").unlink()
    result(workspace, "pytest-unit.xml", PASS)
    result(workspace, "roslaunch-check.xml", '<testcase name="launch"><failure message="check failed"/></testcase>',
           "<system-out>cannot find package nowhere</system-out>", package="beta")
    code, text, last = run(workspace)
    assert (code, last) == (1, "1 passed, 1 failed, 0 skipped") and "cannot find package nowhere" in text


def test_unknown_package_is_named(workspace):
    result(workspace, "pytest-unit.xml", PASS)
    code, text, _ = run(workspace, "--since", "1", "gamma")
    assert code == 1 and "gamma is no package with tests (has alpha)" in text


def test_results_are_gathered_and_old_ones_removed(workspace):
    stale = workspace / "test_results" / "gone"
    stale.mkdir(parents=True)
    result(workspace, "pytest-unit.xml", PASS)
    run(workspace)
    assert [path.relative_to(workspace / "test_results").as_posix()
            for path in sorted((workspace / "test_results").rglob("*.xml"))] == ["alpha/pytest-unit.xml"]
    assert not stale.exists()


@pytest.fixture(name="ros_workspace")
def _ros_workspace(tmp_path):
    """A workspace with one package ``alpha`` that registers the ROS tests drive and turn, and unit tests."""
    add_package(tmp_path, "alpha", ["pytest-unit.xml", "rostest-drive.xml", "rostest-turn.xml"])
    registered = tmp_path / "catkin_build" / "alpha" / "CTestTestfile.cmake"
    registered.write_text("".join(
        line.replace("_ctest_alpha", "_ctest_alpha_rostest_%d" % number if "rostest-" in line else "_ctest_alpha_unit")
        + "\n" for number, line in enumerate(registered.read_text().splitlines())))
    result(tmp_path, "pytest-unit.xml", PASS)
    for name in ("drive", "turn"):
        result(tmp_path, "rostest-%s.xml" % name, WRAPPER.replace("drive", name))
        result(tmp_path, "rosunit-%s.xml" % name, PASS)
    return tmp_path


def repeat(root, outcomes, *arguments):
    """Repeat what failed; a run writes the next of ``outcomes``. Return the names of the tests that were run."""
    names = []

    def run_test(_, test):
        names.append(test.name)
        result(root, "rostest-drive.xml", WRAPPER)
        result(root, "rosunit-drive.xml", outcomes.pop(0))
    assert again.main([str(root), *arguments], run_test) == 0
    return names


def test_ros_test_that_passes_at_second_is_flaky(ros_workspace):
    result(ros_workspace, "rosunit-drive.xml", PASS, FAIL)
    assert repeat(ros_workspace, [PASS + PASS]) == ["_ctest_alpha_rostest_1"]
    code, text, last = run(ros_workspace)
    assert (code, last) == (0, "4 passed, 0 failed, 0 skipped")
    assert "FLAKY, failed in the first of two runs: alpha/rosunit-drive: c.test_b\n    1 != 2" in text
    assert (ros_workspace / "test_results" / "alpha" / again.FIRST_RUN / "rosunit-drive.xml").is_file()


def test_ros_test_that_fails_twice_has_failed(ros_workspace):
    result(ros_workspace, "rosunit-drive.xml", FAIL)
    repeat(ros_workspace, [FAIL])
    code, _, last = run(ros_workspace)
    assert (code, last) == (1, "2 passed, 1 failed, 0 skipped")


def test_ros_test_without_a_result_is_repeated(ros_workspace):
    (ros_workspace / "catkin_build" / "alpha" / "test_results" / "alpha" / "rostest-drive.xml").unlink()
    assert repeat(ros_workspace, [PASS]) == ["_ctest_alpha_rostest_1"]
    assert run(ros_workspace)[0] == 0


def test_unit_tests_are_not_repeated(ros_workspace):
    result(ros_workspace, "pytest-unit.xml", FAIL)
    assert repeat(ros_workspace, []) == []
    assert run(ros_workspace)[0] == 1


def test_many_failed_ros_tests_are_not_repeated(ros_workspace):
    for name in ("drive", "turn"):
        result(ros_workspace, "rosunit-%s.xml" % name, FAIL)
    assert repeat(ros_workspace, [], "--most", "1") == []
    assert run(ros_workspace)[0] == 1
