#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs the ROS tests that failed once more, one at a time, and keeps the results of their first run.

A ROS test starts many processes and has deadlines, so a machine that is busy with other work can make it fail. A test
that passes now is listed as FLAKY, with the first message, in the summary of tools/test_summary.py; one that fails
again has failed. Unit tests are not repeated. If more than ``--most`` ROS tests failed, none is repeated: the cause is
then not the load of the machine.
"""
from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from typing import Callable, List, NamedTuple, Set

from test_summary import FAILED, FIRST_RUN, package_suites, packages_to_judge, read_cases

REGISTERED = re.compile(r'^add_test\((\S+rostest\S+) .*run_tests\.py"\s+"([^"]+)\.xml"', re.MULTILINE)


class RosTest(NamedTuple):
    """A ROS test as the build system knows it.

    Attributes
    ----------
    package : str
        Name of its package.
    name : str
        Name of the test for ctest.
    suites : set of str
        Names of its result files, without folder and extension.
    """

    package: str
    name: str
    suites: Set[str]


def ros_tests(build: str, package: str) -> List[RosTest]:
    """The registered ROS tests of a package.

    A ROS test writes ``rostest-<name>.xml``, with one case ``test<name>`` for each ``<test>`` tag, whose own results
    are in ``rosunit-<name>.xml``.
    """
    path = os.path.join(build, package, "CTestTestfile.cmake")
    if not os.path.isfile(path):
        return []
    with open(path, encoding="utf-8") as stream:
        registered = REGISTERED.findall(stream.read())
    tests = []
    for name, result in registered:
        suites = {os.path.basename(result)}
        try:
            tags = [case.name.rpartition(".")[2] for case in read_cases(result + ".xml")]
        except (OSError, SyntaxError):      # no result, or a file that is cut off
            tags = []
        suites.update("rosunit-" + tag[len("test"):] for tag in tags)
        tests.append(RosTest(package, name, suites))
    return tests


def failed_tests(build: str, packages: List[str], started: float) -> List[RosTest]:
    """ROS tests of the packages with a failed case or without a result.

    Parameters
    ----------
    build : str
        catkin build space.
    packages : list of str
        Names of packages.
    started : float
        Files last changed before this time [s since the epoch] are no results of this run.
    """
    found = []
    for package in packages:
        failed = {suite.name for suite in package_suites(build, package, started)
                  if any(case.outcome == FAILED for case in suite.cases)}
        found.extend(test for test in ros_tests(build, package) if test.suites & failed)
    return found


def keep_first_run(build: str, test: RosTest) -> None:
    """Move the result files of a test to the folder of first runs of its package."""
    folder = os.path.join(build, test.package, FIRST_RUN)
    os.makedirs(folder, exist_ok=True)
    for where, _, files in os.walk(os.path.join(build, test.package, "test_results")):
        for file in files:
            if os.path.splitext(file)[0] in test.suites:
                shutil.move(os.path.join(where, file), os.path.join(folder, file))


def run_again(build: str, test: RosTest) -> None:
    """Run one test by ctest; its result files say how it ended."""
    subprocess.run(["ctest", "-V", "-R", "^{}$".format(re.escape(test.name))], cwd=os.path.join(build, test.package),
                   stdin=subprocess.DEVNULL, check=False)


def main(argv: List[str], run: Callable[[str, RosTest], None] = run_again) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("workspace", help="root of the workspace")
    parser.add_argument("--build", help="catkin build space (default: WORKSPACE/catkin_build)")
    parser.add_argument("--since", type=float, default=0.0, help="ignore results older than this [s since the epoch]")
    parser.add_argument("--most", type=int, default=5, help="repeat nothing if more tests than this failed")
    parser.add_argument("packages", nargs="*", help="only these packages (default: all with test files)")
    args = parser.parse_intermixed_args(argv)
    build = args.build or os.path.join(args.workspace, "catkin_build")
    known = packages_to_judge(args.workspace, build)
    packages = sorted(set(args.packages) & known if args.packages else known)
    for package in packages:
        shutil.rmtree(os.path.join(build, package, FIRST_RUN), ignore_errors=True)
    failed = failed_tests(build, packages, args.since)
    if len(failed) > args.most:
        print("{} ROS tests failed, more than {}: none is repeated".format(len(failed), args.most))
        return 0
    for test in failed:
        print("repeating {}, alone".format(test.name), flush=True)
        keep_first_run(build, test)
        run(build, test)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
