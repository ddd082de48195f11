# SPDX-License-Identifier: BSD-3-Clause
"""Entries of the parameters ~lockstep_replies and ~lockstep_listeners."""
import pytest

from m2wr_lockstep.errors import ConfigError
from m2wr_lockstep.server.participants import read_listeners, read_replies


def same(name):
    """Remap nothing."""
    return name


@pytest.mark.parametrize("entry, trigger, topic, sender, once", [
    ("/scan -> /cmd_vel", "/scan", "/cmd_vel", None, False),
    (" /scan -> /cmd_vel by /script ", "/scan", "/cmd_vel", "/script", False),
    ("/joint_states -> /tf_static by /rsp once", "/joint_states", "/tf_static", "/rsp", True),
    ("/scan -> /cmd_vel once", "/scan", "/cmd_vel", None, True)])
def test_replies_are_read(entry, trigger, topic, sender, once):
    reply, = read_replies([entry], same)
    assert (reply.trigger, reply.topic, reply.sender, reply.once) == (trigger, topic, sender, once)
    assert str(reply) == " ".join(entry.split())


@pytest.mark.parametrize("entry", ["/scan", "scan -> cmd_vel", "/scan -> ", "/scan -> /cmd_vel by", "/a -> /b twice"])
def test_a_reply_that_cannot_be_read_is_quoted(entry):
    with pytest.raises(ConfigError) as caught:
        read_replies([entry], same)
    assert repr(entry) in str(caught.value) and "~lockstep_replies" in str(caught.value)


def test_names_in_replies_are_remapped():
    reply, = read_replies(["/clock -> /cmd_vel by /script"], lambda name: name + "_elsewhere")
    assert (reply.trigger, reply.topic, reply.sender) == ("/clock_elsewhere", "/cmd_vel_elsewhere", "/script_elsewhere")


def test_listeners_are_read():
    plain, detailed = read_listeners(["/rviz", "/record: /clock /odom"], same)
    assert (plain.name, plain.topics) == ("/rviz", ())
    assert (detailed.name, detailed.topics) == ("/record", ("/clock", "/odom"))
    assert not plain.respawned and not detailed.respawned
    assert read_listeners(["/mapper respawned: /scan", "/rviz respawned"], same) == [
        ("/mapper", ("/scan",), True), ("/rviz", (), True)]


@pytest.mark.parametrize("entry", ["", " : /scan", "/one /two", "/mapper always: /scan"])
def test_a_listener_that_cannot_be_read_is_quoted(entry):
    with pytest.raises(ConfigError) as caught:
        read_listeners([entry], same)
    assert repr(entry) in str(caught.value) and "~lockstep_listeners" in str(caught.value)
