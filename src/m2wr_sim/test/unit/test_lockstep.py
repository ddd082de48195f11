# SPDX-License-Identifier: BSD-3-Clause
"""The edge of lockstep as far as it needs no master: entries of parameters, and what the kernel tells of sockets."""
import logging
import socket
import struct
import threading
import time
from io import BytesIO
from types import SimpleNamespace

import pytest
import rospy
from m2wr_lockstep.srv import Turn, TurnResponse
from rosgraph.network import encode_ros_handshake_header, read_ros_handshake_header
from sensor_msgs.msg import LaserScan

from m2wr_sim.errors import LockstepError, ParameterError
from m2wr_sim.ros import lockstep as edge
from m2wr_sim.ros import lockstep_ports
from m2wr_sim.ros import ports as plain_ports
from m2wr_sim.ros.lockstep import Lockstep, read_listeners, read_replies
from m2wr_sim.ros.lockstep_gate import Connection, Gate, Listener, Look
from m2wr_sim.ros.lockstep_sockets import Link, UnreadBytes, find_ends
from m2wr_sim.ros.loop import Loop, ShuttingDown
from m2wr_sim.ros.params import read_config
from m2wr_sim.runtime.turns import Inbox, Ledger, TurnAnswer, TurnFailed, TurnRequest


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


def test_names_in_replies_are_remapped(monkeypatch):
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name + "_elsewhere")
    reply, = read_replies(["/clock -> /cmd_vel by /script"])
    assert (reply.trigger, reply.topic, reply.sender) == ("/clock_elsewhere", "/cmd_vel_elsewhere", "/script_elsewhere")


def test_listeners_are_read():
    plain, detailed = read_listeners(["/rviz", "/record: /clock /odom"])
    assert (plain.name, plain.topics) == ("/rviz", ())
    assert (detailed.name, detailed.topics) == ("/record", ("/clock", "/odom"))
    assert not plain.respawned and not detailed.respawned
    assert read_listeners(["/mapper respawned: /scan", "/rviz respawned"]) == [
        ("/mapper", ("/scan",), True), ("/rviz", (), True)]


@pytest.mark.parametrize("entry", ["", " : /scan", "/one /two", "/mapper always: /scan"])
def test_a_listener_that_cannot_be_read_is_quoted(entry):
    with pytest.raises(ParameterError) as caught:
        read_listeners([entry])
    assert repr(entry) in str(caught.value) and "~lockstep_listeners" in str(caught.value)


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


def test_a_late_answer_of_the_kernel_is_not_taken_for_the_next(pair):
    writer, reader = pair
    unread, ends = UnreadBytes(), ends_of(*pair)
    late = []
    given_up = SimpleNamespace(send=unread._netlink.send, recv=lambda size: late[0])       # nobody takes the answer
    unread._netlink, real = given_up, unread._netlink
    with pytest.raises(IndexError):
        unread.of(ends)
    unread._netlink = real
    writer.sendall(b"x" * 100)
    assert unread.of(ends) == 100
    unread.close()


def test_connections_that_nobody_has_are_not_found(pair):
    assert find_ends({(1, 2)}) == {}


# ---- the loop's waiting -------------------------------------------------------------------------------------------

class Still:
    """A simulator that is never asked to move."""

    now_ns, step_ns, paused = 0, 1000000, False

    def settle(self):
        """Nothing moves."""


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


# ---- who takes part ----------------------------------------------------------------------------------------------

class Line:
    """A connection to a controller that answers at once, or is dead; ``Line.made`` are all there were."""

    made, dead = [], set()

    def __init__(self, name, wake):
        self.name, self.closed = name, False
        self.made.append(self)

    def ask(self, request):
        def result():
            if self.name in self.dead:
                raise TurnFailed("connection refused")
            return TurnAnswer((), False, False, "")
        return SimpleNamespace(done=lambda: True, result=result)

    def idle(self):
        return True

    def close(self):
        self.closed = True


class Moving(Still):
    """A simulator whose every advance is a tick."""

    def __init__(self, ports):
        self.ports = ports

    def advance(self, until_ns):
        self.now_ns += 50000000
        self.ports.tick_due = True
        return self.now_ns


@pytest.fixture
def stage(monkeypatch):
    """A lockstep of /first and /second that goes on without the silent; ``stage.look()`` finds nobody missing."""
    monkeypatch.setattr(edge, "_Line", Line)
    monkeypatch.setattr(Line, "made", [])
    monkeypatch.setattr(Line, "dead", set())
    ports = SimpleNamespace(ticking={1}, inbox=Inbox(), ledger=Ledger(), changed=True, tick_due=False, listen=None)
    config, _ = read_config({"lockstep": True, "lockstep_controllers": ["/first", "/second"],
                             "lockstep_on_silence": "go_on", "lockstep_patience": 0.5})
    monkeypatch.setattr(edge, "Gate", lambda *_: SimpleNamespace(look=lambda without: Look([], [])))
    made = Lockstep(config, ports)
    with monkeypatch.context() as without_thread:
        without_thread.setattr(Lockstep, "_watch", lambda self: None)
        made.attach(Loop(Still(), 0.0, lambda: False, lambda: None), Moving(ports))
    return SimpleNamespace(lockstep=made, ports=ports, look=made._look_once,
                           members=lambda: [member.name for member in made._conductor.members])


def opened(stage):
    assert not stage.lockstep.open()
    stage.look()
    assert stage.lockstep.open() and stage.members() == ["/first", "/second"]
    return stage.lockstep


def test_one_that_was_lost_is_not_taken_back_on_a_look_from_before(stage):
    lockstep = opened(stage)
    stage.look()                            # the graph is looked at once more, and nobody asks what was seen
    lockstep.advance(0)
    Line.dead.add("/first")
    lockstep.advance(0)
    assert lockstep.open() and stage.members() == ["/second"]
    Line.dead.clear()
    stage.look()
    assert lockstep.open() and stage.members() == ["/first", "/second"]
    assert [line.name for line in Line.made] == ["/first", "/second", "/first"] and Line.made[0].closed


def test_a_look_that_began_before_a_loss_says_nothing(stage):
    lockstep = opened(stage)
    lockstep.advance(0)
    Line.dead.add("/first")

    def look(without):
        lockstep.advance(0)                 # the loss falls into the look
        return Look([], [])

    lockstep._gate.look = look
    stage.look()
    assert lockstep.open() and stage.members() == ["/second"]


def test_who_is_expected_can_be_told_while_a_line_is_being_replaced(stage):
    lockstep = opened(stage)
    lockstep.advance(0)
    Line.dead.add("/first")
    lockstep.advance(0)
    del lockstep._lines["/first"]
    assert sorted(lockstep._expected()) == ["/first", "/second"]


def test_an_error_while_looking_does_not_end_the_looking(stage, monkeypatch, caplog):
    lockstep, looks = stage.lockstep, []

    def look(without):
        looks.append(None)
        if len(looks) == 1:
            raise KeyError("/first")
        lockstep._closing = True
        return Look([], [])

    lockstep._gate.look = look
    lockstep.open()
    watching = threading.Thread(target=lockstep._watch, daemon=True)
    watching.start()
    watching.join(20.0)
    assert len(looks) == 2 and lockstep.open()
    assert "looking for who takes part failed" in caplog.text


# ---- listeners ---------------------------------------------------------------------------------------------------

@pytest.fixture
def deaf(stage):
    """A stage with a listener that never reads."""
    link = Link("/gazebo", "/rviz", "/tf", None)
    stage.lockstep._links = stage.lockstep._shared = [link]
    stage.lockstep._unread = SimpleNamespace(of=lambda ends: 7)
    stage.lockstep._go_on, stage.lockstep._patience = False, 20.0
    return stage.lockstep


def test_services_are_answered_while_a_listener_does_not_read(deaf):
    served = []

    def serve():
        deaf._loop.call(lambda: served.append(time.monotonic()))
        deaf._unread = SimpleNamespace(of=lambda ends: 0)

    asking = threading.Thread(target=serve, daemon=True)
    asking.start()
    deaf._settle(deaf._links)
    asking.join(20.0)
    assert served


def test_the_node_can_end_while_a_listener_does_not_read(deaf):
    deaf._loop = Loop(Still(), 0.0, lambda: True, lambda: None)
    with pytest.raises(ShuttingDown):
        deaf._settle(deaf._links)
    deaf._before_trigger()                  # in the middle of a step it just goes on


def test_in_the_middle_of_a_step_nobody_is_served(deaf):
    deaf._patience = 0.2
    deaf._loop.wake = deaf._loop._serve = None              # would fail when called
    deaf._before_trigger()
    with pytest.raises(LockstepError, match="/rviz has not read what /gazebo sent on /tf within 0.2 s"):
        deaf.advance(0)                     # behind the step, where it is not taken for the fault of a plugin


@pytest.mark.parametrize("respawned", [False, True])
def test_time_waits_for_a_listener_that_is_started_again(stage, respawned, caplog):
    lockstep, forgotten = opened(stage), []
    lockstep._listeners = [Listener("/mapper", (), respawned), Listener("/rviz", ())]
    lockstep._connections = [Connection("/gazebo", "/mapper", "/scan", (1, 2))]
    lockstep._gate.forget = lambda name, connections: forgotten.append((name, list(connections)))
    gone, there = Link("/gazebo", "/mapper", "/scan", "gone"), Link("/gazebo", "/rviz", "/scan", "there")
    lockstep._links = [gone, there]
    lockstep._unread = SimpleNamespace(of=lambda ends: None if ends == "gone" else 0)
    lockstep.advance(0)
    assert lockstep._links == [there]
    if respawned:
        assert not lockstep.open() and "/mapper has gone" in caplog.text
        assert forgotten == [("/mapper", lockstep._connections)]
        stage.look()                    # it is back
    assert lockstep.open()


def test_connections_of_a_listener_that_has_died_do_not_count(monkeypatch):
    def own(name):
        return [Connection("/gazebo", "/mapper", "/scan", ports) for ports in connected]

    connected = [(1, 2)]
    state = [[["/scan", ["/gazebo"]]], [["/scan", ["/mapper"]]], []]
    monkeypatch.setattr(rospy, "get_name", lambda: "/gazebo")
    gate = Gate([], [Listener("/mapper", ("/scan",), True)], [], lambda: True)
    gate._master = SimpleNamespace(getSystemState=lambda: state, lookupNode=lambda name: "")
    monkeypatch.setattr(gate, "_connections", lambda name: own(name) if name == "/gazebo" else [])
    found = gate.look()
    assert not found.missing
    gate.forget("/mapper", found.connections)
    assert gate.look().missing == ["/mapper to be connected to /gazebo on /scan"]
    connected.append((3, 2))
    assert not gate.look().missing


def test_a_listener_that_cannot_be_watched_is_named(deaf, caplog):
    def refuse(ends):
        raise OSError(1, "Operation not permitted")

    deaf._unread = SimpleNamespace(of=refuse)
    with caplog.at_level(logging.WARNING):
        deaf._settle(deaf._links)
    assert deaf._links == [] and "/rviz" in caplog.text and "Operation not permitted" in caplog.text


# ---- ports -------------------------------------------------------------------------------------------------------

@pytest.fixture
def ports(monkeypatch):
    """Ports of lockstep without a network, with /clock and /tf remapped."""
    port = SimpleNamespace(wanted=lambda: True, publish=lambda message: None, close=lambda: None)
    for name, replacement in (("__init__", lambda self: None), ("advertise", lambda self, *_: port),
                              ("clock", lambda self, now_ns: None), ("transform", lambda self, *_: None)):
        monkeypatch.setattr(plain_ports.RosPorts, name, replacement)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: {"/clock": "/sim/clock", "/tf": "/sim/tf"}.get(name, name))
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: SimpleNamespace(unregister=lambda: None))
    return lockstep_ports.LockstepPorts()


def test_ticks_are_made_without_a_subscriber_unless_another_sensor_has_one(ports):
    made = [ports.advertise(name, LaserScan, 1, "") for name in ("left/scan", "right/scan")]
    heard = {}
    for number, port in enumerate(made):
        port._port = SimpleNamespace(wanted=lambda number=number: heard.get(number, False))
    assert [port.wanted() for port in made] == [True, True]
    heard[1] = True
    assert [port.wanted() for port in made] == [False, True]
    heard[0] = True
    assert [port.wanted() for port in made] == [True, True]


def test_a_topic_that_goes_closes_the_gate(ports):
    for opened_port in (ports.advertise("/scan", SimpleNamespace(_type="sensor_msgs/LaserScan"), 1, ""),
                        ports.subscribe("/cmd_vel", None, None, "")):
        ports.changed = False
        opened_port.close()
        assert ports.changed
    assert not ports.ticking


def test_replies_are_heard_again_when_the_robot_is_gone(ports):
    robot = ports.subscribe("/cmd_vel", None, None, "")
    ports.listen("/cmd_vel")
    assert not ports._bare
    robot.close()
    ports.listen("/cmd_vel")
    assert list(ports._bare) == ["/cmd_vel"] and ports.inbox.topics() == {"/cmd_vel"}


def test_the_clock_and_transforms_are_counted_under_their_real_names(ports):
    ports.clock(0)
    ports.transform(None, "odom", "base", (), ())
    assert ports.ledger.counts == {"/sim/clock": 1, "/sim/tf": 1}


def test_a_connection_that_is_not_taken_in_is_made_anew(monkeypatch):
    answer = encode_ros_handshake_header({"callerid": "/first", "type": Turn._type, "md5sum": Turn._md5sum})
    seen, said = [], BytesIO()
    TurnResponse(note="here").serialize(said)

    def serve(server):
        silent, _ = server.accept()         # as if it had been lost on its way
        taken, _ = server.accept()
        seen.append(read_ros_handshake_header(taken, BytesIO(), 4096))
        taken.sendall(answer)
        seen.append(struct.unpack("<I", taken.recv(4))[0] > 0)
        taken.sendall(b"\1" + struct.pack("<I", len(said.getvalue())) + said.getvalue())
        silent.close()
        taken.close()

    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "rosrpc://127.0.0.1:%d" % server.getsockname()[1]
        monkeypatch.setattr(edge.rosgraph, "Master", lambda _: SimpleNamespace(lookupService=lambda name: address))
        monkeypatch.setattr(edge, "_ANSWERED", 0.2)
        threading.Thread(target=serve, args=(server,), daemon=True).start()
        came = threading.Event()
        line = edge._Line("/first", came.set)
        pending = line.ask(TurnRequest(1, 0, 0, {}))
        assert came.wait(20.0) and pending.result().note == "here" and line.idle()
        line.close()
    assert seen[0]["service"] == "/first/lockstep_turn" and seen[0]["persistent"] == "1" and seen[1]


def test_a_controller_that_is_gone_is_not_waited_for(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "rosrpc://127.0.0.1:%d" % server.getsockname()[1]
    monkeypatch.setattr(edge.rosgraph, "Master", lambda _: SimpleNamespace(lookupService=lambda name: address))
    came = threading.Event()
    line = edge._Line("/first", came.set)
    pending = line.ask(TurnRequest(1, 0, 0, {}))
    assert came.wait(20.0)
    with pytest.raises(TurnFailed, match="refused"):
        pending.result()
    line.close()
