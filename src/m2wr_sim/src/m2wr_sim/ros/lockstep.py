# SPDX-License-Identifier: BSD-3-Clause
"""Lockstep over rospy: opens when everybody is connected, asks controllers for their turns, waits for who listens."""
import logging
import queue
import re
import select
import socket
import threading
import time

import rosgraph
import rospy
from m2wr_lockstep.srv import Turn
from m2wr_lockstep.srv import TurnRequest as TurnMessage
from rospy.impl.tcpros_base import TCPROSTransport

from m2wr_sim.errors import LockstepError, ParameterError
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.ros.lockstep_gate import NOT_WAITED_FOR, SERVICE, Gate, Listener
from m2wr_sim.ros.lockstep_sockets import Link, UnreadBytes, find_ends
from m2wr_sim.runtime.turns import Conductor, Reply, TurnAnswer, TurnFailed

log = logging.getLogger(__name__)

_LOOK_PAUSE = 0.1               # s of wall time between two looks at the graph
_RETURN_PAUSE = 1.0             # the same while time passes, for controllers that come back
_REMIND = 5.0                   # s of wall time between two lines on what is waited for
_ANSWERED, _TRIES = 1.5, 6      # s of wall time that a node has to take a connection in; how often it is made
_GLANCE = 0.0001                # s between two looks at a socket that is not empty; the kernel does not wake us
_RESPONDED = re.compile(r"responded with an error: b['\"](.*)['\"]$")      # rospy prints the bytes it got
_REPLY = re.compile(r"^(/\S+) -> (/\S+?)(?: by (/\S+))?( once)?$")


def read_replies(entries):
    """Return the Replies of ``"TRIGGER -> TOPIC [by NODE] [once]"``; ParameterError for anything else."""
    replies = []
    for entry in entries:
        found = _REPLY.match(entry.strip())
        if found is None:
            raise ParameterError("parameter ~lockstep_replies has %r; expected \"/TRIGGER -> /TOPIC\", and behind it, "
                                 "if wanted, \"by /NODE\" and \"once\"" % entry)
        trigger, topic, sender, once = found.groups()
        replies.append(Reply(rospy.resolve_name(trigger), rospy.resolve_name(topic),
                             sender and rospy.resolve_name(sender), bool(once)))
    return replies


def read_listeners(entries):
    """Return the Listeners of ``"NODE [respawned]"`` or ``"NODE [respawned]: TOPIC TOPIC ..."``."""
    listeners = []
    for entry in entries:
        name, _, topics = entry.partition(":")
        name, *how = name.split() or [""]
        if not name or how not in ([], ["respawned"]):
            raise ParameterError("parameter ~lockstep_listeners has %r; expected \"/NODE\", behind it, if wanted, "
                                 "\" respawned\", and then \": /TOPIC /TOPIC ...\"" % entry)
        listeners.append(Listener(rospy.resolve_name(name), tuple(map(rospy.resolve_name, topics.split())), bool(how)))
    return listeners


class _Pending:
    """An answer that may have come."""

    def __init__(self):
        self._done, self._answer, self._error = False, None, None

    def set(self, answer, error):
        self._answer, self._error, self._done = answer, error, True

    def done(self):
        return self._done

    def result(self):
        if self._error is not None:
            raise TurnFailed(self._error)
        return self._answer


class _Line:
    """A lasting connection to one controller, with a thread of its own: rospy's calls cannot be waited for briefly."""

    def __init__(self, name, wake):
        self._wake, self._requests, self._newest = wake, queue.Queue(), None
        self._proxy = rospy.ServiceProxy("%s/%s" % (name, SERVICE), Turn, persistent=True)
        threading.Thread(target=self._run, name="turns of " + name, daemon=True).start()

    def ask(self, request):
        """Ask for a turn; returns the answer to come."""
        self._newest = _Pending()
        self._requests.put((request, self._newest))
        return self._newest

    def idle(self):
        """Tell whether all that was asked has been answered or has failed."""
        return self._newest is None or self._newest.done()

    def close(self):
        """Hang up, when the call that is going on has come to an end."""
        self._requests.put(None)

    def _run(self):
        while True:
            job = self._requests.get()
            if job is None:
                self._proxy.close()
                return
            request, pending = job
            message = TurnMessage(request.tick, stamp_of(request.now_ns), stamp_of(request.since_ns),
                                  list(request.news), list(request.news.values()))
            try:
                if self._proxy.transport is None:
                    self._proxy.transport = self._connected()
                answer = self._proxy(message)
                pending.set(TurnAnswer(tuple(zip(answer.topics, answer.early, answer.counts)), answer.over,
                                       answer.leave, answer.note), None)
            except Exception as error:      # rospy raises a good many kinds when the other side goes away
                said = _RESPONDED.search(str(error))
                pending.set(None, said.group(1) if said else str(error) or type(error).__name__)
            self._wake()

    def _connected(self):
        """Return a connection to the service; rospy's own waits without end for one that was lost on its way."""
        proxy, late = self._proxy, None
        for _ in range(_TRIES):
            transport = TCPROSTransport(proxy.protocol, proxy.resolved_name)
            transport.buff_size = proxy.buff_size
            try:
                uri = rosgraph.Master(rospy.get_name()).lookupService(proxy.resolved_name)
                taken = socket.create_connection(rospy.core.parse_rosrpc_uri(uri), _ANSWERED)
                taken.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
                transport.set_socket(taken, uri)
                transport.write_header()
                waiting = select.poll()         # for rospy takes time-outs off
                waiting.register(taken, select.POLLIN)
                if not waiting.poll(1e3 * _ANSWERED):
                    raise socket.timeout("no answer within %g s" % _ANSWERED)
                transport.read_header()
                return transport
            except socket.timeout as error:
                transport.close()
                late = error
                log.warning("%s has not taken a connection within %g s; it is made anew",
                            proxy.resolved_name, _ANSWERED)
            except Exception:
                transport.close()
                raise
        raise late


class Lockstep:
    """What the loop asks before and after it lets time pass.

    Parameters
    ----------
    config : NodeConfig
    ports : LockstepPorts

    Raises
    ------
    ParameterError
        If nobody is named, or an entry cannot be read.
    """

    def __init__(self, config, ports):
        self._ports, self._patience = ports, config.lockstep_patience
        replies, listeners = read_replies(config.lockstep_replies), read_listeners(config.lockstep_listeners)
        names = [rospy.resolve_name(name) for name in config.lockstep_controllers]
        if not (names or replies):
            raise ParameterError("parameter ~lockstep is true, but ~lockstep_controllers and ~lockstep_replies name "
                                 "nobody to wait for; expected the names of the nodes that control the robot")
        self._names, self._listeners = names, listeners
        self._gate = Gate(names, listeners, replies, lambda: bool(ports.ticking))
        self._go_on = config.lockstep_on_silence == "go_on"
        self._replies, self._lines, self._conductor = replies, {}, None
        self._loop = self._simulator = None
        self._open, self._look, self._generation = False, None, 0
        self._links, self._shared, self._foreign, self._unread, self._connections = [], [], [], None, ()
        self._wanted, self._closing, self._failure = threading.Event(), False, None
        self._missing, self._waited = [], 0.0
        ports.triggers = {reply.trigger for reply in replies}
        ports.before_trigger = self._before_trigger

    def attach(self, loop, simulator):
        """Start to look for who takes part; ``loop`` is the node's."""
        self._loop, self._simulator = loop, simulator
        self._conductor = Conductor(self._ask, loop.wait_until, self._ports.inbox, self._ports.ledger, self._replies,
                                    self._patience, self._go_on, lambda: self._settle(self._foreign))
        self._ports.on_arrival = loop.wake
        threading.Thread(target=self._watch, name="lockstep gate", daemon=True).start()

    def close(self):
        """Let go of the controllers."""
        self._closing = True
        self._wanted.set()
        for line in self._lines.values():
            line.close()

    # ---- asked by the loop -------------------------------------------------------------------------------------

    def open(self):
        """Tell whether time may pass; if not, what is missing is being looked for."""
        if self._conductor.over:
            return False
        if self._ports.changed:
            for reply in self._replies:
                self._ports.listen(reply.topic)
            self._ports.changed, self._open = False, False
            self._outdate()
        if self._open and not self._conductor.lost:
            return True
        self._wanted.set()
        look, self._look = self._look, None
        if look is not None and look[0] == self._generation:
            self._admit(*look[1:])
        return self._open

    def advance(self, until_ns):
        """Let time pass to the next moment at which something happens, and wait for everybody there."""
        now_ns = self._simulator.advance(until_ns)
        if self._failure is not None:
            raise self._failure
        conductor = self._conductor
        if self._replies:
            conductor.collect_replies(now_ns)
        if self._ports.tick_due:
            self._ports.tick_due = False
            lost, began = len(conductor.lost), time.monotonic()
            conductor.tick(now_ns)
            if len(conductor.lost) != lost:
                self._outdate()
            self._settle(self._links)
            self._waited += time.monotonic() - began
            if conductor.over:
                log.info("lockstep: %s ended the run at %.3f s (tick %d); simulated time stops",
                         conductor.over, now_ns * 1e-9, conductor.ticks)
        return now_ns

    def status(self):
        """Return what diagnostics tell: ``(open, ticks, seconds waited in ticks, who was lost, what is missing)``."""
        conductor = self._conductor
        return (self._open and not conductor.over, conductor.ticks, self._waited, list(conductor.lost),
                ["nothing any more: %s says that the run is over" % conductor.over] if conductor.over
                else [] if self._open else list(self._missing))

    # ---- who takes part ----------------------------------------------------------------------------------------

    def _outdate(self):
        """Note that what was seen so far, or is being looked at just now, says nothing about who is there now."""
        self._generation += 1
        self._look = None

    def _watch(self):
        """Look at the graph, in a thread of its own, as long as somebody wants to know."""
        told = time.monotonic()
        while not self._closing and not rospy.is_shutdown():
            if not self._wanted.wait(_REMIND):
                told = time.monotonic()
                continue
            opening, missing = not self._open, ["an error to go away (see the log)"]
            try:
                missing = self._look_once()
            except Exception:       # whoever is missing must be looked for again
                log.exception("lockstep: looking for who takes part failed; it is tried again")
            self._missing = missing
            if not missing:
                told = time.monotonic()
            elif opening and time.monotonic() - told > _REMIND:
                told = time.monotonic()
                log.info("lockstep: time stands still at %.3f s until there is %s", self._simulator.now_ns * 1e-9,
                         "; ".join(missing[:6]) + ("; and %d more" % (len(missing) - 6) if len(missing) > 6 else ""))
            time.sleep(_LOOK_PAUSE if opening else _RETURN_PAUSE)

    def _look_once(self):
        """Look at the graph and keep what was seen if nothing is missing; returns what is."""
        generation, expected = self._generation, self._expected()
        look = self._gate.look(set(self._names) - set(expected))
        if not look.missing:
            self._wanted.clear()        # first, as it may be wanted again as soon as the look is there
            self._look = (generation, look, expected)
            self._loop.wake()
        return look.missing

    def _expected(self):
        """Return the controllers that must be there: all at the start, then those that have not left.

        Of those that were lost it is one at a time, when it could answer again, so that each may come back alone.
        """
        conductor = self._conductor
        if not conductor.ticks:
            return self._names
        if not self._open:
            return [member.name for member in list(conductor.members)]
        lines = [(name, self._lines.get(name)) for name in list(conductor.lost)]
        back = [name for name, line in lines if line is None or line.idle()]
        turn = back[int(time.monotonic()) % len(back):][:1] if back else []
        return [member.name for member in list(conductor.members)] + turn

    def _admit(self, look, expected):
        """Everybody is connected: take in who is new and let time pass."""
        conductor = self._conductor
        first = not conductor.ticks
        for name in expected:
            present = [member.name for member in conductor.members]
            if name not in present and (first or name in conductor.lost):
                old, self._lines[name] = self._lines.get(name), _Line(name, self._loop.wake)
                if old is not None:
                    old.close()
                order = self._names.index
                conductor.join(name, self._simulator.now_ns, sum(order(other) < order(name) for other in present))
                if not first:
                    log.info("lockstep: %s takes part from %.3f s on", name, self._simulator.now_ns * 1e-9)
        conductor.connected()
        self._outdate()         # a look from before says nothing about who is lost from now on
        self._connections = look.connections
        self._find_links(look.connections)
        if not self._open:
            self._open = True
            log.info("lockstep: all nodes are connected at %.3f s: %s%s", self._simulator.now_ns * 1e-9,
                     ", ".join([member.name for member in conductor.members] + [str(reply) for reply in self._replies]),
                     "; heard by " + ", ".join(entry.name for entry in self._listeners) if self._listeners else "")

    def _ask(self, name, request):
        return self._lines[name].ask(request)

    # ---- who listens -------------------------------------------------------------------------------------------

    def _find_links(self, connections):
        """Find the sockets of the listeners."""
        names = {listener.name for listener in self._listeners}
        wanted = [entry for entry in connections
                  if entry.subscriber in names and entry.publisher not in names and entry.topic not in NOT_WAITED_FOR]
        ends = find_ends({entry.ports for entry in wanted if entry.ports})
        self._links = [Link(entry.publisher, entry.subscriber, entry.topic, ends[entry.ports])
                       for entry in wanted if entry.ports in ends]
        # only where several publish on one topic can messages be read in another order than they were sent
        heard = [(entry.topic, entry.reader) for entry in self._links]
        several = [entry for entry in self._links if heard.count((entry.topic, entry.reader)) > 1]
        self._shared = [entry for entry in several if entry.publisher == rospy.get_name()]
        self._foreign = [entry for entry in several if entry.publisher != rospy.get_name()]
        unseen = sorted({entry.subscriber for entry in wanted if entry.ports not in ends})
        try:
            if self._unread is None and self._links:
                self._unread = UnreadBytes()
        except OSError:
            unseen, self._links, self._shared, self._foreign = sorted(names), [], [], []
        if unseen:
            log.warning("lockstep: cannot see whether %s has read its messages (it is on another machine, or the "
                        "system does not tell); where several nodes publish on one topic, it may hear them in "
                        "another order",
                        ", ".join(unseen))

    def _before_trigger(self):
        """Wait in the middle of a step: nobody may be served, nor an error raised, which would be the plugin's."""
        try:
            self._settle(self._shared, between_steps=False)
        except LockstepError as error:
            self._failure = error

    def _settle(self, links, between_steps=True):
        """Wait until the listeners have read everything; between two steps, requests are served meanwhile.

        Raises
        ------
        LockstepError
            If one does not read, unless time is to go on.
        ShuttingDown
            If the node is to end meanwhile; in the middle of a step the waiting just ends.
        """
        for link in list(links):
            deadline = None
            while self._bytes_left(link):
                now = time.monotonic()
                deadline = deadline or now + self._patience
                if now > deadline:
                    self._silent_listener(link)
                    break
                if between_steps:
                    self._loop.wait_until(lambda: False, _GLANCE)
                elif self._loop.stopping():
                    return
                else:
                    time.sleep(_GLANCE)

    def _bytes_left(self, link):
        try:
            unread = self._unread.of(link.ends)
        except OSError as error:
            log.warning("lockstep: cannot see whether %s has read what %s sent on %s (%s); it is waited for no more",
                        link.reader, link.publisher, link.topic, error)
            unread = None
        if unread is None:                  # it has gone; a listener may, if it is not to come back
            if any(entry.name == link.reader and entry.respawned for entry in self._listeners):
                self._close_for(link.reader)
            else:
                self._forget(lambda entry: entry is link)
        return unread

    def _close_for(self, name):
        """Let no time pass until a listener that has died has been started again."""
        log.warning("lockstep: %s has gone at %.3f s; time stands still until it is back", name,
                    self._simulator.now_ns * 1e-9)
        self._gate.forget(name, self._connections)
        self._forget(lambda entry: entry.reader == name)
        self._open = False
        self._outdate()

    def _forget(self, which):
        self._links, self._shared, self._foreign = ([entry for entry in links if not which(entry)] for links in (
            self._links, self._shared, self._foreign))

    def _silent_listener(self, link):
        sentence = "%s has not read what %s sent on %s within %g s of wall time" % (
            link.reader, link.publisher, link.topic, self._patience)
        if not self._go_on:
            raise LockstepError("lockstep: " + sentence)
        log.warning("lockstep: %s. Time goes on without waiting for it.", sentence)
        self._forget(lambda entry: entry.reader == link.reader)
