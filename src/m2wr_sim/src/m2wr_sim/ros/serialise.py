# SPDX-License-Identifier: BSD-3-Clause
"""Serialises messages: the same bytes as genpy, several times faster for messages that are published often.

A framed message is its length and then its fields, little-endian, as it is sent. Number fields may hold arrays instead
of lists.
"""
import struct
from io import BytesIO
from typing import TYPE_CHECKING, Any, Callable, Dict, Sequence, Union

import numpy as np
from rospy.msg import serialize_message

if TYPE_CHECKING:
    from numpy.typing import NDArray

_HEADER = struct.Struct("<4I")                  # length of the message, seq, stamp
_STAMP = struct.Struct("<3I")
_LENGTH = struct.Struct("<I")
_CLOCK = struct.Struct("<3I")
_SCAN = struct.Struct("<7f")
_POSE = struct.Struct("<7d")
_ODOMETRY = struct.Struct("<85d")
_SIZE = struct.Struct("<2I")
_IMAGE = struct.Struct("<B2I")
_FIELD = struct.Struct("<IBI")
_CLOUD = struct.Struct("<?3I")
_FLAG = struct.Struct("<?")
_CACHED_TEXTS = 1000
_texts: Dict[str, bytes] = {}


def _text(text: str) -> bytes:
    """Return a string field; fields are cached, as frames and names repeat."""
    packed = _texts.get(text)
    if packed is None:
        coded = text.encode("utf-8")
        packed = _LENGTH.pack(len(coded)) + coded
        if len(_texts) >= _CACHED_TEXTS:
            _texts.clear()
        _texts[text] = packed
    return packed


def _numbers(values: "Union[NDArray[Any], Sequence[float]]", kind: str, code: str) -> bytes:
    """Return an array field: its length and its numbers, of numpy's ``kind`` and struct's ``code``."""
    if isinstance(values, np.ndarray):
        if values.dtype != kind or values.ndim != 1:
            raise TypeError("an array of another kind")         # the caller uses genpy then
        return _LENGTH.pack(values.size) + values.tobytes()
    return struct.pack("<I%d%s" % (len(values), code), len(values), *values)


def _framed(header: Any, body: bytes) -> bytes:
    """Return a message that begins with a header."""
    stamp = header.stamp
    return _HEADER.pack(12 + len(body), header.seq, stamp.secs, stamp.nsecs) + body


def _clock(message: Any) -> bytes:
    return _CLOCK.pack(8, message.clock.secs, message.clock.nsecs)


def _scan(scan: Any) -> bytes:
    return _framed(scan.header, b"".join((
        _text(scan.header.frame_id),
        _SCAN.pack(scan.angle_min, scan.angle_max, scan.angle_increment, scan.time_increment, scan.scan_time,
                   scan.range_min, scan.range_max),
        _numbers(scan.ranges, "<f4", "f"), _numbers(scan.intensities, "<f4", "f"))))


def _odometry(odometry: Any) -> bytes:
    where, rotation = odometry.pose.pose.position, odometry.pose.pose.orientation
    linear, angular = odometry.twist.twist.linear, odometry.twist.twist.angular
    return _framed(odometry.header, b"".join((
        _text(odometry.header.frame_id), _text(odometry.child_frame_id),
        _ODOMETRY.pack(where.x, where.y, where.z, rotation.x, rotation.y, rotation.z, rotation.w,
                       *odometry.pose.covariance, linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
                       *odometry.twist.covariance))))


def _joint_state(state: Any) -> bytes:
    return _framed(state.header, b"".join(
        [_text(state.header.frame_id), _LENGTH.pack(len(state.name))] + [_text(name) for name in state.name]
        + [_numbers(values, "<f8", "d") for values in (state.position, state.velocity, state.effort)]))


def _transforms(message: Any) -> bytes:
    parts = [b"", _LENGTH.pack(len(message.transforms))]
    for transform in message.transforms:
        header, where, rotation = transform.header, transform.transform.translation, transform.transform.rotation
        parts += (_STAMP.pack(header.seq, header.stamp.secs, header.stamp.nsecs), _text(header.frame_id),
                  _text(transform.child_frame_id),
                  _POSE.pack(where.x, where.y, where.z, rotation.x, rotation.y, rotation.z, rotation.w))
    parts[0] = _LENGTH.pack(sum(map(len, parts)))
    return b"".join(parts)


def _framed_parts(header: Any, parts: "Sequence[Any]") -> bytes:
    """Return a message that begins with a header; large parts are copied once."""
    stamp = header.stamp
    return b"".join([_HEADER.pack(12 + sum(map(len, parts)), header.seq, stamp.secs, stamp.nsecs), *parts])


def _image(image: Any) -> bytes:
    return _framed_parts(image.header, (
        _text(image.header.frame_id), _SIZE.pack(image.height, image.width), _text(image.encoding),
        _IMAGE.pack(image.is_bigendian, image.step, len(image.data)), memoryview(image.data)))


def _cloud(cloud: Any) -> bytes:
    fields = [_text(field.name) + _FIELD.pack(field.offset, field.datatype, field.count) for field in cloud.fields]
    return _framed_parts(cloud.header, [
        _text(cloud.header.frame_id), _SIZE.pack(cloud.height, cloud.width), _LENGTH.pack(len(fields)), *fields,
        _CLOUD.pack(cloud.is_bigendian, cloud.point_step, cloud.row_step, len(cloud.data)), memoryview(cloud.data),
        _FLAG.pack(cloud.is_dense)])


def _old_cloud(cloud: Any) -> bytes:
    """Return a :class:`~m2wr_sim.plugins.cloud_laser.CloudOfPoints`, framed."""
    points, intensities = cloud.points, cloud.intensities
    return _framed(cloud.header, b"".join((
        _text(cloud.header.frame_id), _LENGTH.pack(len(points)), points.astype("<f4").tobytes(), _LENGTH.pack(1),
        _text("intensity"), _numbers(intensities, "<f4", "f"))))


def _states(table: Any) -> bytes:
    """Return model or link states of a :class:`~m2wr_sim.plugins.world_states.StateTable`, framed."""
    count = _LENGTH.pack(len(table.names))
    parts = [b"", count] + [_text(name) for name in table.names]
    parts += (count, table.poses.tobytes(), count, table.twists.tobytes())
    parts[0] = _LENGTH.pack(sum(map(len, parts)))
    return b"".join(parts)


_FAST = {"rosgraph_msgs/Clock": _clock, "sensor_msgs/LaserScan": _scan, "nav_msgs/Odometry": _odometry,
         "sensor_msgs/JointState": _joint_state, "sensor_msgs/Image": _image, "sensor_msgs/PointCloud2": _cloud,
         "sensor_msgs/PointCloud": _old_cloud,
         "tf2_msgs/TFMessage": _transforms,
         "gazebo_msgs/ModelStates": _states, "gazebo_msgs/LinkStates": _states}


def serialise_by_genpy(seq: int, message: Any) -> bytes:
    """Return any message serialised as rospy does, with its length.

    Parameters
    ----------
    seq : int
        For the header, if the message has one.
    message : genpy.Message

    Raises
    ------
    genpy.SerializationError, rospy.ROSSerializationException
        If a field has a value of a wrong type.
    """
    stream = BytesIO()
    serialize_message(stream, seq, message)
    return stream.getvalue()


def serialiser_of(message_class: Any) -> Callable[[int, Any], bytes]:
    """Return a function ``(seq, message) -> bytes`` for messages of a class; ``seq`` goes into its header, if any."""
    fast = _FAST.get(message_class._type)
    if fast is None:
        return serialise_by_genpy
    has_header = getattr(message_class, "_has_header", False)

    def serialise(seq: int, message: Any) -> bytes:
        if has_header:
            message.header.seq = seq
        try:
            return fast(message)
        except (struct.error, AttributeError, TypeError):       # genpy accepts the value or names the error
            return serialise_by_genpy(seq, message_of(message, message_class))

    return serialise


def message_of(record: Any, message_class: Any) -> Any:
    """Return a message: the record itself, or the message made from a record of arrays.

    Parameters
    ----------
    record : genpy.Message or object with a method ``message(message_class)``
    message_class : type
    """
    return record if isinstance(record, message_class) else record.message(message_class)
