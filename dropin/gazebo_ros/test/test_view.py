# SPDX-License-Identifier: BSD-3-Clause
"""The rviz configuration that gzclient makes, and how it waits for topics."""
import pytest
import yaml

from gazebo_ros import client
from gazebo_ros.view import fixed_frame, make_view

SCAN, ODOM = 'sensor_msgs/LaserScan', 'nav_msgs/Odometry'


def displays(text):
    return yaml.safe_load(text)['Visualization Manager']['Displays']


def test_every_scan_and_robot_is_shown():
    shown = displays(make_view([('/b/scan', SCAN), ('/a/scan', SCAN), ('/clock', 'rosgraph_msgs/Clock')],
                               ['/a/robot_description', '/b/robot_description']))
    assert [entry['Topic'] for entry in shown if entry['Class'] == 'rviz/LaserScan'] == ['/a/scan', '/b/scan']
    robots = [entry for entry in shown if entry['Class'] == 'rviz/RobotModel']
    assert [(entry['Robot Description'], entry['TF Prefix']) for entry in robots] == [
        ('a/robot_description', 'a'), ('b/robot_description', 'b')]


def test_a_robot_is_expected_although_none_is_there_yet():
    robots = [entry for entry in displays(make_view([], [])) if entry['Class'] == 'rviz/RobotModel']
    assert [entry['Robot Description'] for entry in robots] == ['robot_description']


def test_markers_and_maps():
    shown = displays(make_view([('/world', 'visualization_msgs/MarkerArray'), ('/map', 'nav_msgs/OccupancyGrid')], []))
    assert {'rviz/MarkerArray', 'rviz/Map'} <= {entry['Class'] for entry in shown}
    assert [entry['Marker Topic'] for entry in shown if entry['Class'] == 'rviz/MarkerArray'] == ['/world']


@pytest.mark.parametrize('topics, frame', [
    ([], 'odom'), (['/odom'], 'odom'), (['/odom', '/a/odom'], 'odom'), (['/b/odom', '/a/odom'], 'a/odom')])
def test_the_frame_is_that_of_the_first_robot(topics, frame):
    assert fixed_frame(topics) == frame
    view = yaml.safe_load(make_view([(topic, ODOM) for topic in topics], []))
    assert view['Visualization Manager']['Global Options']['Fixed Frame'] == frame


def test_the_frame_can_be_chosen():
    view = yaml.safe_load(make_view([('/a/odom', ODOM)], [], 'map'))
    assert view['Visualization Manager']['Global Options']['Fixed Frame'] == 'map'


class Master:
    """Returns one more topic in each call."""

    def __init__(self, *topics):
        self.topics, self.asked = topics, 0

    def getPublishedTopics(self, _):
        self.asked += 1
        return [list(topic) for topic in self.topics[:self.asked]]


def wait(master, patience):
    now = [0.0]
    return client.wait_for_robot(master, patience, lambda: now[0], lambda seconds: now.append(now.pop() + seconds)), now


def test_waits_for_the_first_robot_and_then_for_its_other_topics():
    topics = [('/clock', 'rosgraph_msgs/Clock'), ('/odom', ODOM), ('/scan', SCAN)]
    found, _ = wait(Master(*topics), 60.0)
    assert [tuple(pair) for pair in found] == topics


def test_the_wait_is_limited():
    found, now = wait(Master(('/clock', 'rosgraph_msgs/Clock')), 5.0)
    assert [pair[0] for pair in found] == ['/clock'] and 5.0 <= now[0] < 6.0


def test_without_a_display_it_prints_a_message_and_exits(monkeypatch, capsys):
    monkeypatch.delenv('DISPLAY', raising=False)
    monkeypatch.delenv('WAYLAND_DISPLAY', raising=False)
    monkeypatch.setattr(client.signal, 'pthread_sigmask', lambda *_: None)
    assert client.main(['__name:=gazebo_gui']) == 0
    assert 'there is no display' in capsys.readouterr().err


def test_options():
    assert client.take_options(['__name:=g', '--stay', '--frame=map', '']) == (['__name:=g'], True, 'map')
