# SPDX-License-Identifier: BSD-3-Clause
"""A program that loops, forks, fills the disk or takes memory is ended with all that it has started."""
import glob
import os
import time
from dataclasses import replace

import pytest

from m2wr_campaign.programs.containment import ContainedProgram, Limits, _sums, namespace
from m2wr_campaign.programs.warden import descendants
from m2wr_campaign.study.programs import read_program

PATIENCE = 60.0     # s
LIMITS = Limits(cpu=1.0, memory=200_000_000, file_size=4_000_000, disk=20_000_000, processes=50)
PACKAGE = "<package><name>mine</name></package>"


@pytest.fixture
def contained(tmp_path):
    """Returns a function that starts a script in limits; all are ended at the end."""
    started = []

    def start(script, arguments=(), limits=LIMITS):
        (tmp_path / "package.xml").write_text(PACKAGE)
        (tmp_path / "node.py").write_text("#!/usr/bin/env python\n" + script)
        program = read_program(str(tmp_path / "node.py"))
        started.append(ContainedProgram(program, arguments, "http://127.0.0.1:1", limits))
        return started[-1]

    yield start
    for one in started:
        one.end()


def wait_for_end(program):
    until = time.monotonic() + PATIENCE
    while program.running() and time.monotonic() < until:
        time.sleep(0.02)
    program._watch.join(PATIENCE)
    assert not program.running()


@pytest.mark.parametrize("script, told", [
    ("while True: pass", "processor time"),
    ("import os\nwhile True:\n    try:\n        os.fork()\n        os.setsid()\n    except OSError:\n        pass",
     "processes"),
    ("import os\nfor k in range(100):\n    open(os.path.join(os.environ['TMPDIR'], str(k)), 'wb').write(bytes(10**6))\n"
     "import time; time.sleep(100)", "files"),
    ("import time\nx = [bytearray(b'x' * 1000) for k in range(10**6)]\ntime.sleep(100)", "memory"),
], ids=["loops", "forks", "fills the disk", "takes memory"])
def test_a_program_beyond_a_limit_is_ended_with_its_reason(contained, script, told):
    program = contained(script, limits=replace(LIMITS, cpu=PATIENCE, memory=10**10) if told == "processes" else LIMITS)
    process = program._process.pid
    wait_for_end(program)
    assert told in program.problem
    assert not descendants(process)


def test_a_file_is_not_larger_than_its_limit(contained):
    program = contained("import os\ntry:\n    open('here', 'wb').write(bytes(10**7))\nexcept OSError as error:\n"
                        "    print('refused:', error.strerror)\nprint(os.path.getsize('here'))")
    wait_for_end(program)
    assert "4000000" in program.tail()


def test_what_a_program_leaves_behind_ends_with_it(contained):
    program = contained("import os, time\nif os.fork():\n    raise SystemExit(7)\nos.setsid()\nif os.fork():\n"
                        "    os._exit(0)\ntime.sleep(1000)")
    process = program._process.pid
    wait_for_end(program)
    assert program.exit_code() == 7 and not descendants(process)


def test_a_program_sees_its_own_folders_and_no_secrets(contained, monkeypatch):
    monkeypatch.setenv("SECRET_TOKEN", "42")
    program = contained("import os, sys\nprint(os.environ['HOME'], os.getcwd(), 'SECRET_TOKEN' in os.environ, "
                        "sys.argv)", [("speed", "0.5")])
    wait_for_end(program)
    told = program.tail()
    assert told.startswith(program.place + "/home ") and " False " in told and "_speed:=0.5" in told


@pytest.mark.skipif(not namespace(), reason="needs a kernel that gives namespaces to this user")
def test_files_outside_of_its_folder_are_read_only(contained, tmp_path_factory):
    aim = tmp_path_factory.mktemp("teacher") / "grades"
    aim.write_text("1")
    aim.chmod(0o666)
    program = contained("import os\nfor path in ({!r}, '/tmp/mine', '/dev/shm/mine'):\n    try:\n"
                        "        open(path, 'w').write('x')\n        print('wrote')\n    except OSError:\n"
                        "        print('refused')".format(str(aim)))
    wait_for_end(program)
    assert program.tail().split() == ["refused", "wrote", "wrote"]
    assert aim.read_text() == "1" and not os.path.exists("/tmp/mine") and not os.path.exists("/dev/shm/mine")


def test_its_folder_is_removed(contained):
    program = contained("print('done')")
    wait_for_end(program)
    program.end()
    assert not glob.glob(program.place)


def test_sums_are_those_of_this_process():
    cpu, memory, tasks = _sums([os.getpid()])
    assert cpu > 0.0 and memory > 10**7 and tasks >= 1
