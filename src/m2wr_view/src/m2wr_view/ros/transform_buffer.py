"""Transforms from strangers: tf2 ends the process where it meets a stamp that it cannot calculate with."""
import rospy
import tf2_ros

LATEST = 2**31          # s: beyond, sums and differences of stamps leave the range of ROS's times


def is_out_of_range(stamp):
    """Whether a stamp (genpy.Time) is none that tf2 can calculate with."""
    return not 0 <= stamp.secs < LATEST


class TransformBuffer(tf2_ros.Buffer):
    """A buffer that refuses such transforms, for a ``tf2_ros.TransformListener``."""

    def set_transform(self, transform, authority):
        """Take a transform in."""
        if not self._refused(transform, authority):
            super().set_transform(transform, authority)

    def set_transform_static(self, transform, authority):
        """Take a transform in that holds at all times."""
        if not self._refused(transform, authority):
            super().set_transform_static(transform, authority)

    @staticmethod
    def _refused(transform, authority):
        stamp = transform.header.stamp
        if not is_out_of_range(stamp):
            return False
        rospy.logwarn_throttle(10.0, "transform %s -> %s of %s refused: its stamp is %d s; expected 0 to %d" % (
            transform.header.frame_id, transform.child_frame_id, authority, stamp.secs, LATEST))
        return True
