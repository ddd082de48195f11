# SPDX-License-Identifier: BSD-3-Clause
"""A rospy controller in lockstep: it subscribes, publishes and takes a turn when the simulator requests one."""
from __future__ import annotations

import threading
import warnings
from typing import Any, Callable, Optional

import rospy
from rospy.rostime import wallsleep

from m2wr_lockstep.client.inputs import Inputs, TurnError
from m2wr_lockstep.client.outputs import Outputs
from m2wr_lockstep.srv import Turn, TurnResponse
from m2wr_node.internals.ros_time import make_own_clock, set_ros_time
from m2wr_node.ros.shutdown import at_shutdown

SERVICE = "lockstep_turn"
#: Wall seconds to wait for messages that the simulator says it has sent.
PATIENCE = 5.0
#: Wall seconds between the last answer and the end of the node, in which rospy sends it.
END_DELAY = 0.2
#: Wall seconds without a first turn after which that is logged; then after twice as many, and so on.
REMINDER = 5.0
LONG_WAIT = 60.0        # s of wall time after which waiting for the first turn is worth a warning


def _sender_of(message: Any) -> str:
    """Return the name of the node that has sent a message or request; "" if rospy does not report it."""
    return (getattr(message, "_connection_header", None) or {}).get("callerid", "")


def _stamp_of(message: Any, default: int) -> int:
    """Return the stamp of a message [ns]; ``default`` for one without a header."""
    header = getattr(message, "header", None)
    return default if header is None else header.stamp.to_nsec()


class Output:
    """A publisher that counts; its message has been passed to the network when :meth:`publish` returns."""

    def __init__(self, outputs: Outputs, topic: str, message_class: Any, latch: bool) -> None:
        with warnings.catch_warnings():
            # without a queue rospy publishes in the caller's thread; its warning does not apply here
            warnings.simplefilter("ignore", SyntaxWarning)
            self._publisher = rospy.Publisher(topic, message_class, latch=latch, tcp_nodelay=True, queue_size=None)
        self._outputs, self._topic = outputs, self._publisher.resolved_name

    def publish(self, message: Any) -> None:
        """Publish a message."""
        self._outputs.count(self._topic)
        self._publisher.publish(message)

    def get_num_connections(self) -> int:
        """Return the number of subscribers."""
        return self._publisher.get_num_connections()


class Controller:
    """One controller of a node; make it after ``rospy.init_node`` and before anything else of the node.

    The node's ROS time is the time of its newest turn from here on (zero before the first); it does not follow /clock,
    and nothing may wait for time to pass.
    """

    def __init__(self) -> None:
        self._inputs, self._outputs = Inputs(), Outputs()
        self._turn: Optional[Callable[[float], Optional[int]]] = None
        self._time_reset: Optional[Callable[[], object]] = None
        self._last: Optional[int] = None        # simulated time of the newest turn [ns]
        self._taking = threading.Lock()     # a simulator that stopped waiting may ask again during the previous turn
        self._code: Optional[int] = None
        self._error: Optional[Exception] = None
        self._ended = threading.Event()
        self.note = ""
        make_own_clock()
        set_ros_time(rospy.Time(0))

    def subscribe(self, topic: str, message_class: Any, callback: Callable[[Any], object]) -> None:
        """Subscribe to a topic.

        Parameters
        ----------
        topic : str
            Its name before remapping.
        message_class : type
        callback : callable
            Called with each message at the beginning of a turn.
        """
        resolved = rospy.resolve_name(topic)
        self._inputs.add(resolved, callback)
        rospy.Subscriber(topic, message_class,
                         lambda message: self._inputs.receive(resolved, message, _sender_of(message)),
                         queue_size=None, tcp_nodelay=True)

    def publisher(self, topic: str, message_class: Any, queue_size: Optional[int] = None,
                  latch: bool = False) -> Output:
        """Return a publisher.

        Parameters
        ----------
        topic : str
            Its name before remapping.
        message_class : type
        queue_size : int, optional
            Not used, as messages are sent at once.
        latch : bool
            Send the last message to each new subscriber.
        """
        return Output(self._outputs, topic, message_class, latch)

    def spin(self, turn: Callable[[float], Optional[int]], time_reset: Optional[Callable[[], object]] = None) -> int:
        """Announce the controller and take turns until ``turn`` returns an exit code or ROS shuts down.

        Parameters
        ----------
        turn : callable
            ``turn(now)`` with the simulated time [s].  It returns None, or an exit code when the run is over: simulated
            time then stops.
        time_reset : callable, optional
            Called before a turn whose time is earlier than that of the turn before.

        Returns
        -------
        int
            The exit code; 0 after a shutdown.
        """
        self._turn, self._time_reset = turn, time_reset
        service = rospy.Service("~" + SERVICE, Turn, self._serve)
        at_shutdown(self._ended.set)
        self._wait_for_the_end()
        if self._error is not None:
            raise self._error
        if self._code is not None:
            wallsleep(END_DELAY)        # rospy does not report when the answer has been sent
        service.shutdown("the node ends")
        return self._code or 0

    def _wait_for_the_end(self) -> None:
        """Wait, and log when no turn is requested: as a warning only after a minute, for a start takes time."""
        waited, pause, told = 0.0, REMINDER, 0
        while not self._ended.wait(pause):
            waited += pause
            if self._last is None:
                tell = rospy.loginfo if waited < LONG_WAIT else rospy.logwarn
                tell("%s: waiting for the simulator's first lockstep request (%g s). It comes when all nodes of the "
                     "lockstep are connected, if the simulator runs with ~lockstep and has this name in its "
                     "~lockstep_controllers.",
                     rospy.get_name(), waited)
                pause = waited
            else:
                pause = REMINDER
            dropped = self._inputs.dropped
            if dropped > told:
                tell = rospy.loginfo if self._last is None and waited < LONG_WAIT else rospy.logwarn
                tell("%s: %d messages were dropped while no lockstep request came", rospy.get_name(), dropped - told)
                told = dropped

    def _serve(self, request: Any) -> TurnResponse:
        """Take one turn, after the present one if there is one."""
        with self._taking:
            return self._serve_alone(request)

    def _serve_alone(self, request: Any) -> TurnResponse:
        """Take one turn; an error is sent to the simulator and raised by :meth:`spin`."""
        if self._ended.is_set():
            raise rospy.ServiceException("%s has ended" % rospy.get_name())
        try:
            return self._take(request)
        except TurnError as error:
            raise rospy.ServiceException(str(error)) from None
        except Exception as error:
            self._error = error
            self._ended.set()
            raise

    def _take(self, request: Any) -> TurnResponse:
        assert self._turn is not None           # the service is there from `spin` on
        self._outputs.begin()
        now_ns, since_ns = request.stamp.to_nsec(), request.since.to_nsec()
        set_ros_time(rospy.Time(request.stamp.secs, request.stamp.nsecs))
        rewound = False
        if self._last is not None and now_ns < self._last:
            rewound = True
            rospy.logwarn("%s: time jumped back from %.3f s to %.3f s; restarting", rospy.get_name(),
                          self._last * 1e-9, now_ns * 1e-9)
            if self._time_reset is not None:
                self._time_reset()
        self._last = now_ns
        self._inputs.take(dict(zip(request.topics, request.counts)), PATIENCE,
                          lambda message: not since_ns or _stamp_of(message, since_ns + 1) > since_ns,
                          lambda message: not rewound or _stamp_of(message, now_ns) <= now_ns,
                          _sender_of(request) or None)
        code = self._turn(request.stamp.to_sec())
        response = TurnResponse(note=str(self.note), over=code is not None)
        for topic, (early, count) in self._outputs.end().items():
            response.topics.append(topic)
            response.early.append(early)
            response.counts.append(count)
        if code is not None:
            self._code = code
            self._ended.set()
        return response
