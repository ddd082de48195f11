# SPDX-License-Identifier: BSD-3-Clause
"""The recorder's keeper: what is left of a recording can be read, and faults are sentences."""
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosbag
import rospy
from std_msgs.msg import String

from m2wr_tools.runs import record_run
from m2wr_tools.runs.record_run import Keeper, RecordError, check_place, check_room, keep_earlier, rescue

TEXT = "x" * 20000


def write_bag(path, messages=40):
    with rosbag.Bag(path, "w", chunk_threshold=50000) as bag:
        for number in range(messages):
            bag.write("/talk", String(data=TEXT), rospy.Time(1 + number))


def left_behind(tmp_path, share=0.7):
    """Return the name of a bag of which only a part was written, as a killed recorder leaves it."""
    path = str(tmp_path / "run.bag")
    write_bag(path)
    with open(path, "rb") as whole, open(path + ".active", "wb") as part:
        part.write(whole.read(int(os.path.getsize(path) * share)))
    os.remove(path)
    return path


@pytest.fixture
def small_files():
    """Files may be no larger than the function that is given says."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_what_a_killed_recorder_left_becomes_a_bag(tmp_path):
    path = left_behind(tmp_path)
    told = rescue(path)
    with rosbag.Bag(path) as bag:
        count = bag.get_message_count()
    assert 20 <= count < 40 and told == "%d messages up to there are in %s" % (count, path)
    assert not os.path.exists(path + ".active")


def test_without_disk_space_nothing_is_changed(tmp_path, small_files):
    path = left_behind(tmp_path)
    with open(path + ".active", "rb") as stream:
        before = stream.read()
    small_files(len(before) + 1000)
    told = rescue(path)
    with open(path + ".active", "rb") as stream:
        assert stream.read() == before
    assert "`rosbag reindex %s.active`" % path in told and not os.path.exists(path)
    with pytest.raises(OSError):
        check_room(path + ".active")


@pytest.mark.parametrize("content", [b"", b"no bag at all" * 100])
def test_nothing_that_can_be_read_is_said(tmp_path, content):
    path = str(tmp_path / "run.bag")
    with open(path + ".active", "wb") as stream:
        stream.write(content)
    assert "rosbag reindex" in rescue(path) or "nothing was recorded" in rescue(path)
    assert rescue(str(tmp_path / "other.bag")) == "nothing was recorded"


@pytest.mark.parametrize("messages, told", [(0, "nothing was recorded"), (3, "%s is complete")])
def test_a_bag_without_messages_is_not_called_complete(tmp_path, messages, told):
    path = str(tmp_path / "run.bag")
    write_bag(path, messages)
    assert rescue(path) == (told % path if "%" in told else told)


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    check_place(str(tmp_path / "run.bag"))
    assert os.listdir(str(tmp_path)) == []
    with pytest.raises(RecordError, match="no folder"):
        check_place(str(tmp_path / "nowhere" / "run.bag"))
    with pytest.raises(RecordError, match="is a folder"):
        check_place(str(tmp_path))
    with pytest.raises(RecordError, match="cannot be written"):
        check_place("/proc/run.bag")


def test_what_an_earlier_recorder_left_is_kept(tmp_path):
    path = left_behind(tmp_path)
    size = os.path.getsize(path + ".active")
    check_place(path)
    assert os.path.getsize(path + ".active") == size
    kept = keep_earlier(path)
    assert os.path.getsize(kept) == size and not os.path.exists(path + ".active")
    assert keep_earlier(path) is None


FAKE = """#!{python}
import os, signal, sys, time
path = sys.argv[sys.argv.index("-O") + 1]
if "{act}" == "work":
    signal.signal(signal.SIGINT, lambda *_: (open(path, "w").close(), sys.exit(0)))
    open(path + ".ready", "w").close()
    time.sleep(60)
sys.stderr.write("no space left")
os.abort()
"""


@pytest.fixture
def keeper(tmp_path, monkeypatch):
    """Return a keeper of a recorder that works, or breaks at once."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def make(act):
        program = tmp_path / "record"
        program.write_text(FAKE.format(python=sys.executable, act=act))
        program.chmod(0o755)
        monkeypatch.setattr(record_run, "find_recorder", lambda: str(program))
        return Keeper(str(tmp_path / "run.bag"), ["/talk", "__name:=record"])
    yield make
    for number, handler in before.items():
        signal.signal(number, handler)


def interrupt_when(path, number):
    """Send this process a signal as soon as a file exists."""
    def wait():
        deadline = time.monotonic() + 20.0
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        os.kill(os.getpid(), number)

    threading.Thread(target=wait, daemon=True).start()


@pytest.fixture
def master(monkeypatch):
    """Return the list of registrations that a master still has, as (topic, node)."""
    registered = [("/clock", "/record"), ("/clock", "/bug2")]

    class Master:
        def lookupNode(self, caller, name):     # noqa: N802, names of the ROS master API
            return (1, "", "http://127.0.0.1:9/") if name in [node for _, node in registered] else (-1, "unknown", "")

        def getSystemState(self, caller):       # noqa: N802
            return 1, "", ([], [[topic, [node]] for topic, node in registered], [])

        def unregisterSubscriber(self, caller, topic, address):     # noqa: N802
            registered.remove((topic, caller))
            return 1, "", 1

    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as server:
        server.register_instance(Master())
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:%d" % server.server_address[1])
        yield registered
        server.shutdown()


def test_a_late_registration_of_the_recorder_is_removed(keeper, master, tmp_path):
    interrupt_when(tmp_path / "run.bag.ready", signal.SIGINT)
    keeper("work").record()
    assert master == [("/clock", "/bug2")]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_lets_the_recorder_close_its_bag(keeper, tmp_path, number):
    interrupt_when(tmp_path / "run.bag.ready", number)
    keeper("work").record()
    assert (tmp_path / "run.bag").exists()


def test_a_recorder_that_breaks_is_told(keeper):
    with pytest.raises(RecordError, match="signal 6; is the disk full"):
        keeper("break").record()


@pytest.mark.skipif(shutil.which("roscore") is None, reason="no recorder without ROS")
def test_rosbags_recorder_is_found():
    done = subprocess.run([record_run.find_recorder(), "--help"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert b"--chunksize" in done.stdout and b"--tcpnodelay" in done.stdout and b"--min-space" in done.stdout
