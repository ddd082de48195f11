#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Collects the JUnit XML of every package into one folder and prints one summary; exit 0 only if all tests passed.

Reads what the build system promised (the result file of each registered test, from CTestTestfile.cmake) and what the
tests wrote, so a test that died, was never started or left an empty file counts as failed. Last line on stdout, alone:
``123 passed, 0 failed, 1 skipped`` (errors count as failed).
"""
from __future__ import annotations

import argparse
import collections
import os
import re
import shutil
import sys
import xml.etree.ElementTree as ElementTree
from typing import Dict, Iterable, List, Optional, Sequence, Set, TextIO

Case = collections.namedtuple("Case", "name outcome seconds message")
Suite = collections.namedtuple("Suite", "package name cases")

PASSED, FAILED, SKIPPED = "passed", "failed", "skipped"
FIRST_RUN = "test_results_first_run"    # of a package; results of the ROS tests that tools/test_again.py has repeated
RESULT_OF_TEST = re.compile(r'run_tests\.py"\s+"([^"]+\.xml)"')
TEST_FILE = re.compile(r"^(test_.*\.py|.*\.test)$")
PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")


def packages_to_judge(workspace: str, build: str) -> Set[str]:
    """Names of the packages under src/, dropin/ and test/ that hold a test file or have registered a test.

    Parameters
    ----------
    workspace, build : str
        Root of the workspace and its catkin build space.

    Returns
    -------
    set of str
    """
    found = set()
    for top in ("src", "dropin", "test"):
        for folder, folders, files in os.walk(os.path.join(workspace, top)):
            if "CATKIN_IGNORE" in files:
                folders[:] = []
            elif "package.xml" in files:
                folders[:] = []
                has_tests = any(TEST_FILE.match(name) for _, _, names in os.walk(folder) for name in names)
                with open(os.path.join(folder, "package.xml"), encoding="utf-8") as stream:
                    name = PACKAGE_NAME.findall(stream.read())[0]
                if has_tests or promised_results(build, name):
                    found.add(name)
    return found


def promised_results(build: str, package: str) -> List[str]:
    """Result files of the tests that a package has registered, according to the build system.

    Returns
    -------
    list of str
        Absolute paths; empty if the package was not configured or registers nothing.
    """
    path = os.path.join(build, package, "CTestTestfile.cmake")
    if not os.path.isfile(path):
        return []
    with open(path, encoding="utf-8") as stream:
        return sorted(set(RESULT_OF_TEST.findall(stream.read())))


def read_cases(path: str) -> List[Case]:
    """Test cases of one JUnit XML file.

    Returns
    -------
    list of Case

    Raises
    ------
    xml.etree.ElementTree.ParseError
        If the file is empty or not XML (a test that was killed while it ran).
    """
    cases = []
    suite = ElementTree.parse(path).getroot()
    for element in suite.iter("testcase"):
        name = ".".join(part for part in (element.get("classname"), element.get("name")) if part)
        outcome, message = PASSED, ""
        for child in element:
            if child.tag in ("failure", "error"):
                outcome = FAILED
                # roslaunch's file check writes the reason to the output of the whole suite
                message = (child.text or "\n".join(
                    [child.get("message") or child.tag, suite.findtext("system-out") or ""])).strip()
            elif child.tag == "skipped" and outcome == PASSED:
                outcome = SKIPPED
                message = (child.get("message") or child.text or "").strip()
        cases.append(Case(name, outcome, float(element.get("time") or 0.0), message))
    return cases


def is_wrapper(case: Case, suite_name: str, readable: Dict[str, List[Case]]) -> bool:
    """Whether a case only represents a rostest, whose own result file has the results.

    rostest writes one case ``test<name>`` a ``<test>`` tag beside ``rosunit-<name>.xml`` with the real ones. A failed
    one is kept: it tells of a time limit or a node that died.
    """
    name = case.name.rpartition(".")[2]
    return (suite_name.startswith("rostest-") and case.outcome == PASSED and name.startswith("test")
            and bool(readable.get("rosunit-{}.xml".format(name[len("test"):]))))


def shared_test_names(readable: Dict[str, List[Case]]) -> List[str]:
    """Test names that more than one rostest of a package uses, though their results go to one file."""
    owners = collections.Counter(case.name.rpartition(".")[2][len("test"):] for name, cases in readable.items()
                                 for case in cases if name.startswith("rostest-"))
    return sorted(name for name, number in owners.items() if number > 1)


def package_suites(build: str, package: str, started: float) -> List[Suite]:
    """Suites of one package, one for each result file, with a failed case for each missing or unusable result.

    Parameters
    ----------
    build : str
        catkin build space.
    package : str
        Name of the package.
    started : float
        Files last changed before this time [s since the epoch] are left over from an earlier run and count as missing.

    Returns
    -------
    list of Suite
    """
    folder = os.path.join(build, package, "test_results")
    promised = promised_results(build, package)
    paths = {path for path in promised if os.path.isfile(path)}
    for where, _, files in os.walk(folder):
        paths.update(os.path.join(where, name) for name in files if name.endswith(".xml"))
    readable, broken = {}, {}
    for path in sorted(paths):
        name = os.path.basename(path)
        if os.path.getmtime(path) < started:
            broken[path] = "{} was not written by this run".format(path)
            continue
        try:
            readable[name] = read_cases(path)
        except ElementTree.ParseError as error:
            broken[path] = "{} is no readable JUnit XML ({}); was the test ended while it ran?".format(path, error)
            continue
        if not readable[name]:
            broken[path] = "{} holds no test case: nothing ran".format(path)
    for name in shared_test_names(readable):
        broken[name] = "several <test> tags of {} have the test-name {}: each overwrites the last one's result".format(
            package, name)
    suites = [Suite(package, name[:-len(".xml")], [case for case in cases if not is_wrapper(case, name, readable)])
              for name, cases in readable.items()]
    for path in promised:
        if path not in paths:
            broken[path] = "{} is missing: the test did not run or wrote no result".format(path)
    for path, message in broken.items():
        name = os.path.splitext(os.path.basename(path))[0]
        suites.append(Suite(package, name, [Case("result file", FAILED, 0.0, message)]))
    if not promised:
        suites.append(Suite(package, "(no suite)", [Case("registration", FAILED, 0.0,
                      "{} holds test files, but {} registers none".format(package, os.path.join(build, package)))]))
    return [suite for suite in suites if suite.cases]


def first_failures(build: str, package: str) -> List[Suite]:
    """Suites with the failed cases of the first run of those ROS tests that ``tools/test_again.py`` has repeated."""
    folder = os.path.join(build, package, FIRST_RUN)
    suites = []
    for name in sorted(os.listdir(folder)) if os.path.isdir(folder) else []:
        try:
            cases = [case for case in read_cases(os.path.join(folder, name)) if case.outcome == FAILED]
        except ElementTree.ParseError as error:
            cases = [Case("result file", FAILED, 0.0, "no readable JUnit XML ({})".format(error))]
        if cases:
            suites.append(Suite(package, os.path.splitext(name)[0], cases))
    return suites


def collect(build: str, package: str, target: str) -> None:
    """Copy a package's result files to ``target/<package>/``."""
    for folder, copies in (("test_results", package), (FIRST_RUN, os.path.join(package, FIRST_RUN))):
        for where, _, files in os.walk(os.path.join(build, package, folder)):
            for name in files:
                if name.endswith(".xml"):
                    os.makedirs(os.path.join(target, copies), exist_ok=True)
                    shutil.copy2(os.path.join(where, name), os.path.join(target, copies, name))


def count(cases: Iterable[Case], outcome: str) -> int:
    """Number of cases with the given outcome."""
    return sum(case.outcome == outcome for case in cases)


def closing_line(suites: List[Suite], problems: List[str]) -> str:
    """The result in one line."""
    cases = [case for suite in suites for case in suite.cases]
    return "{} passed, {} failed, {} skipped".format(
        count(cases, PASSED), count(cases, FAILED) + len(problems), count(cases, SKIPPED))


def print_cases(title: str, suites: List[Suite], outcome: str, out: TextIO) -> None:
    """Print the cases with this outcome and their messages, long ones shortened."""
    for suite in sorted(suites):
        for case in suite.cases:
            if case.outcome == outcome:
                print("\n{}: {}/{}: {}".format(title, suite.package, suite.name, case.name), file=out)
                lines = case.message.splitlines()
                lines = lines if len(lines) <= 50 else lines[:10] + ["[...]"] + lines[-40:]
                print("\n".join("    " + line for line in lines), file=out)


def report(suites: List[Suite], problems: List[str], out: TextIO, repeated: Sequence[Suite] = ()) -> bool:
    """Print table, skips, failures and the closing line.

    ``repeated`` holds the failures of ROS tests that were run a second time; they are listed as FLAKY and not counted,
    because the second result is among the suites.

    Returns
    -------
    bool
        True if at least one test passed and nothing failed.
    """
    cases = [case for suite in suites for case in suite.cases]
    width = max([len(suite.package + suite.name) for suite in suites] + [20]) + 1
    print("\n{:<{w}} {:>7} {:>7} {:>7} {:>9}".format("suite", "passed", "failed", "skipped", "time", w=width), file=out)
    for suite in sorted(suites):
        print("{:<{w}} {:>7} {:>7} {:>7} {:>7.1f} s".format(
            suite.package + "/" + suite.name, count(suite.cases, PASSED), count(suite.cases, FAILED),
            count(suite.cases, SKIPPED), sum(case.seconds for case in suite.cases), w=width), file=out)
    print_cases("SKIPPED", suites, SKIPPED, out)
    print_cases("FLAKY, failed in the first of two runs", list(repeated), FAILED, out)
    print_cases("FAILED", suites, FAILED, out)
    for problem in problems:
        print("\nFAILED: " + problem, file=out)
    print("\n" + closing_line(suites, problems), file=out)
    return count(cases, PASSED) > 0 and count(cases, FAILED) + len(problems) == 0


def main(argv: Optional[List[str]] = None, out: TextIO = sys.stdout) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("workspace", help="root of the workspace")
    parser.add_argument("--build", help="catkin build space (default: WORKSPACE/catkin_build)")
    parser.add_argument("--collect", metavar="DIR",
                        help="folder for the XML files, emptied first (default: WORKSPACE/test_results)")
    parser.add_argument("--since", type=float, default=0.0, help="ignore results older than this [s since the epoch]")
    parser.add_argument("--problem", action="append", default=[], help="a failure outside the tests")
    parser.add_argument("packages", nargs="*", help="only these packages (default: all with test files)")
    args = parser.parse_intermixed_args(argv)
    build = args.build or os.path.join(args.workspace, "catkin_build")
    target = args.collect or os.path.join(args.workspace, "test_results")
    shutil.rmtree(target, ignore_errors=True)
    known = packages_to_judge(args.workspace, build)
    problems = list(args.problem)
    if not known:
        problems.append("no package with a test file under {0}/src and {0}/test".format(args.workspace))
    for name in sorted(set(args.packages) - known):
        problems.append("{} is no package with tests (has {})".format(name, ", ".join(sorted(known)) or "none"))
    suites, repeated = [], []
    for package in sorted(set(args.packages) & known if args.packages else known):
        suites.extend(package_suites(build, package, args.since))
        repeated.extend(first_failures(build, package))
        collect(build, package, target)
    os.makedirs(target, exist_ok=True)
    with open(os.path.join(target, "summary.txt"), "w") as stream:
        stream.write(closing_line(suites, problems) + "\n")
    return 0 if report(suites, problems, out, repeated) else 1


if __name__ == "__main__":
    sys.exit(main())
