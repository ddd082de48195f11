# SPDX-License-Identifier: BSD-3-Clause
"""Checks what runs: the master, its nodes, time, and the publishers and subscribers of commands."""
from __future__ import annotations

import socket
import xmlrpc.client
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, NamedTuple, Optional
from urllib.parse import urlparse

from m2wr_node.ros.is_there import PatientTransport
from m2wr_tools.doctor.environment import master_address
from m2wr_tools.doctor.finding import ok, problem, some, warning

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.machine import Machine

_MASTER, _TOPICS = "master", "topics"
_PATIENCE = 1.0             # s for a node to answer
_TURNS = {"/go_to_point", "/wall_follower"}     # take turns on /cmd_vel by their switches


class Graph(NamedTuple):
    """The nodes of a master and their connections.

    ``publishers``, ``subscribers``, ``services``: {name: [nodes]}; ``types``: {topic: type}; ``nodes``: {name:
    address}; ``silent``: names of nodes that do not answer; ``sim_time``: value of /use_sim_time, None if not set.
    """

    publishers: Dict[str, List[str]]
    subscribers: Dict[str, List[str]]
    services: Dict[str, List[str]]
    types: Dict[str, str]
    nodes: Dict[str, str]
    silent: List[str]
    sim_time: Optional[bool]


def _ask(address: str, method: str, *arguments: object) -> Any:
    """Return the answer of a master or node; OSError if there is none."""
    proxy = xmlrpc.client.ServerProxy(address, transport=PatientTransport(_PATIENCE))
    try:
        code, text, answer = getattr(proxy, method)("/doctor", *arguments)
    except (xmlrpc.client.Error, ValueError, TypeError) as error:
        raise OSError("%s: %s" % (address, error)) from error
    finally:
        proxy("close")()
    if code != 1:
        raise OSError("%s: %s" % (address, text))
    return answer


def read_graph(environ: Mapping[str, str]) -> Optional[Graph]:
    """Return the Graph of the master that ROS_MASTER_URI names, or None if there is no master.

    It starts no node, so it also works if a node would hang.
    """
    address = master_address(environ)
    if address is None:
        return None
    master = "http://%s:%d" % address
    try:
        publishers, subscribers, services = (dict(part) for part in _ask(master, "getSystemState"))
        types = dict(_ask(master, "getTopicTypes"))
    except OSError:
        return None
    try:
        sim_time = _ask(master, "getParam", "/use_sim_time")
    except OSError:
        sim_time = None
    nodes, silent = {}, []
    for name in sorted({node for part in (publishers, subscribers, services) for entry in part.values()
                        for node in entry}):
        try:
            nodes[name] = _ask(master, "lookupNode", name)
            _ask(nodes[name], "getPid")
        except OSError:
            silent.append(name)
    return Graph(publishers, subscribers, services, types, nodes, silent, sim_time)


def check_master(machine: Machine, graph: Optional[Graph]) -> List[Finding]:
    """Return the findings on the master, its nodes and time.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    graph : Graph or None
        None if there is no master.
    """
    address = master_address(machine.environ)
    if graph is None:
        if address is None:
            return []           # reported by the check of the environment
        if machine.accepts(*address):
            return [problem(_MASTER, "%s:%d is used by a program that is not a ROS master" % address,
                            "choose another port: export ROS_MASTER_URI=http://localhost:11312")]
        if not any(machine.is_local(place) for place in machine.addresses(address[0])):
            return [warning(_MASTER, "no master at %s:%d, on another machine" % address,
                            "start it there, or unset ROS_MASTER_URI to work on this one")]
        return [ok(_MASTER, "no master at %s:%d: the checks of running nodes are skipped", *address)]
    found = [ok(_MASTER, "the master answers, %d nodes", len(graph.nodes))]
    for name in graph.silent:
        host = urlparse(graph.nodes.get(name, "")).hostname
        if host and not machine.addresses(host):
            found.append(problem(_MASTER, "node %s is registered at host %s, which has no address here" % (name, host),
                                 "export ROS_HOSTNAME=localhost (or an address) before that node is started"))
        else:
            found.append(warning(_MASTER, "node %s is registered, but does not answer" % name,
                                 "it has exited or hangs: rosnode cleanup"))
    return found + _reachable(machine, graph) + _time(graph)


def _reachable(machine: Machine, graph: Graph) -> List[Finding]:
    """Report the nodes that accept connections from other machines although ROS is bound to the loopback address."""
    environ = machine.environ
    host = environ.get("ROS_HOSTNAME") or environ.get("ROS_IP")
    addresses = machine.addresses(host) if host else []
    if not addresses or not all(address.startswith(("127.", "::1")) for address in addresses):
        return []               # reported by the check of the environment, or wanted
    ports = machine.open_to_all()
    names = [name for name, address in graph.nodes.items() if urlparse(address).port in ports
             and any(machine.is_local(place) for place in machine.addresses(urlparse(address).hostname or ""))]
    if not names:
        return [ok(_MASTER, "all nodes listen on the loopback address only")]
    return [ok(_MASTER, "%s: XML-RPC port open to other machines, as roscpp always opens it; in a network that is not "
               "trusted, close it with a firewall", some(names))]


def _time(graph: Graph) -> List[Finding]:
    clocks = graph.publishers.get("/clock", [])
    alive = [name for name in clocks if name not in graph.silent]
    if len(alive) > 1:
        return [problem(_MASTER, "%d nodes publish /clock: %s; time jumps back and forth" % (len(alive), some(alive)),
                        "stop all but one: rosnode kill %s" % sorted(alive)[-1])]
    if graph.sim_time and not alive:
        return [problem(_MASTER, "/use_sim_time is true, but nothing publishes /clock: nodes wait without a message",
                        "start the simulation (roslaunch m2wr_sim bug2.launch), or without a simulation: rosparam set "
                        "/use_sim_time false")]
    if alive and not graph.sim_time:
        return [warning(_MASTER, "%s publishes /clock, but /use_sim_time is %s: nodes use the wall clock" % (
            alive[0], "false" if graph.sim_time is False else "not set"),
            "rosparam set /use_sim_time true, then start those nodes again")]
    return [ok(_MASTER, "time: %s", "/clock of %s" % alive[0] if alive else "the wall clock")]


def check_topics(graph: Graph) -> List[Finding]:
    """Return the findings on publishers and subscribers of commands."""
    found = []
    commands = [topic for topic, kind in graph.types.items() if kind == "geometry_msgs/Twist"
                and topic.rsplit("/", 1)[-1].startswith("cmd_vel")]
    for topic in sorted(commands):
        senders = set(graph.publishers.get(topic, [])) - set(graph.silent)
        takers = set(graph.subscribers.get(topic, [])) - set(graph.silent)
        if len(senders - _TURNS) + bool(senders & _TURNS) > 1:
            found.append(warning(_TOPICS, "%d nodes publish %s: %s; the robot follows the last command" % (
                len(senders), topic, some(senders)), "stop all but one: rosnode kill NAME"))
        elif senders and not takers:
            found.append(warning(_TOPICS, "%s publishes %s, but no robot subscribes to it" % (some(senders), topic),
                                 _other_robots(graph, topic)))
        elif takers:
            found.append(ok(_TOPICS, "%s: from %s to %s", topic, some(senders) or "no publisher", some(takers)))
    return found


def _other_robots(graph: Graph, topic: str) -> str:
    others = [name for name, kind in graph.types.items() if kind == "geometry_msgs/Twist" and name != topic
              and graph.subscribers.get(name)]
    if others:
        return "robots subscribe to %s: start the node with cmd_vel:=%s" % (some(others), sorted(others)[0])
    return "spawn a robot: roslaunch m2wr_description spawn.launch"


def time_limit(seconds: float) -> None:
    """Set the longest time that a connection of this process waits."""
    socket.setdefaulttimeout(seconds)
