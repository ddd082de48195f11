# SPDX-License-Identifier: BSD-3-Clause
"""Messages and bags with known contents, and looking at single pixels of pictures."""
import math

import pytest
import rosbag
import rospy
from geometry_msgs.msg import Point, PointStamped, PoseStamped, TransformStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from gazebo_msgs.msg import ModelStates
from m2wr_view.scene import Scene

URDF = """<robot name="cart"><link name="base"><collision><origin xyz="0.1 0 0"/><geometry><box size="1 0.4 0.2"/>
</geometry></collision></link><joint name="j" type="fixed"><origin xyz="0.5 0 0.3" rpy="0 0 1.5707963267948966"/>
<parent link="base"/><child link="laser"/></joint><link name="laser"><visual><geometry><cylinder radius="0.1"
length="0.1"/></geometry></visual></link></robot>"""


class Messages:
    """Makes messages."""

    @staticmethod
    def marker(kind, size, x, y, z=0.0, yaw=0.0, name="thing", number=0, action=Marker.ADD):
        marker = Marker(type=kind, action=action, ns=name, id=number)
        marker.scale.x, marker.scale.y, marker.scale.z = size
        marker.pose.position = Point(x, y, z)
        marker.pose.orientation.z, marker.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return marker

    @staticmethod
    def world(*markers):
        return MarkerArray([Marker(action=Marker.DELETEALL)] + list(markers))

    @staticmethod
    def odometry(now, x, y, yaw=0.0):
        message = Odometry(child_frame_id="base")
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(now), "odom"
        message.pose.pose.position = Point(x, y, 0.0)
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        message.twist.twist.linear.x = 0.5
        return message

    @staticmethod
    def scan(now, ranges, low=-0.5, high=0.5, frame="laser"):
        message = LaserScan(angle_min=low, angle_max=high, angle_increment=(high - low) / (len(ranges) - 1),
                            range_min=0.1, range_max=10.0, ranges=list(ranges))
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(now), frame
        return message

    @staticmethod
    def transform(now, parent, child, x, y, yaw=0.0):
        entry = TransformStamped(child_frame_id=child)
        entry.header.stamp, entry.header.frame_id = rospy.Time.from_sec(now), parent
        entry.transform.translation.x, entry.transform.translation.y = x, y
        entry.transform.rotation.z, entry.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return TFMessage([entry])

    @staticmethod
    def grid(rows, resolution, x, y, frame="odom"):
        message = OccupancyGrid(data=[cell for row in rows for cell in row])
        message.header.frame_id = frame
        message.info.height, message.info.width, message.info.resolution = len(rows), len(rows[0]), resolution
        message.info.origin.position.x, message.info.origin.position.y = x, y
        message.info.origin.orientation.w = 1.0
        return message

    @staticmethod
    def line(*ends):
        message = Path()
        for x, y in ends:
            message.poses.append(PoseStamped())
            message.poses[-1].pose.position = Point(x, y, 0.0)
        return message

    @staticmethod
    def point(x, y):
        return PointStamped(point=Point(x, y, 0.0))

    @staticmethod
    def clock(now):
        return Clock(rospy.Time.from_sec(now))

    def robots(self, **poses):
        return ModelStates(name=list(poses), pose=[self.odometry(0.0, *pose).pose.pose for pose in poses.values()],
                           twist=[Twist()] * len(poses))

    @staticmethod
    def text(words):
        return String(data=words)


@pytest.fixture
def make():
    return Messages()


@pytest.fixture
def scene():
    return Scene()


@pytest.fixture
def corner_bag(tmp_path, make):
    """Return a function that records a run from (0, 0) by (4, 0) to (4, 3) past a crate, without some topics."""

    def record(name="run.bag", without=(), truth_off=(0.0, 0.0)):
        path = str(tmp_path / name)
        with rosbag.Bag(path, "w", "lz4") as bag:

            def write(topic, message, now):
                if topic not in without:
                    bag.write(topic, message, rospy.Time.from_sec(now))

            crate = make.marker(Marker.CUBE, (1.0, 1.0, 0.5), 2.0, 1.5, 0.25, name="crate")
            write("/gazebo/world_markers", make.world(crate), 1.0)
            write("/robot_description", make.text(URDF), 1.0)
            write("/bug2/m_line", make.line((0.0, 0.0), (4.0, 3.0)), 1.0)
            write("/bug2/state", make.text("go_to_point"), 1.0)
            for number in range(141):
                now, way = 1.0 + 0.05 * number, 0.05 * number
                place = (way, 0.0, 0.0) if way <= 4.0 else (4.0, way - 4.0, math.pi / 2)
                write("/clock", make.clock(now), now)
                write("/odom", make.odometry(now, *place), now)
                write("/cmd_vel", Twist(), now)
                write("/m2wr/laser/scan", make.scan(now, [1.0] * 21), now)
                write("/gazebo/robot_states", states(place[0] + truth_off[0], place[1] + truth_off[1], place[2]), now)
                if number == 80:
                    write("/bug2/state", make.text("wall_following"), now)
                    write("/bug2/hit_point", make.point(4.0, 0.0), now)
            write("/bug2/state", make.text("goal_reached"), 8.0)
        return path

    def states(x, y, yaw):
        return make.robots(m2wr=(x, y, yaw))

    return record
