"""Scans with the pose of their laser, from the messages of a bag."""
import logging
from collections import deque

import rospy
import tf2_ros
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_gmapping.replay.far_ahead import FarAhead
from m2wr_gmapping.scan import transform_parts

log = logging.getLogger(__name__)
TF, TF_STATIC = "/tf", "/tf_static"
GAP = 3600.0            # between two transforms of one frame there is no longer one, or the later one is wrong [s]
PATIENCE = 30.0         # a transform may come that much later, in time of the bag, than the scan it is for [s]


class ScanSource:
    """Hands out scans in the order of the bag as soon as their transform is known; keeps all that wait.

    Parameters
    ----------
    bag : BagFile
    scan_topic : str
    odom_frame, base_frame : str
    buffer_length : float
        Time that transforms are kept [s].

    Attributes
    ----------
    scans, without_transform, unreadable : int
        Scans read; those of them that never got a transform; messages that could not be decoded.
    """

    def __init__(self, bag, scan_topic, odom_frame, base_frame, buffer_length):
        self._bag = bag
        self._topic = "/" + scan_topic.lstrip("/")
        self._odom, self._base = odom_frame.lstrip("/"), base_frame.lstrip("/")
        self._buffer = tf2_ros.BufferCore(rospy.Duration.from_sec(buffer_length))
        self._far_ahead = FarAhead(GAP)
        self._waiting = deque()
        self._newest = 0.0
        self.scans = self.without_transform = self.unreadable = 0
        self.why = None                 # why a scan has no transform
        self.frames = set()

    def __iter__(self):
        """Yield (LaserScan, odom_from_laser) with the transform as translation and quaternion."""
        for message in self._bag.messages(lambda topic: topic in (self._topic, TF, TF_STATIC)):
            try:
                if message.topic == self._topic:
                    if message.type != LaserScan._type:
                        raise ValueError("topic {} is {}; expected {}".format(
                            self._topic, message.type, LaserScan._type))
                    scan = LaserScan()
                    scan.deserialize(message.data)
                    self.scans += 1
                    self._waiting.append(scan)
                else:
                    self._take(message)
            except Exception as error:      # genpy raises what struct and it like; a bad message is not the end
                if not self.unreadable:
                    log.warning("a message on %s cannot be read: %s", message.topic, error)
                self.unreadable += 1
                continue
            while self._waiting:
                pair = self._ready(self._waiting[0], PATIENCE)
                if pair is None:
                    break
                self._waiting.popleft()
                if pair:
                    yield pair
        while self._waiting:
            pair = self._ready(self._waiting.popleft(), None)
            if pair:
                yield pair

    def _take(self, message):
        transforms = TFMessage()
        transforms.deserialize(message.data)
        for transform in transforms.transforms:
            transform.header.frame_id = transform.header.frame_id.lstrip("/")
            transform.child_frame_id = transform.child_frame_id.lstrip("/")
            self.frames.update((transform.header.frame_id, transform.child_frame_id))
            try:
                if message.topic == TF_STATIC:
                    self._buffer.set_transform_static(transform, "bag")
                elif not self._far_ahead.has(transform.child_frame_id, transform.header.stamp):
                    self._buffer.set_transform(transform, "bag")
                    self._newest = max(self._newest, transform.header.stamp.to_sec())
            except tf2_ros.TransformException as error:
                log.debug("transform %s -> %s: %s", transform.header.frame_id, transform.child_frame_id, error)

    def _ready(self, scan, patience):
        """Return (scan, transform), None to wait for more, or () to give the scan up."""
        frame = scan.header.frame_id.lstrip("/")
        try:
            found = self._buffer.lookup_transform_core(self._odom, frame, scan.header.stamp)
            return scan, transform_parts(found)
        except tf2_ros.TransformException as error:
            if patience is not None and self._newest < scan.header.stamp.to_sec() + patience:
                return None
            self.without_transform += 1
            self.why = "{} -> {} at {:.3f}: {}".format(self._odom, frame, scan.header.stamp.to_sec(), error)
            return ()

    def base_from_laser(self, scan):
        """Return translation and quaternion of the scan's frame in the base frame, or None."""
        frame = scan.header.frame_id.lstrip("/")
        for stamp in (scan.header.stamp, rospy.Time(0)):
            try:
                return transform_parts(self._buffer.lookup_transform_core(self._base, frame, stamp))
            except tf2_ros.TransformException as error:
                self.why = "{} -> {} at {:.3f}: {}".format(self._base, frame, scan.header.stamp.to_sec(), error)
        return None
