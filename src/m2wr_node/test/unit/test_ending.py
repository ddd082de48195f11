# SPDX-License-Identifier: BSD-3-Clause
"""A required node that has done its work stops its roslaunch, and no banner calls that a death."""
import os
import signal
import socket
import subprocess
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from m2wr_node.ros import ending

LIMIT = 60      # s, for a machine that is busy
# a node of the launch file below: it ends the run, then waits for the signal that roslaunch sends to all
PROGRAM = """
import signal
import sys
from m2wr_node.ros.ending import end_run
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
asked = end_run()
print("asked: %s" % asked, flush=True)
if asked:
    print("told: %s" % (signal.sigtimedwait([signal.SIGINT], 30) is not None), flush=True)
open(sys.argv[1], "w").close()
"""
# required: roslaunch ends with it, at the latest when the other one has ended
BESIDE = """
import os
import sys
import time
while not os.path.exists(sys.argv[1]):
    time.sleep(0.05)
"""
LAUNCH = """<launch>
  <node pkg="m2wr_node" type="is_there" name="worker" output="screen" required="{required}"
        launch-prefix="/usr/bin/python3 {folder}/worker.py {folder}/done"/>
  <node pkg="m2wr_node" type="is_there" name="beside" output="screen" required="true"
        launch-prefix="/usr/bin/python3 {folder}/beside.py {folder}/done"/>
</launch>
"""


def run(folder, required):
    """Run the launch file; returns its exit code and what it said."""
    (folder / "worker.py").write_text(PROGRAM)
    (folder / "beside.py").write_text(BESIDE)
    (folder / "run.launch").write_text(LAUNCH.format(required=required, folder=folder))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    done = subprocess.run(
        ["roslaunch", "-p", str(port), "--skip-log-check", str(folder / "run.launch")], stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, universal_newlines=True, timeout=LIMIT, stdin=subprocess.DEVNULL,
        env=dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:%d" % port, ROS_HOME=str(folder),
                 ROS_HOSTNAME="127.0.0.1", PYTHONUNBUFFERED="1"))
    return done.returncode, done.stdout


def test_a_required_node_ends_the_run_without_a_banner(tmp_path):
    code, text = run(tmp_path, "true")
    assert "asked: True" in text and "told: True" in text, text
    assert code == 0 and "REQUIRED" not in text, text


def test_a_node_that_is_not_required_ends_nothing(tmp_path):
    code, text = run(tmp_path, "false")
    assert "asked: False" in text and code == 0, text


class Master:
    """A parameter server that knows one thing."""

    def __init__(self, uris):
        self._uris = uris

    def getParam(self, _):              # noqa: N802 (the master's own name)
        return self._uris


class Roslaunch:
    """What of roslaunch's server is asked."""

    def __init__(self, pid, processes):
        self._pid, self._processes = pid, processes

    def get_pid(self):
        return 1, str(self._pid), self._pid

    def get_node_names(self):
        return 1, "node names", list(self._processes)

    def process_info(self, name):
        return 1, "process info", self._processes[name]


@pytest.fixture
def serve():
    """Return a function that serves an object over XML-RPC and returns its address."""
    servers = []

    def begin(thing):
        server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
        server.register_instance(thing)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        servers.append(server)
        return "http://127.0.0.1:%d/" % server.server_address[1]
    yield begin
    for server in servers:
        server.shutdown()
        server.server_close()


IDS = [30, 20, 10, 1]       # this process, what it was started through, roslaunch, the first of all


@pytest.mark.parametrize("pid, info, found", [
    (10, {"required": True, "pid": 30}, 10),
    (10, {"required": True, "pid": 20}, 10),        # by a launch-prefix
    (10, {"required": False, "pid": 30}, None),
    (10, {"required": True, "pid": 31}, None),      # another node
    (11, {"required": True, "pid": 30}, None),      # another roslaunch
    (10, {"required": True}, None),
    (10, {"required": True, "pid": 1}, None),       # above roslaunch itself
])
def test_only_the_requiring_roslaunch_is_asked(serve, pid, info, found):
    # None cannot be sent: a fault, as of what roslaunch knows of its master
    address = serve(Roslaunch(pid, {"master": {"pid": None}, "worker-1": info}))
    assert ending.roslaunch_that_requires(IDS, Master({"a": address})) == found


@pytest.mark.parametrize("uris", [None, 3, {}, {"a": 3}, {"a": "nonsense"}, {"a": "http://127.0.0.1:1/"},
                                  {"a": "http://[::1"}])
def test_addresses_left_behind_and_nonsense_are_passed_over(serve, uris):
    assert ending.roslaunch_that_requires(IDS, Master(uris)) is None
    if isinstance(uris, dict):
        uris["b"] = serve(Roslaunch(10, {"worker-1": {"required": True, "pid": 30}}))
        assert ending.roslaunch_that_requires(IDS, Master(uris)) == 10


def test_ancestry_ends_at_the_first_process_or_a_loop():
    assert ending.ancestry(30, {30: 20, 20: 1, 1: 0}.get) == [30, 20, 1]
    assert ending.ancestry(30, {30: 20, 20: 30}.get) == [30, 20]
    assert ending.ancestry()[:2] == [os.getpid(), os.getppid()]


def test_the_signal_is_that_of_ctrl_c(monkeypatch):
    monkeypatch.setattr(ending, "roslaunch_that_requires", lambda ids, master: 10)
    sent = []
    assert ending.end_run(kill=lambda *words: sent.append(words)) and sent == [(10, signal.SIGINT)]

    def refuse(*_):
        raise ProcessLookupError

    assert not ending.end_run(kill=refuse)
