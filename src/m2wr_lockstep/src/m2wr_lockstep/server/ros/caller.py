# SPDX-License-Identifier: BSD-3-Clause
"""Calls one controller's service for its turns, in a thread of its own."""
import queue
import re
import threading

import rospy

from m2wr_lockstep.server.conductor import TurnAnswer, TurnFailed
from m2wr_lockstep.server.ros.gate import SERVICE
from m2wr_lockstep.srv import Turn
from m2wr_lockstep.srv import TurnRequest as TurnMessage
from m2wr_node.internals import service_connection

_RESPONDED = re.compile(r"responded with an error: b['\"](.*)['\"]$")      # rospy prints the bytes it received


class _Pending:
    """The future answer to one request."""

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


def _time(time_ns):
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

    def __init__(self, name, wake):
        self._wake, self._requests, self._newest = wake, queue.Queue(), None
        self._proxy = rospy.ServiceProxy("%s/%s" % (name, SERVICE), Turn, persistent=True)
        threading.Thread(target=self._run, name="turns of " + name, daemon=True).start()

    def ask(self, request):
        """Ask for a turn (a TurnRequest); returns the future answer."""
        self._newest = _Pending()
        self._requests.put((request, self._newest))
        return self._newest

    def idle(self):
        """Return whether every request has been answered or has failed."""
        return self._newest is None or self._newest.done()

    def close(self):
        """Disconnect after the present call has ended."""
        self._requests.put(None)

    def _run(self):
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
                                       answer.leave, answer.note), None)
            except Exception as error:      # rospy raises many kinds when the peer closes the connection
                said = _RESPONDED.search(str(error))
                pending.set(None, said.group(1) if said else str(error) or type(error).__name__)
            self._wake()
