# SPDX-License-Identifier: BSD-3-Clause
"""A node ends when it is interrupted, at any moment of its start."""
import os
import signal
import socket
import subprocess
import sys
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from m2wr_node.ros import starting

PROGRAM = """
import sys
import rospy
from m2wr_node.ros.starting import note_signals, register, start_node
at = sys.argv[1]
begin = rospy.impl.init.start_node


def start(*words, **options):
    print("begun", flush=True)
    if at == "fails":
        raise RuntimeError("of its own")
    return begin(*words, **options)


rospy.impl.init.start_node = start
if at == "notes":
    noted = note_signals()
    register("early", lambda: bool(noted))
else:
    start_node("early")
print("registered", flush=True)
rospy.spin()
"""


@pytest.fixture
def begin():
    """Return a function that starts the program and waits for its first line, with or without a master."""
    started = []

    def make(word, port):
        environment = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:%d" % port)
        child = subprocess.Popen([sys.executable, "-u", "-c", PROGRAM, word], stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT, env=environment, universal_newlines=True)
        started.append((child, threading.Timer(60, child.kill)))       # a silent program does not block the reader
        started[-1][1].start()
        return child, child.stdout.readline()
    yield make
    for child, deadline in started:
        deadline.cancel()
        child.kill()
        child.communicate()


def rest_of(child):
    """Return the rest of a program's output until it ends; ``communicate`` would lose what is buffered."""
    said = child.stdout.read()
    child.wait()
    return said


@pytest.fixture
def silent_master():
    """Port of a master that accepts connections and does not answer, as in a debugger."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(10)
        yield server.getsockname()[1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_waits_for_a_master_can_be_interrupted(begin, number):
    child, said = begin("waits", 1)
    assert said == "early: no master answers at http://127.0.0.1:1 yet; waiting for roscore or roslaunch\n"
    child.send_signal(number)
    said = rest_of(child)
    assert child.returncode == 1 and "Traceback" not in said


@pytest.mark.parametrize("uri", ["localhost:11311", "http://", "http://127.0.0.1:99999", "http://a..b:11311"])
def test_an_address_that_is_none_is_told(uri):
    done = subprocess.run([sys.executable, "-c", PROGRAM, "waits"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env=dict(os.environ, ROS_MASTER_URI=uri), universal_newlines=True, timeout=30)
    assert done.returncode == 1 and "expected http://HOST:PORT" in done.stdout and "Traceback" not in done.stdout


class DyingMaster(SimpleXMLRPCServer):
    """Answers so many calls and then closes; ``port`` is its port."""

    def __init__(self, calls):
        super().__init__(("127.0.0.1", 0), logRequests=False)
        self.port, self._left = self.server_address[1], calls
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        while self._left:
            self.handle_request()
        self.server_close()

    def _dispatch(self, method, params):
        self._left -= 1
        return [1, "", [] if method.startswith("register") else 0]


@pytest.mark.parametrize("calls", (1, 3, 4, 5))
def test_a_master_that_dies_keeps_no_node_alive(begin, calls):
    child, said = begin("dies", DyingMaster(calls).port)
    while said and not any(words in said for words in ("Unable to", "has gone", "registered")):     # the first: rospy's
        line = child.stdout.readline()
        said = said + line if line else ""
    child.send_signal(signal.SIGINT)
    rest = rest_of(child)
    assert child.returncode in (0, 1) and "Traceback" not in said + rest


def test_a_master_that_has_gone_is_named(begin):
    master = DyingMaster(1)
    child, _ = begin("dies", master.port)
    said = rest_of(child)
    assert child.returncode == 1 and "Traceback" not in said
    assert "early: the master at http://127.0.0.1:%d has gone" % master.port in said


@pytest.mark.parametrize("word", ["hangs", "notes"])
def test_the_next_signal_ends_what_hangs_on_a_silent_master(begin, word):
    with socket.socket() as master:
        master.bind(("127.0.0.1", 0))
        master.listen(10)
        master.settimeout(30)
        child, _ = begin(word, master.getsockname()[1])
        connections = [master.accept()[0]]
        while not connections[-1].recv(1):                  # the first only tests whether there is a master
            connections.append(master.accept()[0])
        child.send_signal(signal.SIGINT)
        with pytest.raises(subprocess.TimeoutExpired):      # the thread that registers waits for an answer
            child.wait(starting.STUCK + 0.5)
        for _ in range(10):                                 # a busy machine may have noted the first one late
            child.send_signal(signal.SIGINT)
            try:
                child.wait(3)
                break
            except subprocess.TimeoutExpired:
                continue
        assert child.returncode == -signal.SIGINT


def test_a_fault_of_its_own_is_told(begin, silent_master):
    child, _ = begin("fails", silent_master)
    said = rest_of(child)
    assert "RuntimeError: of its own" in said


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_the_interrupted_thread_continues(monkeypatch, number):
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    signal.signal(signal.SIGHUP, signal.SIG_DFL)            # this may run below nohup
    told = []
    monkeypatch.setattr(starting.rospy, "signal_shutdown", lambda reason: told.append(
        (reason, starting.threading.current_thread() is starting.threading.main_thread())))
    try:
        starting.shut_down_in_thread()
        os.kill(os.getpid(), number)
        for thread in starting.threading.enumerate():
            if thread is not starting.threading.current_thread() and not thread.daemon:
                thread.join(5.0)
    finally:
        for restored, handler in before.items():
            signal.signal(restored, handler)
    assert told == [("signal-%d" % number, False)]


def test_nohup_keeps_a_node_alive_when_its_terminal_goes():
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in numbers}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        starting.shut_down_in_thread()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
