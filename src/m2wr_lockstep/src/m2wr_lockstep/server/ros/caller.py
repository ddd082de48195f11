# SPDX-License-Identifier: BSD-3-Clause
"""Calls one controller's service for its turns, in a thread of its own."""
from __future__ import annotations

import queue
import re
import threading
from typing import Any, Callable, Optional, Tuple

import rospy

from m2wr_lockstep.server.conductor import TurnAnswer, TurnFailed, TurnRequest
from m2wr_lockstep.server.ros.gate import SERVICE
from m2wr_lockstep.srv import Turn
from m2wr_lockstep.srv import TurnRequest as TurnMessage
from m2wr_node.internals import service_connection

_RESPONDED = re.compile(r"responded with an error: b['\"](.*)['\"]$")      # rospy prints the bytes it received


class _Pending:
    """The future answer to one request."""

    def __init__(self) -> None:
        self._done = False
        self._answer: Optional[TurnAnswer] = None
        self._error = ""

    def set(self, answer: TurnAnswer) -> None:
        self._answer, self._done = answer, True

    def fail(self, error: str) -> None:
        self._error, self._done = error, True

    def done(self) -> bool:
        return self._done

    def result(self) -> TurnAnswer:
        if self._answer is None:
            raise TurnFailed(self._error)
        return self._answer


def _time(time_ns: int) -> Any:
    """Return a rospy.Time."""
    return rospy.Time(*divmod(time_ns, 1000000000))


class Caller:
    """A lasting connection to one controller; its thread waits for the answers.

    Parameters
    ----------
    name : str
        Name of the controller's node.
    wake : callable
        Called in the thread after each answer.
    """

    def __init__(self, name: str, wake: Callable[[], object]) -> None:
        self._wake = wake
        self._requests: queue.Queue[Optional[Tuple[TurnRequest, _Pending]]] = queue.Queue()     # None: close
        self._newest: Optional[_Pending] = None
        self._proxy = rospy.ServiceProxy("%s/%s" % (name, SERVICE), Turn, persistent=True)
        threading.Thread(target=self._run, name="turns of " + name, daemon=True).start()

    def ask(self, request: TurnRequest) -> _Pending:
        """Ask for a turn; returns the future answer."""
        self._newest = pending = _Pending()
        self._requests.put((request, pending))
        return pending

    def idle(self) -> bool:
        """Return whether every request has been answered or has failed."""
        return self._newest is None or self._newest.done()

    def close(self) -> None:
        """Disconnect after the present call has ended."""
        self._requests.put(None)

    def _run(self) -> None:
        while True:
            job = self._requests.get()
            if job is None:
                self._proxy.close()
                return
            request, pending = job
            message = TurnMessage(request.tick, _time(request.now_ns), _time(request.since_ns),
                                  list(request.news), list(request.news.values()))
            try:
                service_connection.connect(self._proxy)
                answer = self._proxy(message)
                pending.set(TurnAnswer(tuple(zip(answer.topics, answer.early, answer.counts)), answer.over,
                                       answer.leave, answer.note))
            except Exception as error:      # rospy raises many kinds when the peer closes the connection
                said = _RESPONDED.search(str(error))
                pending.fail(said.group(1) if said else str(error) or type(error).__name__)
            self._wake()
