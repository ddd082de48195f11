# SPDX-License-Identifier: BSD-3-Clause
"""Scans with the pose of their laser, from the messages of a bag."""
from __future__ import annotations

import logging
from collections import deque
from typing import TYPE_CHECKING, Deque, Dict, Iterator, List, Optional, Set, Tuple, Union

import rospy
import tf2_ros
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_maps.ros.future_transforms import JUMP, FarAhead, LatestStamps
from m2wr_maps.scan_account import (
    BAD_HEADER,
    EARLY,
    NO_TRANSFORM,
    OUT_OF_ORDER,
    TIME_JUMP,
    UNREADABLE,
    ScanAccount,
)
from m2wr_maps.transforms import transform_parts
from m2wr_node.ros.transform_buffer import fault_of, fault_of_transform

if TYPE_CHECKING:
    import genpy
    from geometry_msgs.msg import TransformStamped

    from m2wr_gmapping.replay.bag_messages import BagFile, Message
    from m2wr_maps.transforms import Transform

log = logging.getLogger(__name__)
TF, TF_STATIC = "/tf", "/tf_static"
GAP = 3600.0            # greatest valid time between two transforms of one frame [s]
MOST_ODD = 20           # scans that look like a jump back in time and are kept until transforms confirm it
PATIENCE = 30.0         # greatest delay of a transform behind its scan, in bag time [s]


class ScanSource:
    """Yields scans in the order of their stamps as soon as their transform is known; the others wait.

    A scan that arrives after a newer one was yielded is left out, as in the live node.

    Parameters
    ----------
    bag : BagFile
    scan_topic : str
    odom_frame, base_frame : str
    buffer_length : float
        Length of the transform buffer [s].
    map_frame : str, optional
        Recorded transforms from this frame to that of odometry are ignored.

    Attributes
    ----------
    account : ScanAccount
        Of all scans of the bag.
    unreadable : int
        Number of messages that could not be decoded, scans among them.
    generation : int
        Number of jumps back in time, as by a reset of a simulation; each one starts a new run.
    """

    def __init__(self, bag: BagFile, scan_topic: str, odom_frame: str, base_frame: str, buffer_length: float,
                 map_frame: Optional[str] = None) -> None:
        self._bag = bag
        self._topic = "/" + scan_topic.lstrip("/")
        self._odom, self._base = odom_frame.lstrip("/"), base_frame.lstrip("/")
        self._map = map_frame and map_frame.lstrip("/")
        self._buffer = tf2_ros.BufferCore(rospy.Duration.from_sec(buffer_length))
        self._far_ahead = FarAhead(GAP)
        self._waiting: Deque[LaserScan] = deque()
        self._newest = 0.0
        self._newest_of: Dict[str, int] = {}        # child frame -> its newest stamp [ns]
        self._stamps = LatestStamps()
        self._old: List[TransformStamped] = []      # transforms since the last scan that are older than earlier ones
        self._last: Optional[genpy.Time] = None             # stamp of the newest scan
        self._odd: List[LaserScan] = []         # the last scans, if they looked like a jump back
        self._before_last: Optional[genpy.Time] = None      # stamp of the scan before the newest
        self._begun = False             # whether a scan of this run was yielded
        self._taken: Optional[genpy.Time] = None            # stamp of the newest scan that no longer waits
        self.account = ScanAccount()
        self.unreadable = self.generation = 0
        self.why: Optional[str] = None          # why a scan has no transform
        self.frames: Set[str] = set()

    def __iter__(self) -> Iterator[Tuple[LaserScan, Transform]]:
        """Yield (LaserScan, odom_from_laser) with the transform as translation and quaternion."""
        for message in self._bag.messages(lambda topic: topic in (self._topic, TF, TF_STATIC)):
            try:
                if message.topic == self._topic:
                    if message.type != LaserScan._type:
                        raise ValueError("topic {} is {}; expected {}".format(
                            self._topic, message.type, LaserScan._type))
                    self.account.received += 1
                    self._put(self._decoded(message))
                else:
                    self._take(message)
            except Exception as error:      # genpy raises various exceptions; a bad message is skipped
                if not self.unreadable:
                    log.warning("a message on %s cannot be read: %s", message.topic, error)
                self.unreadable += 1
                continue
            while self._waiting:
                pair = self._ready(self._waiting[0], PATIENCE)
                if pair is None:
                    break
                self._taken = self._waiting.popleft().header.stamp
                if pair:
                    yield pair
        self._lose_odd(len(self._odd))
        while self._waiting:
            pair = self._ready(self._waiting.popleft(), None)
            if pair:
                yield pair

    def _decoded(self, message: Message) -> LaserScan:
        scan = LaserScan()
        try:
            scan.deserialize(message.data)
        except Exception:
            self.account.leave_out(UNREADABLE)          # the caller warns
            raise
        return scan

    def _lose(self, reason: str, count: int, message: str) -> None:
        """Count scans that are not used; warn at the first one of each reason, the end of the run tells the sums."""
        if count and self.account.leave_out(reason, count) == count:
            log.warning("%s", message)

    def _lose_odd(self, count: int) -> None:
        if count and self._last is not None:
            self._lose(OUT_OF_ORDER, count, "a scan after the one at {:.3f} is not used: its stamp is more than {:g} s "
                       "away".format(self._last.to_sec(), JUMP))

    def _put(self, scan: LaserScan) -> None:
        """Queue a scan; the second one in a row that is much older starts a new run, if transforms are older too."""
        stamp = scan.header.stamp
        fault = fault_of(scan.header)
        if fault:
            self._lose(BAD_HEADER, 1, "scan {} of the bag: {}".format(self.account.received, fault))
            return
        if self._is_far_ahead_of(stamp):
            self._waiting.pop()
            self._lose_odd(1)
            self._last = self._before_last
        if self._last is not None and (self._last - stamp).to_sec() > JUMP:
            older = not self._begun or self._stamps.allow_jump()
            if not self._odd or stamp < self._odd[-1].header.stamp or not older:
                self._keep_odd(scan)
                return
            self._jump(self._last, self._odd[0].header.stamp)
            self._waiting.extend(self._odd)
            self._odd = []
        else:
            self._lose_odd(len(self._odd))
            self._odd = []
            if self._taken is not None and stamp < self._taken:
                self._lose(OUT_OF_ORDER, 1, "the scan at {:.3f} is not used: it arrived after one at {:.3f}".format(
                    stamp.to_sec(), self._taken.to_sec()))
                return
        self._before_last, self._last = self._last, stamp
        self._old.clear()
        place = len(self._waiting)
        while place and stamp < self._waiting[place - 1].header.stamp:
            place -= 1
        self._waiting.insert(place, scan)

    def _keep_odd(self, scan: LaserScan) -> None:
        """Keep a scan that is much older than the one before until it is clear whether time has jumped back."""
        if self._odd and scan.header.stamp < self._odd[-1].header.stamp:
            self._lose_odd(len(self._odd))
            self._odd = []
        elif len(self._odd) == MOST_ODD:
            self._lose_odd(1)
            self._odd.pop(0)
        self._odd.append(scan)

    def _is_far_ahead_of(self, stamp: genpy.Time) -> bool:
        """Whether only the newest scan, which still waits, is far ahead of this one."""
        return (self._last is not None and self._before_last is not None and self._before_last <= stamp
                and (self._last - stamp).to_sec() > JUMP and bool(self._waiting)
                and self._waiting[-1].header.stamp == self._last)

    def _jump(self, before: genpy.Time, stamp: genpy.Time) -> None:
        log.warning("time jumps back from %.3f to %.3f in the bag: starting a new map", before.to_sec(),
                    stamp.to_sec())
        self.generation += 1
        self._begun, self._newest, self._taken = False, 0.0, None
        self.account.leave_out(TIME_JUMP, len(self._waiting))
        self._waiting.clear()
        self._newest_of.clear()
        self._buffer.clear()
        self._far_ahead.forget()
        self._stamps.forget()
        for transform in self._old:
            self._put_transform(transform)

    def _take(self, message: Message) -> None:
        transforms = TFMessage()
        transforms.deserialize(message.data)
        for transform in transforms.transforms:
            transform.header.frame_id = transform.header.frame_id.lstrip("/")
            transform.child_frame_id = transform.child_frame_id.lstrip("/")
            self.frames.update((transform.header.frame_id, transform.child_frame_id))
            fault = fault_of_transform(transform)
            if fault:
                log.debug("transform %s -> %s left out: %s", transform.header.frame_id, transform.child_frame_id, fault)
                continue
            if transform.header.frame_id == self._map and transform.child_frame_id == self._odom:
                continue
            if message.topic == TF_STATIC:
                self._put_transform(transform, static=True)
                continue
            child, stamp = transform.child_frame_id, transform.header.stamp.to_nsec()
            if stamp + 1e9 * JUMP < self._newest_of.get(child, 0):
                self._old.append(transform)
            self._stamps.put(child, transform.header.stamp)
            self._newest_of[child] = max(stamp, self._newest_of.get(child, 0))
            self._put_transform(transform)

    def _put_transform(self, transform: TransformStamped, static: bool = False) -> None:
        try:
            if static:
                self._buffer.set_transform_static(transform, "bag")
            elif not self._far_ahead.has(transform.child_frame_id, transform.header.stamp):
                self._buffer.set_transform(transform, "bag")
                self._newest = max(self._newest, transform.header.stamp.to_sec())
        except tf2_ros.TransformException as error:
            log.debug("transform %s -> %s: %s", transform.header.frame_id, transform.child_frame_id, error)

    def _ready(self, scan: LaserScan, patience: Optional[float]) -> Union[Tuple[LaserScan, Transform], Tuple[()], None]:
        """Return (scan, transform), None to wait for more, or () to drop the scan."""
        frame = scan.header.frame_id.lstrip("/")
        try:
            found = self._buffer.lookup_transform_core(self._odom, frame, scan.header.stamp)
            self._begun = True
            return scan, transform_parts(found)
        except tf2_ros.TransformException as error:
            if patience is not None and self._newest < scan.header.stamp.to_sec() + patience:
                return None
            if not self._begun and self._begins_after(frame, scan.header.stamp):
                self.account.leave_out(EARLY)
                return ()
            self.why = "{} -> {} at {:.3f}: {}".format(
                self._odom, frame, scan.header.stamp.to_sec(), str(error).rstrip(" ."))
            self._lose(NO_TRANSFORM, 1, "a scan has no transform: " + self.why)
            return ()

    def _begins_after(self, frame: str, stamp: genpy.Time) -> bool:
        """Whether the transform of a frame is known only for later times."""
        try:
            return bool(self._buffer.get_latest_common_time(self._odom, frame) > stamp)
        except tf2_ros.TransformException:
            return False

    def base_from_laser(self, scan: LaserScan) -> Optional[Transform]:
        """Return translation and quaternion of the scan's frame in the base frame, or None."""
        frame = scan.header.frame_id.lstrip("/")
        for stamp in (scan.header.stamp, rospy.Time(0)):
            try:
                return transform_parts(self._buffer.lookup_transform_core(self._base, frame, stamp))
            except tf2_ros.TransformException as error:
                self.why = "{} -> {} at {:.3f}: {}".format(
                    self._base, frame, scan.header.stamp.to_sec(), str(error).rstrip(" ."))
        return None
