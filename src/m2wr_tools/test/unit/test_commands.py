# SPDX-License-Identifier: BSD-3-Clause
"""The small commands: what they import, what they refuse, and a call of a service without a node."""
import io
import os
import socket
import struct
import subprocess
import sys
import threading

import pytest
from std_srvs.srv import Trigger, TriggerResponse

from m2wr_tools import service_client, time_commands
from m2wr_tools.service_client import CallError, Connection

NODES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "m2wr_sim")
HEAVY = ("numba", "llvmlite", "matplotlib", "scipy", "PIL", "cairo", "lxml", "numpy", "rospy", "yaml", "tf2_ros")
HELP = ["-h"]
CALLS = [("pause", []), ("unpause", []), ("step", ["3"]), ("speed", ["2"]), ("list_obstacles", []),
         ("move_obstacle", ["a", "--at", "1", "1"]), ("delete_obstacle", ["a"]),
         ("add_obstacle", ["box", "--at", "1", "1"])]
LOADED = """
import runpy, sys
path = sys.argv[1]
sys.argv = sys.argv[1:]
try:
    runpy.run_path(path, run_name="__main__")
except SystemExit:
    pass
print("LOADED", *sorted({name.split(".")[0] for name in sys.modules}))
"""


def loaded(command, words):
    """Return the top-level modules that a command line has loaded at its end."""
    done = subprocess.run([sys.executable, "-c", LOADED, os.path.join(NODES, command)] + words, text=True,
                          capture_output=True, timeout=120, env=dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:1"))
    return set(done.stdout.split("LOADED", 1)[1].split())


PICTURES = {"numba", "llvmlite", "matplotlib", "scipy", "PIL", "cairo", "ode", "tf2_ros"}


@pytest.mark.parametrize("command", [name for name, _ in CALLS] + [
    "doctor", "demo", "benchmark", "compare_map", os.path.join("..", "m2wr_gmapping", "plot_map")])
def test_help_loads_nothing_heavy(command):
    assert not loaded(command, HELP) & set(HEAVY + ("genpy", "gazebo_msgs"))


SPAWN_MODEL = os.path.join("..", "..", "..", "m2wr_sim", "nodes", "spawn_model")


@pytest.mark.parametrize("command", [SPAWN_MODEL, "place_robot", "bag_report", "record_run", "wander_robots"])
def test_help_of_a_node_loads_what_nodes_need(command):
    """rospy itself loads genpy, numpy and yaml."""
    assert not loaded(command, HELP) & PICTURES


def test_the_doctor_looks_at_files_without_numbers_and_pictures():
    assert not loaded("doctor", []) & (PICTURES | {"lxml"})


def test_calls_load_nothing_heavy():
    """A call needs genpy, which reads messages and itself loads numpy and yaml."""
    done = subprocess.run([sys.executable, "-c", "import sys; import m2wr_tools.service_client, "
                           "m2wr_tools.time_commands, m2wr_tools.obstacles.commands, m2wr_tools.obstacles.world; "
                           "print(*{name.split('.')[0] for name in sys.modules})"],
                          text=True, capture_output=True, timeout=120, check=True)
    assert not set(done.stdout.split()) & (set(HEAVY) - {"numpy", "yaml"})


@pytest.mark.parametrize("command, words", CALLS)
def test_without_a_master_a_command_says_what_to_start(command, words):
    done = subprocess.run([sys.executable, os.path.join(NODES, command)] + words, text=True, capture_output=True,
                          timeout=120, env=dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:1"))
    assert done.returncode == 1 and "no ROS master at http://127.0.0.1:1" in done.stderr


@pytest.mark.parametrize("command, words", [("step", ["0"]), ("step", ["x"]), ("step", ["1000001"]), ("speed", ["-1"]),
                                            ("speed", ["nan"]), ("speed", ["inf"]), ("pause", ["now"])])
def test_misuse_ends_with_2(command, words, capsys):
    with pytest.raises(SystemExit) as ended:
        time_commands.main(command, [command] + words)
    assert ended.value.code == 2 and "usage" in capsys.readouterr().err


class Server:
    """A service of TCPROS that gives prepared answers."""

    def __init__(self, monkeypatch, *answers):
        listener = socket.create_server(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        monkeypatch.setattr(service_client.rosgraph.Master, "lookupService",
                            lambda *_: "rosrpc://127.0.0.1:%d" % port)
        self.header = b""
        threading.Thread(target=self._serve, args=(listener, answers), daemon=True).start()

    @staticmethod
    def _block(stream):
        return stream.read(struct.unpack("<I", stream.read(4))[0])

    def _serve(self, listener, answers):
        with listener, listener.accept()[0] as connection, connection.makefile("rwb") as stream:
            self.header = self._block(stream)
            stream.write(struct.pack("<I", 0))
            stream.flush()
            for answer in answers:
                self._block(stream)
                stream.write(answer)
                stream.flush()


def good(response):
    """Return the bytes of an answer."""
    body = io.BytesIO()
    response.serialize(body)
    return b"\x01" + struct.pack("<I", body.tell()) + body.getvalue()


def test_two_calls_over_one_connection(monkeypatch):
    server = Server(monkeypatch, good(TriggerResponse(True, "a")), good(TriggerResponse(False, "b")))
    service = Connection("/gazebo/step", Trigger)
    assert service() == TriggerResponse(True, "a") and service() == TriggerResponse(False, "b")
    assert b"md5sum=" + Trigger._md5sum.encode() in server.header and b"persistent=1" in server.header


@pytest.mark.parametrize("answer, told", [(b"\x00" + struct.pack("<I", 4) + b"lost", "lost"), (b"", "closed"),
                                          (b"\x01" + struct.pack("<I", 1 << 31), "bytes")])
def test_an_answer_that_is_none_is_told(monkeypatch, answer, told):
    Server(monkeypatch, answer)
    with pytest.raises(CallError, match=told):
        Connection("/gazebo/step", Trigger)()


def test_a_refusal_tells_how_many_steps_are_done(monkeypatch, capsys):
    Server(monkeypatch, good(TriggerResponse(True, "time is 1 s")), good(TriggerResponse(False, "time is running")))
    monkeypatch.setattr(time_commands, "no_master", lambda: None)
    assert time_commands.main("step", ["step", "5"]) == 1
    assert "time is running (1 of 5 steps done)" in capsys.readouterr().err
