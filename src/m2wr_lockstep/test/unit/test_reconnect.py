# SPDX-License-Identifier: BSD-3-Clause
"""Connections that do not come: who is told what, and when."""
import logging
from types import SimpleNamespace

import pytest

from m2wr_lockstep.server.ros.reconnect import FIRST_PAUSE, LONGEST_PAUSE, Reconnector
from m2wr_node.internals import connections

PUBLISHERS = {"/cmd_vel": {"/puppet", "/dead"}, "/odom": {"/sim"}}
ALONE = ("/puppet", "/sim", "/cmd_vel")


class Graph:
    """Nodes whose slave APIs take note of what they are told."""

    def __init__(self):
        self.now, self.told, self.answer = 100.0, [], (1, "", 0)
        self.reconnector = Reconnector("/sim", lambda name: None if name == "/unknown" else "http:/" + name, self.slave,
                                       lambda: self.now)

    def slave(self, address):
        def publisher_update(caller, topic, uris):
            self.told.append((address, topic, uris))
            if isinstance(self.answer, Exception):
                raise self.answer
            return self.answer

        return SimpleNamespace(publisherUpdate=publisher_update)

    def after(self, pause, *apart, publishers=PUBLISHERS):
        """Note ``apart`` after so many seconds; returns how many have been told by then."""
        self.now += pause
        self.reconnector.note(apart, publishers)
        return len(self.told)


@pytest.fixture
def graph(monkeypatch):
    """Nodes, and no subscriptions of this process."""
    monkeypatch.setattr(connections.topics, "get_topic_manager",
                        lambda: SimpleNamespace(get_subscriber_impl=lambda topic: None))
    return Graph()


def test_a_late_subscriber_is_told_of_all_publishers(graph, caplog):
    assert graph.after(0.0, ALONE) == 0
    assert graph.after(0.9 * FIRST_PAUSE, ALONE) == 0
    with caplog.at_level(logging.WARNING):
        assert graph.after(0.2 * FIRST_PAUSE, ALONE) == 1
    assert graph.told == [("http://sim", "/cmd_vel", ["http://dead", "http://puppet"])]
    assert "/sim has not connected to /puppet on /cmd_vel" in caplog.text


def test_it_is_told_again_less_often_and_logged_once(graph, caplog):
    times, told = [], 0
    for _ in range(1500):
        if graph.after(0.1, ALONE) != told:
            told = len(graph.told)
            times.append(graph.now)
    pauses = [late - early for early, late in zip(times, times[1:])]
    assert pauses == pytest.approx([4.0, 8.0, 16.0, LONGEST_PAUSE, LONGEST_PAUSE, LONGEST_PAUSE], abs=0.2)
    assert caplog.text.count("has not connected") == 1


def test_one_that_came_in_time_is_forgotten(graph):
    graph.after(0.0, ALONE)
    graph.after(0.5 * FIRST_PAUSE)
    assert graph.after(FIRST_PAUSE, ALONE) == 0 and graph.after(0.5 * FIRST_PAUSE, ALONE) == 0


def test_other_nodes_are_told_as_well(graph):
    apart = ("/sim", "/puppet", "/odom")
    graph.after(0.0, apart)
    assert graph.after(FIRST_PAUSE, apart) == 1
    assert graph.told == [("http://puppet", "/odom", ["http://sim"])]


def test_publishers_that_the_master_has_forgotten_are_left_out(graph):
    publishers = {"/cmd_vel": {"/puppet", "/unknown"}}
    graph.after(0.0, ALONE, publishers=publishers)
    graph.after(FIRST_PAUSE, ALONE, publishers=publishers)
    assert graph.told[0][2] == ["http://puppet"]


@pytest.mark.parametrize("answer, words", [(ConnectionRefusedError("connection refused"), "connection refused"),
                                           ((0, "no such topic", 0), "no such topic")])
def test_what_fails_is_told_and_tried_again(graph, answer, words, caplog):
    graph.answer = answer
    graph.after(0.0, ALONE)
    assert graph.after(FIRST_PAUSE, ALONE) == 1
    assert words in caplog.text
    assert graph.after(2.0 * FIRST_PAUSE, ALONE) == 2


def test_a_connection_unknown_to_the_publisher_is_closed_first(graph, monkeypatch):
    closed = []
    held = [SimpleNamespace(endpoint_id=uri, close=lambda uri=uri: closed.append(uri))
            for uri in ("http://puppet", "http://dead", "http://other")]
    impl = SimpleNamespace(connections=held)
    monkeypatch.setattr(connections.topics, "get_topic_manager",
                        lambda: SimpleNamespace(get_subscriber_impl={"/cmd_vel": impl}.get))
    graph.after(0.0, ALONE)
    graph.after(FIRST_PAUSE, ALONE)
    assert closed == ["http://puppet"]


def test_a_subscriber_without_an_address_is_named(graph, caplog):
    apart = ("/puppet", "/unknown", "/cmd_vel")
    graph.after(0.0, apart)
    graph.after(FIRST_PAUSE, apart)
    assert graph.told == [] and "the master does not know its address" in caplog.text
