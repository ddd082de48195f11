# SPDX-License-Identifier: BSD-3-Clause
"""Scans on their way in: each waits until the transform of its laser is known, none holds up the one who brings it."""
import threading
import time
from collections import deque

import rospy
import tf2_ros

from m2wr_gmapping.frontend.scan import transform_parts
from m2wr_gmapping.replay.future_transforms import JUMP, FarAhead
from m2wr_gmapping.ros.missing_inputs import usual_source
from m2wr_node.ros.transform_buffer import fault_of, fault_of_transform

BUFFER = 60.0               # time that transforms are kept [s]
OLD_MESSAGES = 5.0             # scans of about the old time may still come that long after a jump [s]
WAIT_WARNING = 5.0          # wall time after which a scan that waits is worth a word [s]


class Intake:
    """Queue of scans and buffer of transforms; callbacks put in, one worker takes out.

    Parameters
    ----------
    odom_frame : str
    limit : int
        Scans that may wait; the oldest is dropped first.
    map_frame : str, optional
        Transforms from there to the odometry's frame are what comes of the scans, here or, in a bag, elsewhere: not
        needed.
    publishes : callable, optional
        Whether this node publishes that transform (bool): who else gives the odometry's frame a parent is then named.

    Attributes
    ----------
    generation : int
        Goes up whenever time has jumped back; what was taken out before belongs to another run.
    arrived, dropped : int
        Scans that came; scans that went because too many waited or because no transform can come any more.
    without_transform : int
        Those of the dropped that had no transform while earlier and later ones had.
    early : int
        Scans, apart from the dropped, that are older than the first transform there was of their laser: where a node
        begins to listen, or time has jumped back, the two do not begin at the same moment.
    lacks : str
        The transform that has been waited for too long, empty when none is.
    """

    def __init__(self, odom_frame, limit, map_frame=None, publishes=lambda: False):
        self._odom, self._limit, self._map, self._publishes = odom_frame, limit, map_frame, publishes
        self._buffer = tf2_ros.BufferCore(rospy.Duration.from_sec(BUFFER))
        self._far_ahead = FarAhead(BUFFER)
        self._news = threading.Condition()
        self._waiting = deque()
        self._frames, self._rivals = set(), set()
        self._present = self._time_before = rospy.Time(0)       # what the clock, or else the newest scan, says
        self._ignore_old_until = 0.0
        self._taken_stamp = None            # of the newest scan handed out
        self._odd_stamp = None              # of a scan that looked like a jump back in time, if it was the last one
        self._blocked_since = None
        self._closed = False
        self.generation = 0
        self.arrived = self.dropped = self.without_transform = self.early = 0
        self.lacks = ""

    # ---- called by ROS

    def on_transforms(self, message, static=False):
        """Take a TFMessage in."""
        self._look_at_clock()
        with self._news:                # a jump in time must not come in between
            for transform in message.transforms:
                transform.header.frame_id = transform.header.frame_id.lstrip("/")
                transform.child_frame_id = transform.child_frame_id.lstrip("/")
                if transform.child_frame_id == self._odom:
                    self._look_at_parent(transform.header.frame_id, message)
                if transform.header.frame_id != self._map or transform.child_frame_id != self._odom:
                    self._put_transform(transform, static)
            if self._waiting:
                self._news.notify()

    def _look_at_parent(self, parent, message):
        """Name whoever else says where the odometry's frame is: listeners would jump between the two."""
        sender = (getattr(message, "_connection_header", None) or {}).get("callerid")
        if sender in (None, rospy.get_name()) or sender in self._rivals or not self._publishes():
            return
        self._rivals.add(sender)
        rospy.logwarn("%s publishes %s -> %s beside this node's %s -> %s: rviz and others jump between the two. "
                      "Expected one of them: end the other, play bags without that transform, or set "
                      "~transform_publish_period to 0", sender, parent, self._odom, self._map, self._odom)

    def _put_transform(self, transform, static):
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
                rospy.logwarn_throttle(10.0, "transform %s -> %s at %.3f left out: far ahead of the one before" % (
                    parent, child, stamp.to_sec()))
            else:
                self._buffer.set_transform(transform, "tf")
        except tf2_ros.TransformException as error:
            rospy.logwarn_throttle(10.0, "transform %s -> %s refused: %s" % (parent, child, error))

    def on_scan(self, scan):
        """Take a LaserScan in."""
        self._look_at_clock()
        stamp = scan.header.stamp
        with self._news:
            self.arrived += 1
            fault = fault_of(scan.header)
            if fault:
                self.dropped += 1
                rospy.logwarn_throttle(5.0, "scan dropped: %s" % fault)
                return
            if self._is_before_jump(stamp):
                self.dropped += 1
                return
            last = self._taken_stamp
            if last is None and self._waiting:
                last = self._waiting[-1].header.stamp
            if last is not None and (last - stamp).to_sec() > JUMP:
                if self._odd_stamp is None or stamp <= self._odd_stamp:
                    self._odd_stamp = stamp
                    self.dropped += 1
                    rospy.logwarn_throttle(5.0, "scan at %.3f dropped: the last one was at %.3f, and time has jumped "
                                           "back only if the next one says so too" % (stamp.to_sec(), last.to_sec()))
                    return
                self._jumped("the scans' stamps have", last, stamp, self._taken_stamp is not None)
            self._odd_stamp = None
            if rospy.rostime.is_wallclock():
                self._present = stamp
            self._put(scan)
            self._news.notify()

    def _put(self, scan):
        """Let a scan wait in its place by time; those that wait for times far ahead must not hold up the others."""
        waiting, stamp = self._waiting, scan.header.stamp
        place = len(waiting)
        while place and stamp < waiting[place - 1].header.stamp:
            place -= 1
        before = waiting[place - 1].header.stamp if place else self._taken_stamp
        if before is not None and stamp <= before:
            self.dropped += 1
            rospy.logwarn_throttle(5.0, "scan at %.3f dropped: it comes after one at %.3f" % (
                stamp.to_sec(), before.to_sec()))
            return
        waiting.insert(place, scan)
        if len(waiting) > self._limit:
            waiting.popleft()
            self.dropped += 1
            rospy.logwarn_throttle(5.0, "%d scans wait, which is the most: the oldest are dropped (%d of %d so far)" % (
                self._limit, self.dropped, self.arrived))

    def _is_before_jump(self, stamp):
        """Whether what has this stamp was under way when time jumped back: a future that ends what is to come."""
        return (time.monotonic() < self._ignore_old_until and (stamp - self._present).to_sec() > JUMP
                and abs((stamp - self._time_before).to_sec()) < OLD_MESSAGES)

    def _look_at_clock(self):
        if rospy.rostime.is_wallclock():
            return
        with self._news:
            now = rospy.Time.now()          # under the lock, or two threads could bring their times in the wrong order
            if not now:
                return
            if (self._present - now).to_sec() > JUMP:       # less comes of a bag's own /clock beside that of its player
                self._jumped("the clock has", self._present, now)
            self._present = max(self._present, now)

    def _jumped(self, what, before, now, anew=True):
        self.generation += bool(anew)
        self.dropped += len(self._waiting)
        self._waiting.clear()
        self._buffer.clear()
        self._far_ahead.forget()
        self._taken_stamp = self._odd_stamp = self._blocked_since = None
        self._time_before, self._present, self._ignore_old_until = before, now, time.monotonic() + OLD_MESSAGES
        rospy.logwarn("%s jumped back from %.3f to %.3f: transforms and waiting scans are forgotten%s", what,
                      before.to_sec(), now.to_sec(), " and the map begins anew" if anew else "")

    # ---- called by the worker

    def next(self):
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

    def _ready(self):
        newest = {}             # source -> newest time with a transform, where its first scan here has none
        for index, scan in enumerate(self._waiting):
            source, stamp = scan.header.frame_id.lstrip("/"), scan.header.stamp
            if source in newest and (newest[source] is None or 0 < newest[source].to_nsec() < stamp.to_nsec()):
                continue        # without this look all that wait would be tried with every transform that comes
            try:
                found = self._buffer.lookup_transform_core(self._odom, source, stamp)
            except tf2_ros.TransformException:
                if source not in newest:
                    newest[source] = self._newest_common(self._odom, source)
                continue
            self._give_up([self._waiting.popleft() for _ in range(index)], source, stamp)
            self._waiting.popleft()
            self._taken_stamp = stamp
            return scan, transform_parts(found), self.generation
        return None

    def _give_up(self, scans, source, stamp):
        """Count scans that never had a transform, where a later one, of ``source`` at ``stamp``, has it."""
        early = 0
        if self._taken_stamp is None:
            early = sum(scan.header.frame_id.lstrip("/") == source for scan in scans)
        if early:
            self.early += early
            rospy.loginfo("left out %d of the first scans, from %.3f on: older than the first transform %s -> %s; the "
                          "first one used is of %.3f", early, scans[0].header.stamp.to_sec(), self._odom, source,
                          stamp.to_sec())
        self.dropped += len(scans) - early
        self.without_transform += len(scans) - early

    def _newest_common(self, target, source):
        """Newest time at which the transform is known, 0 where it is the same at all times, None where at none."""
        try:
            return self._buffer.get_latest_common_time(target, source)
        except tf2_ros.TransformException:
            return None

    def _complain(self):
        if not self._waiting:
            self._blocked_since, self.lacks = None, ""
            return
        if self._blocked_since is None:
            self._blocked_since = time.monotonic()
        if time.monotonic() - self._blocked_since > WAIT_WARNING:
            scan = self._waiting[0]
            self.lacks = "transform %s -> %s" % (self._odom, scan.header.frame_id.lstrip("/"))
            rospy.logwarn_throttle(WAIT_WARNING, "%d scans wait for %s" % (
                len(self._waiting), self.missing(self._odom, scan.header.frame_id, scan.header.stamp)))

    def missing(self, target, source, stamp):
        """Return a sentence on the transform that is missing."""
        source = source.lstrip("/")
        try:
            self._buffer.lookup_transform_core(target, source, stamp)
            why = "it has come meanwhile"
        except tf2_ros.TransformException as error:
            why = str(error).rstrip(" .")
        known = ", ".join(sorted(self._frames)) or "none, nothing came on /tf"
        newest = self._newest_common(target, source)
        return "the transform %s -> %s at %.3f: %s. Frames known: %s%s" % (
            target, source, stamp.to_sec(), why, known, usual_source(
                target, source, self._frames, None if newest is None else newest.to_sec(), stamp.to_sec(),
                "odom_frame" if target == self._odom else "base_frame"))

    def mount(self, base, scan):
        """Return translation and quaternion of a scan's laser in the base frame, or None."""
        source = scan.header.frame_id.lstrip("/")
        for stamp in (scan.header.stamp, rospy.Time(0)):
            try:
                return transform_parts(self._buffer.lookup_transform_core(base, source, stamp))
            except tf2_ros.TransformException:
                continue
        return None

    @property
    def waiting(self):
        """Number of scans that wait."""
        return len(self._waiting)

    def close(self):
        """Let ``next`` return None."""
        with self._news:
            self._closed = True
            self._news.notify_all()
