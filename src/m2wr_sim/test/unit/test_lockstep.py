"""The edge of lockstep as far as it needs no master: entries of parameters, and what the kernel tells of sockets."""
import socket
import threading

import pytest

from m2wr_sim.errors import ParameterError
from m2wr_sim.ros.lockstep import read_listeners, read_replies
from m2wr_sim.ros.lockstep_sockets import UnreadBytes, find_ends
from m2wr_sim.ros.loop import Loop, ShuttingDown
from m2wr_sim.ros.params import read_config


@pytest.mark.parametrize("entry, trigger, topic, sender, once", [
    ("/scan -> /cmd_vel", "/scan", "/cmd_vel", None, False),
    (" /scan -> /cmd_vel by /script ", "/scan", "/cmd_vel", "/script", False),
    ("/joint_states -> /tf_static by /rsp once", "/joint_states", "/tf_static", "/rsp", True),
    ("/scan -> /cmd_vel once", "/scan", "/cmd_vel", None, True)])
def test_replies_are_read(entry, trigger, topic, sender, once):
    reply, = read_replies([entry])
    assert (reply.trigger, reply.topic, reply.sender, reply.once) == (trigger, topic, sender, once)
    assert str(reply) == " ".join(entry.split())


@pytest.mark.parametrize("entry", ["/scan", "scan -> cmd_vel", "/scan -> ", "/scan -> /cmd_vel by", "/a -> /b twice"])
def test_a_reply_that_cannot_be_read_is_quoted(entry):
    with pytest.raises(ParameterError) as caught:
        read_replies([entry])
    assert repr(entry) in str(caught.value) and "~lockstep_replies" in str(caught.value)


def test_listeners_are_read():
    plain, detailed = read_listeners(["/rviz", "/record: /clock /odom"])
    assert (plain.name, plain.topics) == ("/rviz", ())
    assert (detailed.name, detailed.topics) == ("/record", ("/clock", "/odom"))


@pytest.mark.parametrize("name, value, words", [
    ("lockstep", 1, "true or false"), ("lockstep_controllers", "/bug2", "a list of names"),
    ("lockstep_controllers", [""], "a list of names"), ("lockstep_replies", [3], "a list of names"),
    ("lockstep_tick", "clock", "scan, odometry, both"), ("lockstep_patience", 0.0, "at least 0.1"),
    ("lockstep_on_silence", "wait", "stop, go_on")])
def test_bad_parameters_are_refused(name, value, words):
    with pytest.raises(ParameterError) as caught:
        read_config({name: value})
    assert "~" + name in str(caught.value) and words in str(caught.value)


# ---- sockets ------------------------------------------------------------------------------------------------------

@pytest.fixture
def pair():
    """A connection over the loopback interface: (writer, reader)."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(1)
        reader = socket.create_connection(server.getsockname())
        writer, _ = server.accept()
    yield writer, reader
    writer.close()
    reader.close()


def ends_of(writer, reader):
    ports = reader.getsockname()[1], writer.getsockname()[1]
    return find_ends({ports})[ports]


def test_the_kernel_tells_what_the_reader_has_not_read(pair):
    writer, reader = pair
    unread, ends = UnreadBytes(), ends_of(*pair)
    assert unread.of(ends) == 0
    writer.sendall(b"x" * 100)
    assert unread.of(ends) == 100
    reader.recv(40)
    assert unread.of(ends) == 60
    reader.recv(100)
    assert unread.of(ends) == 0
    unread.close()


def test_a_connection_that_is_gone_is_told_as_none(pair):
    writer, reader = pair
    unread, ends = UnreadBytes(), ends_of(*pair)
    reader.close()
    writer.close()
    assert unread.of(ends) is None
    unread.close()


def test_connections_that_nobody_has_are_not_found(pair):
    assert find_ends({(1, 2)}) == {}


# ---- the loop's waiting -------------------------------------------------------------------------------------------

class Still:
    """A simulator that is never asked to move."""

    now_ns, step_ns, paused = 0, 1000000, False


def test_requests_are_served_while_the_loop_waits():
    loop = Loop(Still(), 0.0, lambda: False, lambda: None)
    answers = []
    asking = threading.Thread(target=lambda: answers.append(loop.call(lambda: "served")))
    asking.start()
    assert loop.wait_until(lambda: answers, 20.0)
    asking.join(20.0)
    assert answers == ["served"]


def test_waiting_ends_with_the_time():
    loop = Loop(Still(), 0.0, lambda: False, lambda: None)
    assert not loop.wait_until(lambda: False, 0.01)


def test_waiting_ends_with_the_node():
    with pytest.raises(ShuttingDown):
        Loop(Still(), 0.0, lambda: True, lambda: None).wait_until(lambda: False, 60.0)


def test_a_closed_lockstep_lets_no_time_pass():
    class Closed:
        asked = 0

        def open(self):
            self.asked += 1
            return False

    lockstep = Closed()
    Loop(Still(), 0.0, lambda: lockstep.asked > 2, lambda: None, lockstep).run()    # Still has no advance to call
    assert lockstep.asked == 3
