"""Between messages and the plain values that the rest of the package works with."""
import rospy


def stamp_of(now_ns):
    """Return a simulated time [ns] as a rospy.Time, to the nanosecond."""
    return rospy.Time(now_ns // 1000000000, now_ns % 1000000000)


def read_pose(pose):
    """Return ``(position, orientation)`` of a geometry_msgs/Pose."""
    return ((pose.position.x, pose.position.y, pose.position.z),
            (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w))


def write_pose(pose, position, orientation):
    """Fill a geometry_msgs/Pose."""
    pose.position.x, pose.position.y, pose.position.z = position
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation


def read_vector(vector):
    """Return a geometry_msgs/Vector3 as a tuple."""
    return (vector.x, vector.y, vector.z)
