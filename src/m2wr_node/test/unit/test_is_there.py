# SPDX-License-Identifier: BSD-3-Clause
"""Looking for nodes and publishers before a launch file starts its own."""
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosgraph

from m2wr_node.ros import is_there


class Master:
    """One simulation that publishes /clock, and one of which only the name is left."""

    def getSystemState(self):
        return [["/clock", ["/dead", "/gazebo"]], ["/old", ["/dead"]]], [], []

    def lookupNode(self, name):
        if name not in ("/dead", "/gazebo", "/robot_state_publisher"):
            raise rosgraph.MasterError("unknown node [%s]" % name)
        return name


def look(name):
    return is_there.who_is_there(name, Master(), lambda address, name: address == name != "/dead")


@pytest.mark.parametrize("name, found", [
    ("/clock", "/gazebo"), ("/robot_state_publisher", "/robot_state_publisher"), ("/old", None), ("/dead", None),
    ("/scan", None)])
def test_only_what_answers_is_there(name, found):
    assert look(name) == found


def test_without_a_master_nothing_is_there(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    assert is_there.who_is_there("/clock") is None
    assert not is_there.alive("http://127.0.0.1:1")


@pytest.fixture
def node():
    """Return a function that starts the server of a node with some calls, and returns its address."""
    servers = []

    def make(**calls):
        servers.append(SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False))
        for name, answer in calls.items():
            servers[-1].register_function(lambda _, answer=answer: [1, "", answer], name)
        threading.Thread(target=servers[-1].serve_forever, args=(0.05,), daemon=True).start()
        return "http://127.0.0.1:%d" % servers[-1].server_address[1]

    yield make
    for server in servers:
        server.shutdown()
        server.server_close()


def test_another_node_at_an_old_address_is_not_it(node):
    of_rospy, of_roscpp = node(getName="/gazebo", getPid=7), node(getPid=7)
    assert is_there.alive(of_rospy, "/gazebo") and is_there.alive(of_rospy)
    assert not is_there.alive(of_rospy, "/bug2")
    assert is_there.alive(of_roscpp, "/bug2") and not is_there.alive(node(), "/bug2")


@pytest.mark.parametrize("found, said", [(None, ["false", "alone.rviz"]), ("/gazebo", ["true", "world.rviz"])])
def test_words_for_launch_files(monkeypatch, capsys, found, said):
    monkeypatch.setattr(is_there, "who_is_there", lambda name: found)
    assert is_there.main(["/clock"]) == is_there.main(["/clock", "--print", "world.rviz", "alone.rviz"]) == 0
    assert capsys.readouterr().out == "\n".join(said)


def test_a_command_is_run_unless_it_is_there(monkeypatch, capsys):
    run, command = [], ["/usr/bin/python3", "/lib/joint_state_publisher", "__name:=j"]
    monkeypatch.setattr(is_there, "who_is_there", lambda name: None)
    is_there.main(["/joint_states", "--else"] + command, lambda program, words: run.append((program, words)))
    assert run == [("/usr/bin/python3", command)]
    monkeypatch.setattr(is_there, "who_is_there", lambda name: "/gazebo")
    capsys.readouterr()
    assert is_there.main(["/joint_states", "--else"] + command, lambda *_: run.append("again")) == 0
    assert len(run) == 1
    assert capsys.readouterr().err == \
        "/joint_states is there already, by /gazebo: joint_state_publisher is not started\n"
    is_there.main(["/a", "--else", "/lib/robot_state_publisher", "__name:=a"])
    assert capsys.readouterr().err == "/a is there already, by /gazebo: robot_state_publisher is not started\n"


@pytest.mark.parametrize("words", [[], ["clock"], ["/clock", "--else"], ["/clock", "--print", "one"], ["/clock", "x"]])
def test_wrong_usage_is_told(words, capsys):
    assert is_there.main(words) == 2 and "is_there NAME" in capsys.readouterr().err
