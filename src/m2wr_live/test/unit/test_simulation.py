# SPDX-License-Identifier: BSD-3-Clause
"""On which topics pages may drive, and who else drives on them."""
import types

import pytest

from m2wr_live.ros import simulation

TWIST = "geometry_msgs/Twist"
OWN = "/live"


@pytest.fixture
def found(monkeypatch):
    """Return a function that gives a driver which has looked at the state of a master."""
    def look(published, subscribed, kinds):
        master = types.SimpleNamespace(getTopicTypes=lambda: kinds,
                                       getSystemState=lambda: (published, subscribed, []))
        monkeypatch.setattr(simulation.rosgraph, "Master", lambda _: master)
        monkeypatch.setattr(simulation.rospy, "Publisher", lambda *_, **__: None)
        driver = simulation.Driver(0.5, 1.0)
        driver.find(OWN)
        return driver
    return look


def test_pages_drive_where_another_node_listens(found):
    driver = found([], [["/cmd_vel", ["/gazebo"]], ["/own", [OWN]], ["/scan", ["/gazebo"]]],
                   [["/cmd_vel", TWIST], ["/own", TWIST], ["/scan", "sensor_msgs/LaserScan"]])
    assert driver.topics == ["/cmd_vel"]


@pytest.mark.parametrize("publishers, other", [([OWN], {}), ([OWN, "/bug2"], {"/cmd_vel": "/bug2"}), ([], {})])
def test_another_publisher_is_named_but_not_the_own_node(found, publishers, other):
    driver = found([["/cmd_vel", publishers], ["/elsewhere", ["/bug2"]]], [["/cmd_vel", ["/gazebo"]]],
                   [["/cmd_vel", TWIST], ["/elsewhere", TWIST]])
    assert driver.others == other
