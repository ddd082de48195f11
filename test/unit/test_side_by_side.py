# SPDX-License-Identifier: BSD-3-Clause
"""`make test` runs TEST_JOBS tests of a package concurrently, by default two on more than one processor.

ROS tests by make; Python tests by pytest-xdist, where it is installed.
"""
import os
import re
import shutil
import subprocess

import pytest

import workspace_tree as tree

#: Like catkin: its own command line does not reach make.
CATKIN = '#!/bin/sh\necho "$PYTEST_ADDOPTS" > "{0}/options"\nexec make -f "{0}/tests.mk" run_tests\n'
#: Two tests; each waits some seconds at most until the expected number has started.
MAKEFILE = """
run_tests: one two
one two:
\t@echo "begin $@" >> {0}/log
\t@n=0; while [ $$(grep -c begin {0}/log) -lt {1} ] && [ $$n -lt 1000 ]; do sleep 0.01; n=$$((n + 1)); done
\t@sleep 0.1
\t@echo "end $@" >> {0}/log
"""


def program(path, text):
    path.write_text(text)
    path.chmod(0o755)


def begun_and_ended(folder, together, processors, jobs=None, pytest_options=None):
    """Run tools/test.sh in a temporary workspace; returns the log lines of its two tests, in order.

    ``pytest_options`` is the user's PYTEST_ADDOPTS; the one of the run that this test belongs to is not passed on.
    """
    for name in ("bin", "tools", "catkin_build", "src", "dropin", "test"):
        (folder / name).mkdir()
    for name in ("common.sh", "test.sh", "test_summary.py"):
        shutil.copy(os.path.join(tree.ROOT, "tools", name), str(folder / "tools" / name))
    (folder / "catkin_build" / ".m2wr_source_hash").write_text("")
    (folder / "os-release").write_text('ID=debian\nVERSION_ID="12"\n')
    (folder / "tests.mk").write_text(MAKEFILE.format(folder, together))
    program(folder / "bin" / "catkin", CATKIN.format(folder))
    program(folder / "bin" / "nproc", "#!/bin/sh\necho %d\n" % processors)
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith("TEST_") and name != "PYTEST_ADDOPTS"}
    if pytest_options is not None:
        environment["PYTEST_ADDOPTS"] = pytest_options
    environment.update(PATH="%s:%s" % (folder / "bin", environment["PATH"]),
                       M2WR_OS_RELEASE=str(folder / "os-release"), **({"TEST_JOBS": str(jobs)} if jobs else {}))
    done = subprocess.run([str(folder / "tools" / "test.sh")], env=environment, universal_newlines=True,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=100)
    assert (folder / "log").exists(), done.stdout
    return (folder / "log").read_text().split("\n")[:-1]


@pytest.mark.parametrize("processors, jobs", [(1, 2), (2, None), (16, None)])
def test_two_tests_run_together(tmp_path, processors, jobs):
    assert sorted(begun_and_ended(tmp_path, 2, processors, jobs)[:2]) == ["begin one", "begin two"]


@pytest.mark.parametrize("processors, jobs", [(2, 1), (1, None)])
def test_one_runs_after_the_other(tmp_path, processors, jobs):
    lines = begun_and_ended(tmp_path, 1, processors, jobs)
    assert [line.split()[0] for line in lines] == ["begin", "end", "begin", "end"]
    assert [line.split()[1] for line in lines[::2]] == [line.split()[1] for line in lines[1::2]]


@pytest.mark.parametrize("processors, jobs, expected", [
    (2, None, ["-n 2 "]), (16, 3, ["-n 3 "]), (1, None, []), (16, 1, [])])
def test_python_tests_use_as_many_processes(tmp_path, processors, jobs, expected):
    pytest.importorskip("xdist")
    begun_and_ended(tmp_path, 1, processors, jobs)
    options = (tmp_path / "options").read_text()
    assert "-q" in options and re.findall(r"-n \d+ ", options) == expected


def test_options_of_the_user_come_last(tmp_path):
    begun_and_ended(tmp_path, 1, 2, pytest_options="-n 5 -x")
    assert (tmp_path / "options").read_text().endswith(" -n 5 -x\n")
