# SPDX-License-Identifier: BSD-3-Clause
"""Queue of scans: each waits until the transform of its laser is known; callbacks never block."""
from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Callable, Deque, Dict, List, Optional, Set, Tuple

import rospy
import tf2_ros

from m2wr_maps.ros.future_transforms import JUMP, FarAhead, LatestStamps
from m2wr_maps.ros.missing_inputs import usual_source
from m2wr_maps.scan_account import (
    AT_END,
    BAD_HEADER,
    DROPPED,
    EARLY,
    NO_TRANSFORM,
    OUT_OF_ORDER,
    QUEUE_FULL,
    TIME_JUMP,
    ScanAccount,
)
from m2wr_maps.transforms import transform_parts
from m2wr_node.ros.transform_buffer import fault_of, fault_of_transform

if TYPE_CHECKING:
    import genpy
    from geometry_msgs.msg import TransformStamped
    from sensor_msgs.msg import LaserScan
    from tf2_msgs.msg import TFMessage

    from m2wr_maps.transforms import Transform

BUFFER = 60.0               # length of the transform buffer [s]
OLD_MESSAGES = 5.0             # time after a jump in which messages with old stamps are ignored [s]
WAIT_WARNING = 5.0          # wall time after which a waiting scan causes a warning [s]
LOSS_WARNING = 5.0          # least wall time between two warnings about scans lost for the same reason [s]


@dataclass(frozen=True)
class Wording:
    """What messages say about the node that takes the scans.

    Attributes
    ----------
    odom_parameter, base_parameter : str
        Names of its parameters for the frames of odometry and base.
    silence : str
        How to stop its transform of the odometry's frame.
    after_jump : str
        What it does when time jumps back.
    """

    odom_parameter: str
    base_parameter: str
    silence: str
    after_jump: str


class _Waiting:
    """A scan in the queue, and its transform as soon as that is known.

    Attributes
    ----------
    scan : LaserScan
    source : str
        Frame of the laser.
    found : ((3,), (4,)) or None
        Translation and quaternion of the laser in the odometry's frame. Stored here, it does not depend on how long
        the buffer keeps transforms.
    """

    __slots__ = ("found", "scan", "source")

    def __init__(self, scan: LaserScan) -> None:
        self.scan, self.source = scan, scan.header.frame_id.lstrip("/")
        self.found: Optional[Transform] = None

    @property
    def stamp(self) -> genpy.Time:
        """Stamp of the scan."""
        return self.scan.header.stamp


class Intake:
    """Queue of scans and buffer of transforms, filled by callbacks and read by one worker.

    Parameters
    ----------
    odom_frame : str
    limit : int
        Greatest number of waiting scans; the oldest is dropped first.
    wording : Wording
        For messages.
    map_frame : str, optional
        Transforms from this frame to that of odometry are ignored: they are results of mapping or localization.
    publishes : callable, optional
        Whether this node publishes that transform (bool). If so, other parents of the odometry frame cause a warning.

    Attributes
    ----------
    generation : int
        Number of jumps back in time; each one starts a new run.
    account : ScanAccount
        Of all scans that have arrived.
    lacks : str
        The transform that is missing for too long; empty if none is.
    """

    def __init__(self, odom_frame: str, limit: int, wording: Wording, map_frame: Optional[str] = None,
                 publishes: Callable[[], bool] = lambda: False) -> None:
        self._wording = wording
        self._odom, self._limit, self._map, self._publishes = odom_frame, limit, map_frame, publishes
        self._buffer = tf2_ros.BufferCore(rospy.Duration.from_sec(BUFFER))
        self._far_ahead, self._stamps = FarAhead(BUFFER), LatestStamps()
        self._news = threading.Condition()
        self._waiting: Deque[_Waiting] = deque()
        self._frames: Set[str] = set()
        self._rivals: Set[str] = set()      # nodes that publish a parent of the odometry's frame too
        self._present = self._time_before = rospy.Time(0)       # time of the clock, or of the newest scan
        self._ignore_old_until = 0.0
        self._taken_stamp: Optional[genpy.Time] = None      # of the newest scan handed out
        self._odd_stamp: Optional[genpy.Time] = None        # of the last scan, if it looked like a jump back in time
        self._blocked_since: Optional[float] = None         # wall time [s]
        self._closed = False
        self.generation = 0
        self.account = ScanAccount()
        self._warned: Dict[str, float] = {}     # reason -> wall time of the last warning [s]
        self.lacks = ""

    @property
    def arrived(self) -> int:
        """Number of received scans."""
        return self.account.received

    @property
    def dropped(self) -> int:
        """Number of scans that were dropped here; those before the first transform are not among them."""
        return self.account.count(*DROPPED)

    def _lose(self, reason: str, count: int, message: str) -> None:
        """Count scans that are dropped, and warn at the first one and from time to time."""
        self.account.leave_out(reason, count)
        now = time.monotonic()
        if now - self._warned.get(reason, -math.inf) >= LOSS_WARNING:
            self._warned[reason] = now
            rospy.logwarn("%s; so far %s", message, self.account.text())

    # ---- called by ROS

    def on_transforms(self, message: TFMessage, static: bool = False) -> None:
        """Store the transforms of a TFMessage.

        Parameters
        ----------
        message : TFMessage
        static : bool
            Whether it is from /tf_static.
        """
        self._look_at_clock()
        with self._news:                # no jump in time may interfere
            for transform in message.transforms:
                transform.header.frame_id = transform.header.frame_id.lstrip("/")
                transform.child_frame_id = transform.child_frame_id.lstrip("/")
                if transform.child_frame_id == self._odom:
                    self._look_at_parent(transform.header.frame_id, message)
                if transform.header.frame_id != self._map or transform.child_frame_id != self._odom:
                    self._put_transform(transform, static)
            self._look_up()
            if self._waiting:
                self._news.notify()

    def _look_at_parent(self, parent: str, message: TFMessage) -> None:
        """Warn about another publisher of the odometry frame's parent: listeners would alternate between the two."""
        sender = (getattr(message, "_connection_header", None) or {}).get("callerid")
        if sender is None or sender == rospy.get_name() or sender in self._rivals or not self._publishes():
            return
        self._rivals.add(sender)
        rospy.logwarn("%s publishes %s -> %s, this node publishes %s -> %s: rviz and others alternate between the two. "
                      "Expected one of them: stop the other node, play bags without that transform, or %s",
                      sender, parent, self._odom, self._map, self._odom, self._wording.silence)

    def _put_transform(self, transform: TransformStamped, static: bool) -> None:
        parent, child, stamp = transform.header.frame_id, transform.child_frame_id, transform.header.stamp
        self._frames.update((parent, child))
        fault = fault_of_transform(transform)
        if fault:
            rospy.logwarn_throttle(10.0, "transform %s -> %s refused: %s" % (parent, child, fault))
            return
        try:
            if static:
                self._buffer.set_transform_static(transform, "tf")
            elif self._is_before_jump(stamp):
                return
            elif self._far_ahead.has(child, stamp):
                rospy.logwarn_throttle(10.0, "transform %s -> %s at %.3f ignored: far ahead of the one before" % (
                    parent, child, stamp.to_sec()))
            else:
                self._stamps.put(child, stamp)
                self._buffer.set_transform(transform, "tf")
        except tf2_ros.TransformException as error:
            rospy.logwarn_throttle(10.0, "transform %s -> %s refused: %s" % (parent, child, error))

    def on_scan(self, scan: LaserScan) -> None:
        """Queue a LaserScan."""
        self._look_at_clock()
        stamp = scan.header.stamp
        with self._news:
            self.account.received += 1
            fault = fault_of(scan.header)
            if fault:
                self._lose(BAD_HEADER, 1, "scan dropped: %s" % fault)
                return
            if self._is_before_jump(stamp):
                self._lose(TIME_JUMP, 1, "scan at %.3f dropped: sent before the jump back in time" % stamp.to_sec())
                return
            last = self._taken_stamp
            if last is None and self._waiting:
                last = self._waiting[-1].stamp
            if last is not None and (last - stamp).to_sec() > JUMP:
                older = self._taken_stamp is None or self._stamps.allow_jump()
                if self._odd_stamp is None or stamp <= self._odd_stamp or not older:
                    self._odd_stamp = stamp
                    self._lose(OUT_OF_ORDER, 1, "scan at %.3f dropped: the last one was at %.3f; time has jumped back "
                               "if the next scans and transforms are older too" % (stamp.to_sec(), last.to_sec()))
                    return
                self._jumped("the scans' stamps have", last, stamp, self._taken_stamp is not None)
            self._odd_stamp = None
            if rospy.rostime.is_wallclock():
                self._present = stamp
            self._put(scan)
            self._look_up()
            self._news.notify()

    def _put(self, scan: LaserScan) -> None:
        """Insert a scan by its stamp, so that scans with stamps far ahead do not block others."""
        waiting, stamp = self._waiting, scan.header.stamp
        place = len(waiting)
        while place and stamp < waiting[place - 1].stamp:
            place -= 1
        before = waiting[place - 1].stamp if place else self._taken_stamp
        if before is not None and stamp <= before:
            self._lose(OUT_OF_ORDER, 1, "scan at %.3f dropped: it arrived after one at %.3f" % (
                stamp.to_sec(), before.to_sec()))
            return
        waiting.insert(place, _Waiting(scan))
        if len(waiting) > self._limit:
            waiting.popleft()
            self._lose(QUEUE_FULL, 1, "the queue of %d scans is full: the oldest are dropped" % self._limit)

    def _is_before_jump(self, stamp: genpy.Time) -> bool:
        """Whether a message with this stamp was sent before the last jump back in time."""
        return bool(time.monotonic() < self._ignore_old_until and (stamp - self._present).to_sec() > JUMP
                    and abs((stamp - self._time_before).to_sec()) < OLD_MESSAGES)

    def _look_at_clock(self) -> None:
        if rospy.rostime.is_wallclock():
            return
        with self._news:
            now = rospy.Time.now()          # under the lock, so that times of two threads stay in order
            if not now:
                return
            # smaller jumps are due to a recorded /clock beside that of the player
            if (self._present - now).to_sec() > JUMP:
                self._jumped("the clock has", self._present, now)
            self._present = max(self._present, now)

    def _jumped(self, what: str, before: genpy.Time, now: genpy.Time, new_run: bool = True) -> None:
        self.generation += bool(new_run)
        self.account.leave_out(TIME_JUMP, len(self._waiting))       # the warning is below
        self._waiting.clear()
        self._buffer.clear()
        self._far_ahead.forget()
        self._stamps.forget()
        self._taken_stamp = self._odd_stamp = self._blocked_since = None
        self._time_before, self._present, self._ignore_old_until = before, now, time.monotonic() + OLD_MESSAGES
        rospy.logwarn("%s jumped back from %.3f to %.3f: transforms and waiting scans are dropped%s", what,
                      before.to_sec(), now.to_sec(), " and " + self._wording.after_jump if new_run else "")

    # ---- called by the worker

    def next(self) -> Optional[Tuple[LaserScan, Transform, int]]:
        """Wait for a scan whose transform is known.

        Returns
        -------
        (LaserScan, ((3,), (4,)), int) or None
            The scan, translation and quaternion of its laser in the odometry's frame, the generation; None after
            ``close``.
        """
        with self._news:
            while not self._closed:
                found = self._ready()
                if found is not None:
                    self._blocked_since, self.lacks = None, ""
                    return found
                self._complain()
                self._news.wait(1.0)
        return None

    def _look_up(self) -> None:
        """Find the transforms of waiting scans, before the buffer forgets them."""
        # source -> newest time with a transform, if its first scan has none
        newest: Dict[str, Optional[genpy.Time]] = {}
        for entry in self._waiting:
            if entry.found is not None:
                continue
            common = newest.get(entry.source)
            if entry.source in newest and (common is None or 0 < common.to_nsec() < entry.stamp.to_nsec()):
                continue        # avoids a lookup for all waiting scans with every transform
            try:
                found = self._buffer.lookup_transform_core(self._odom, entry.source, entry.stamp)
                entry.found = transform_parts(found)
            except tf2_ros.TransformException:
                if entry.source not in newest:
                    newest[entry.source] = self._newest_common(self._odom, entry.source)

    def _ready(self) -> Optional[Tuple[LaserScan, Transform, int]]:
        """Return the oldest scan whose transform is known; those before it can no longer be used."""
        for index, entry in enumerate(self._waiting):
            if entry.found is not None:
                self._give_up([self._waiting.popleft() for _ in range(index)], entry.source, entry.stamp)
                self._waiting.popleft()
                self._taken_stamp = entry.stamp
                return entry.scan, entry.found, self.generation
        return None

    def _give_up(self, entries: List[_Waiting], source: str, stamp: genpy.Time) -> None:
        """Count scans without a transform that are older than a scan of ``source`` at ``stamp`` with one."""
        early = 0
        if self._taken_stamp is None:
            early = sum(entry.source == source for entry in entries)
        if early:
            self.account.leave_out(EARLY, early)
            rospy.loginfo("skipped %d of the first scans, from %.3f on: older than the first transform %s -> %s; the "
                          "first one used is of %.3f", early, entries[0].stamp.to_sec(), self._odom, source,
                          stamp.to_sec())
        if len(entries) > early:
            last = entries[-1]
            self._lose(NO_TRANSFORM, len(entries) - early, "scan at %.3f dropped: a later one has a transform, it "
                       "lacks %s" % (last.stamp.to_sec(), self.missing(self._odom, last.source, last.stamp)))

    def _newest_common(self, target: str, source: str) -> Optional[genpy.Time]:
        """Return the newest time at which the transform is known, 0 for a static one, None if unknown."""
        try:
            return self._buffer.get_latest_common_time(target, source)
        except tf2_ros.TransformException:
            return None

    def _complain(self) -> None:
        if not self._waiting:
            self._blocked_since, self.lacks = None, ""
            return
        if self._blocked_since is None:
            self._blocked_since = time.monotonic()
        if time.monotonic() - self._blocked_since > WAIT_WARNING:
            first = self._waiting[0]
            self.lacks = "transform %s -> %s" % (self._odom, first.source)
            rospy.logwarn_throttle(WAIT_WARNING, "%d scans wait for %s" % (
                len(self._waiting), self.missing(self._odom, first.source, first.stamp)))

    def missing(self, target: str, source: str, stamp: genpy.Time) -> str:
        """Return a message about a missing transform.

        Parameters
        ----------
        target, source : str
            Frames.
        stamp : genpy.Time
            Requested time.
        """
        source = source.lstrip("/")
        try:
            self._buffer.lookup_transform_core(target, source, stamp)
            why = "it has arrived meanwhile"
        except tf2_ros.TransformException as error:
            why = str(error).rstrip(" .")
        known = ", ".join(sorted(self._frames)) or "none, no message on /tf"
        newest = self._newest_common(target, source)
        return "the transform %s -> %s at %.3f: %s. Frames known: %s%s" % (
            target, source, stamp.to_sec(), why, known, usual_source(
                target, source, self._frames, None if newest is None else newest.to_sec(), stamp.to_sec(),
                self._wording.odom_parameter if target == self._odom else self._wording.base_parameter))

    def mount(self, base: str, scan: LaserScan) -> Optional[Transform]:
        """Return translation and quaternion of a scan's laser in the base frame, or None.

        Parameters
        ----------
        base : str
            Frame of the base.
        scan : LaserScan
        """
        source = scan.header.frame_id.lstrip("/")
        for stamp in (scan.header.stamp, rospy.Time(0)):
            try:
                return transform_parts(self._buffer.lookup_transform_core(base, source, stamp))
            except tf2_ros.TransformException:
                continue
        return None

    @property
    def waiting(self) -> int:
        """Number of waiting scans."""
        return len(self._waiting)

    def close(self) -> None:
        """Let ``next`` return None; the scans that wait are not used."""
        with self._news:
            self._closed = True
            self.account.leave_out(AT_END, len(self._waiting))
            self._waiting.clear()
            self._news.notify_all()

    def in_odometry(self, frame: str, stamp: genpy.Time) -> Optional[Transform]:
        """Return translation and quaternion of a frame in that of the odometry, or None if they are not known.

        Parameters
        ----------
        frame : str
        stamp : genpy.Time
            0: the newest known.
        """
        try:
            return transform_parts(self._buffer.lookup_transform_core(self._odom, frame.lstrip("/"), stamp))
        except tf2_ros.TransformException:
            return None
