# SPDX-License-Identifier: BSD-3-Clause
"""Shared by the nodes: start and end, logging, the loop, and conversion of messages to plain values."""
from __future__ import annotations

import logging
import math
import sys
import threading
import time
from typing import TYPE_CHECKING, Any, Callable, NoReturn, Optional, Protocol, Sequence, Tuple, Union

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_srvs.srv import SetBool, SetBoolResponse

from m2wr_lockstep.controller import Controller
from m2wr_node.pipes import ignore_closed_pipes
from m2wr_node.ros.ending import end_run
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from motion_plan.angles import yaw_of_quaternion
from motion_plan.pose_history import PoseHistory
from motion_plan.regions import RegionReader, ScanError
from motion_plan.ros_parameters import NodeError
from motion_plan.surroundings import Surroundings

if TYPE_CHECKING:
    from motion_plan.planar_types import Command, Pose, Regions

RATE_HZ = 20
#: Wall seconds between two messages about a wait.
REMIND_SECONDS = 5.0
#: Wall seconds after which waiting gives a warning.
LONG_WAIT_SECONDS = 60.0
#: Messages older than this [s] are not used for driving.
STALE_SECONDS = 1.0
#: Wall seconds that roslaunch has to end this node; then it exits, and roslaunch reports a death.
PARTING_SECONDS = 15.0
SCAN_TOPIC = '/m2wr/laser/scan'


class SpinningNode(Protocol):
    """A node that :func:`run_node` can run."""

    def spin(self) -> Optional[int]:
        """Run the node; return its exit code, None for 0."""


class RosoutHandler(logging.Handler):
    """Passes the log lines of the ROS-free modules to rospy, for the screen and /rosout."""

    def emit(self, record: logging.LogRecord) -> None:
        """Log ``record`` at rospy's level of the same name."""
        log = {logging.DEBUG: rospy.logdebug, logging.INFO: rospy.loginfo, logging.WARNING: rospy.logwarn}
        log.get(record.levelno, rospy.logerr)('%s', record.getMessage())


def _end_unread() -> None:
    # not during the failed write: the shutdown may print more lines
    threading.Thread(target=rospy.signal_shutdown, args=('the pipe of the output is closed',), daemon=True).start()


def run_node(name: str, make_node: Callable[[], SpinningNode], only_prints: bool = False) -> NoReturn:
    """Start a node, run it and leave with its exit code.

    A required node that ends by itself with 0 asks its roslaunch to stop; roslaunch would report its exit as a crash.
    A NodeError gives one fatal line and exit code 1, no traceback.

    Parameters
    ----------
    name : str
        Default name of the node.
    make_node : callable
        Returns the node; called after the registration.
    only_prints : bool
        Whether the node ends when the pipe of its output is closed; other nodes continue.
    """
    ignore_closed_pipes(_end_unread if only_prints else None)
    start_node(name)
    library = logging.getLogger('motion_plan')
    library.addHandler(RosoutHandler())
    library.setLevel(logging.INFO)
    library.propagate = False
    try:
        code = make_node().spin()
        if code == 0 and not rospy.core.is_shutdown_requested():
            _end_the_run()
    except NodeError as error:
        rospy.logfatal('%s: %s', rospy.get_name(), error)
        code = 1
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():
            raise
        code = 0        # interrupted while sleeping, or publishing on a topic that has just been closed
    sys.exit(code or 0)


def _end_the_run() -> None:
    """Let roslaunch stop the run if this node is required; without roslaunch the node just ends."""
    rospy.loginfo('%s has finished: the run ends', rospy.get_name())
    if end_run():
        deadline = time.monotonic() + PARTING_SECONDS
        while not rospy.is_shutdown() and time.monotonic() < deadline:
            time.sleep(0.02)


def wait_while(condition: Callable[[], bool], sentence: Callable[[], str]) -> None:
    """Wait in wall time while a condition holds; log a sentence every five seconds.

    A start takes long on a slow machine: waiting is a warning only after a minute.

    Parameters
    ----------
    condition : callable
        Returns whether to continue waiting.
    sentence : callable
        Returns what is waited for, for the log.

    Raises
    ------
    ROSInterruptException
        If the node shuts down.
    """
    began = last = time.monotonic()
    while condition():
        if rospy.is_shutdown():
            raise rospy.ROSInterruptException('shutdown while waiting')
        if time.monotonic() - last > REMIND_SECONDS:
            last = time.monotonic()
            tell = rospy.loginfo if last - began < LONG_WAIT_SECONDS else rospy.logwarn
            tell('%s', sentence())
        time.sleep(0.02)


def wait_for_clock() -> None:
    """Wait for the simulated clock, if it is used."""
    wait_while(lambda: rospy.get_rostime().is_zero(),
               lambda: '%s: /use_sim_time is true but nothing publishes /clock; start the simulator, or "rosparam set '
                       '/use_sim_time false" if none is to run' % rospy.get_name())


def spin_at_rate(turn: Callable[[float], Optional[int]], time_reset: Callable[[], object]) -> int:
    """Call a function at 20 Hz until it returns an exit code or ROS shuts down.

    Parameters
    ----------
    turn : callable
        ``turn(now)`` with the ROS time [s] returns an exit code, or None to continue.
    time_reset : callable
        Called when time has jumped back, as after a reset of the simulation.

    Returns
    -------
    int
        The exit code; 0 after a shutdown.
    """
    wait_for_clock()
    rate = rospy.Rate(RATE_HZ, reset=True)
    last = rospy.get_time()
    while not rospy.is_shutdown():
        now = rospy.get_time()
        if now < last:
            rospy.logwarn('%s: time jumped back from %.3f s to %.3f s; restarting', rospy.get_name(), last, now)
            time_reset()
            rate = rospy.Rate(RATE_HZ, reset=True)
        last = now
        code = turn(now)
        if code is not None:
            return code
        try:
            rate.sleep()
        except rospy.ROSTimeMovedBackwardsException:
            continue
    return 0


def planar_pose(msg: Odometry) -> Tuple[Pose, Tuple[float, float]]:
    """Return (pose, speed) of a nav_msgs/Odometry: (x, y, yaw) and (linear_x, angular_z).

    Raises
    ------
    ValueError
        If one of the numbers is not finite.
    """
    position, q = msg.pose.pose.position, msg.pose.pose.orientation
    pose = (position.x, position.y, yaw_of_quaternion(q.x, q.y, q.z, q.w))
    speed = (msg.twist.twist.linear.x, msg.twist.twist.angular.z)
    if not all(math.isfinite(value) for value in pose + speed):
        raise ValueError('position (%s, %s), speed %s: expected finite numbers' % (position.x, position.y, speed))
    return pose, speed


class Rhythm:
    """Timing of a node on its own: messages are processed on arrival, updates run at 20 Hz.

    :class:`m2wr_lockstep.controller.Controller` has the same methods, for updates on requests of the simulator.
    """

    lockstep = False
    #: What the node does at present; only a lockstep controller sends it to the simulator.
    note = ''

    @staticmethod
    def subscribe(topic: str, message_class: Any, callback: Callable[[Any], object]) -> None:
        """Subscribe to a topic; of several waiting messages only the newest is passed.

        Parameters
        ----------
        topic : str
            Name of the topic.
        message_class : type
            Class of its messages.
        callback : callable
            Called with each new message.
        """
        rospy.Subscriber(topic, message_class, callback, queue_size=1, tcp_nodelay=True)

    @staticmethod
    def publisher(topic: str, message_class: Any, queue_size: int = 1, latch: bool = False) -> rospy.Publisher:
        """Return a publisher.

        Parameters
        ----------
        topic : str
            Name of the topic.
        message_class : type
            Class of its messages.
        queue_size : int
            Number of messages that may wait to be sent.
        latch : bool
            Whether a new subscriber receives the last message.
        """
        return rospy.Publisher(topic, message_class, queue_size=queue_size, latch=latch)

    @staticmethod
    def spin(turn: Callable[[float], Optional[int]], time_reset: Callable[[], object]) -> int:
        """Call a function at 20 Hz; see :func:`spin_at_rate`.

        Parameters
        ----------
        turn : callable
            ``turn(now)`` with the ROS time [s] returns an exit code, or None to continue.
        time_reset : callable
            Called when time has jumped back, as after a reset of the simulation.

        Returns
        -------
        int
            The exit code.
        """
        return spin_at_rate(turn, time_reset)


class Lockstep(Controller):
    """The timing of a node in lockstep with the simulation."""

    lockstep = True


#: How a node is timed: on its own or by the simulator.
Timing = Union[Rhythm, Lockstep]


def choose_rhythm() -> Timing:
    """Return the Rhythm selected by ``~lockstep``; must be the first call of a node."""
    wanted = rospy.get_param('~lockstep', False)
    if not isinstance(wanted, bool):
        raise NodeError('parameter ~lockstep is %r: expected true or false' % (wanted,))
    return Lockstep() if wanted else Rhythm()


class Senses:
    """The newest odometry and scan of a node, as plain values; subscribes by itself.

    Parameters
    ----------
    rhythm : Rhythm
    odom, scan : bool
        Topics to subscribe to.
    remember : bool
        Whether to fill ``surroundings``.
    bounds : optional
        Of the sectors, for RegionReader.
    on_regions : callable, optional
        Called with the regions of every scan.

    Attributes
    ----------
    lock : threading.RLock
        Must be held while several attributes are read together.
    pose, speed : tuple or None
        Of the newest odometry.
    regions : dict or None
        Sector minima of the newest valid scan.
    surroundings : Surroundings
        Filled if ``remember`` is true and there is odometry.
    frame_id, base_frame : str
        Frames of the newest odometry: its own, and that of the robot.
    jumped, scan_since_jump : bool
        Whether the robot has been moved since the node last set ``jumped`` to False, and whether there is a scan from
        the new place.
    """

    def __init__(self, rhythm: Timing, odom: bool = True, scan: bool = True, remember: bool = False,
                 bounds: Optional[Sequence[Tuple[int, int]]] = None,
                 on_regions: Optional[Callable[[Regions], object]] = None) -> None:
        self.lock = threading.RLock()
        self.surroundings = Surroundings()
        self.reader = RegionReader(bounds) if bounds else RegionReader()
        self.history = PoseHistory()
        self._remember, self._on_regions = remember, on_regions
        self.counts = {'/odom': 0, SCAN_TOPIC: 0}      # of accepted messages, for diagnostics
        self.pose: Optional[Pose] = None
        self.speed: Optional[Tuple[float, float]] = None
        self.regions: Optional[Regions] = None
        self.odom_time: Optional[float] = None
        self.scan_time: Optional[float] = None
        self.scan_stamp: Optional[float] = None
        self.forget()
        if odom:
            rhythm.subscribe('/odom', Odometry, self.clbk_odom)
        if scan:
            rhythm.subscribe(SCAN_TOPIC, LaserScan, self.clbk_laser)

    def forget(self, not_before: float = 0.0) -> None:
        """Drop everything received so far, and refuse messages stamped before ``not_before`` [s]."""
        with self.lock:
            self.pose = self.speed = self.regions = None
            self.frame_id, self.base_frame = 'odom', 'link_chassis'
            self.jumped, self.scan_since_jump = False, True
            self.odom_time = self.scan_time = self.scan_stamp = None
            self._not_before = not_before
            self.history.clear()
            self.surroundings.clear()

    def clbk_odom(self, msg: Odometry) -> None:
        """Store pose and speed; refuse values that are not finite."""
        try:
            pose, speed = planar_pose(msg)
        except ValueError as error:
            rospy.logwarn_throttle(5.0, '%s: /odom refused: %s' % (rospy.get_name(), error))
            return
        stamp = msg.header.stamp.to_sec()
        with self.lock:
            if 0.0 < stamp < self._not_before:
                return
            self.pose, self.speed, self.odom_time = pose, speed, rospy.get_time()
            self.counts['/odom'] += 1
            self.frame_id = msg.header.frame_id or 'odom'
            self.base_frame = msg.child_frame_id or 'link_chassis'
            if self.history.is_jump(stamp, pose):
                # the robot was never between the two places: no scan may be transformed with such a pose
                self.history.clear()
                self._not_before = stamp
                self.jumped, self.scan_since_jump = True, False
            self.history.add(stamp, pose)

    def clbk_laser(self, msg: LaserScan) -> None:
        """Store the sector minima and remember the points; refuse invalid scans."""
        try:
            regions = self.reader.read(msg.ranges, msg.angle_min, msg.angle_max, msg.angle_increment)
        except ScanError as error:
            rospy.logwarn_throttle(5.0, '%s: %s refused: %s' % (rospy.get_name(), SCAN_TOPIC, error))
            return
        for notice in self.reader.take_notices():
            rospy.logwarn('%s: %s', rospy.get_name(), notice)
        stamp = msg.header.stamp.to_sec()
        with self.lock:
            if 0.0 < stamp < self._not_before:
                return
            self.regions, self.scan_time, self.scan_stamp = regions, rospy.get_time(), stamp
            self.counts[SCAN_TOPIC] += 1
            self.scan_since_jump = True
            pose = self.history.at(stamp) if self._remember else None
            if pose is not None:
                self.surroundings.update(msg.ranges, msg.angle_min, msg.angle_increment, pose)
            if self._on_regions is not None:
                self._on_regions(regions)

    def scan_age(self, now: float) -> float:
        """Return the age of the newest scan [s], inf without one.

        The age is taken from the stamp of the scan, or from its arrival if stamps come from another clock.
        """
        if self.scan_stamp is None or self.scan_time is None:
            return math.inf
        age = now - self.scan_stamp
        return age if 0.0 <= age < 5.0 else max(0.0, now - self.scan_time)

    def stale(self, now: float) -> str:
        """Return the topics whose newest message is older than a second, as a text; '' if there is none."""
        names = [name for name, at in (('/odom', self.odom_time), (SCAN_TOPIC, self.scan_time))
                 if at is not None and now - at > STALE_SECONDS]
        return ' and '.join(names)


#: Wall seconds that a shutdown waits for a command in publication.
SHUTDOWN_PATIENCE = 0.2


class Switchable:
    """Publishes commands while switched on; one zero command when switched off or shut down.

    Parameters
    ----------
    rhythm : Rhythm
    service : str
        Name of the std_srvs/SetBool service.
    on_switch : callable
        Called with True or False on a change, before anything is published.
    """

    def __init__(self, rhythm: Timing, service: str, on_switch: Callable[[bool], object]) -> None:
        self.active = False
        self.command: Command = (0.0, 0.0)
        self._lock = threading.Lock()
        self._on_switch = on_switch
        self._publisher = rhythm.publisher('/cmd_vel', Twist)
        rospy.Service(service, SetBool, self.clbk_switch)
        at_shutdown(self._shut_down)

    def clbk_switch(self, request: Any) -> SetBoolResponse:
        """Serve the switch; the reply is the report's: success, 'Done!'."""
        if self.active != request.data:
            self._on_switch(request.data)       # acquires other locks: not under this one
        with self._lock:
            changed = self.active != request.data
            self.active = request.data
            if changed and not request.data:
                self._publisher.publish(Twist())
        return SetBoolResponse(success=True, message='Done!')

    def publish(self, command: Command) -> None:
        """Publish (linear_x, angular_z), unless switched off in the meantime."""
        msg = Twist()
        msg.linear.x, msg.angular.z = command
        with self._lock:
            if self.active:
                self.command = command
                self._publisher.publish(msg)

    def _shut_down(self) -> None:
        # rospy calls this inside its signal handler, on a thread that may hold the lock:
        # wait for another thread, but with a limit
        locked = self._lock.acquire(timeout=SHUTDOWN_PATIENCE)
        try:
            if self.active:
                self.active = False
                self._publisher.publish(Twist())
                time.sleep(0.1)    # the queued message must be sent before the process ends
        finally:
            if locked:
                self._lock.release()
