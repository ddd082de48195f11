# SPDX-License-Identifier: BSD-3-Clause
"""Replay of a bag: what a moment depends on, playing, and jumps of the slider."""
import argparse
import urllib.request

import pytest
import rosbag
import rospy
from geometry_msgs.msg import PointStamped, TransformStamped
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from m2wr_live.ros.replay import Player, Recording
from m2wr_view.errors import ViewError

URDF = "<robot name='cart'><link name='base'><visual><geometry><box size='1 1 1'/></geometry></visual></link></robot>"
BEGIN, SECONDS, RATE = 100.0, 10, 20


def at_x(x):
    stamped = TransformStamped(child_frame_id="base")
    stamped.header.frame_id = "odom"
    stamped.transform.translation.x, stamped.transform.rotation.w = x, 1.0
    return TFMessage([stamped])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A robot that drives at 0.5 m/s for ten seconds; it hits something after six."""
    found = str(tmp_path_factory.mktemp("bag") / "run.bag")
    box = Marker(ns="crate", type=Marker.CUBE)
    box.header.frame_id, box.pose.position.y, box.pose.orientation.w = "odom", 3.0, 1.0
    box.scale.x = box.scale.y = box.scale.z = 1.0
    with rosbag.Bag(found, "w") as bag:
        def write(topic, message, seconds):
            bag.write(topic, message, rospy.Time.from_sec(BEGIN + seconds))
        write("/robot_description", String(URDF), 0.0)
        write("/gazebo/world_markers", MarkerArray([box]), 0.0)
        for tick in range(SECONDS * RATE + 1):
            write("/tf", at_x(0.5 * tick / RATE), tick / RATE)
            scan = LaserScan(range_max=5.0, ranges=[1.0, 2.0])
            scan.header.frame_id = "base"
            write("/scan", scan, tick / RATE)
        write("/bug2/hit_point", PointStamped(), 6.0)
        write("/unknown", String("x"), 1.0)
    return found


@pytest.fixture
def player(path):
    made = Player(Recording(path), argparse.Namespace(host="127.0.0.1", port=0, token=""))
    yield made
    made._pages.server.stop()


def place(player):
    return player._scene.robots["cart"].pose[0, 3]


def test_only_shown_topics_are_read(path):
    recording = Recording(path)
    assert set(recording.kinds) == {"/robot_description", "/gazebo/world_markers", "/tf", "/scan", "/bug2/hit_point"}
    assert recording.end == pytest.approx(10.0)


def test_a_moment_depends_on_few_messages(path):
    recording = Recording(path)
    chosen = recording.up_to(9.0)
    assert max(stamp for stamp, _, _ in chosen) <= 9.0
    assert [topic for _, topic, _ in chosen].count("/gazebo/world_markers") == 1
    assert min(stamp for stamp, topic, _ in chosen if topic == "/scan") > 6.9
    assert 60 < [topic for _, topic, _ in chosen].count("/tf") < 130       # the trail at 10 Hz, the newest at 20 Hz


def test_playing_moves_the_robot_with_the_time(player):
    for _ in range(40):
        player.advance(0.1)
    assert place(player) == pytest.approx(0.5 * 4.0, abs=0.06)
    assert len(player._scene.markers.shapes) == 1 and not player._scene.hits
    assert player._slider.value == pytest.approx(4.0, abs=0.06)
    assert len(player._scene.robots["cart"].trail) > 20
    for _ in range(80):
        player.advance(0.1)
    assert place(player) == pytest.approx(5.0) and player._playing.value is False


def test_the_slider_jumps_forward_and_back(player):
    player._playing.value = False
    player._slider.value = 8.0
    player.advance(0.1)
    assert place(player) == pytest.approx(4.0, abs=0.03) and player._scene.hits == [(0.0, 0.0)]
    player._slider.value = 2.0
    player.advance(0.1)
    assert place(player) == pytest.approx(1.0, abs=0.03) and not player._scene.hits
    assert player._scene.robots["cart"].trail[-1][0] < 1.1
    assert player._scene.beams["/scan"][0, 1, 0] == pytest.approx(2.0, abs=0.06)


def test_plots_begin_again_after_a_jump(player):
    def measured(wall):
        player._pages.measure(wall, [], None, [], {})
        return player._pages._series.columns()
    for tick in range(20):
        player.advance(0.1)
        times = measured(0.1 * tick)[0]
    assert times[0] < 0.5 and len(times) >= 3
    player._slider.value = 8.0
    player.advance(0.1)
    columns = measured(3.0)
    assert columns[0].tolist() == pytest.approx([8.0], abs=0.2) and columns[3].tolist() == [0.0]


def test_the_page_is_served(player):
    port = player._pages.viser.get_port()
    with urllib.request.urlopen("http://localhost:%d/" % port, timeout=10) as answer:
        assert b"live.js" in answer.read()


def test_a_bag_without_anything_to_show_is_refused(tmp_path):
    name = str(tmp_path / "other.bag")
    with rosbag.Bag(name, "w") as bag:
        bag.write("/unknown", String("x"))
    with pytest.raises(ViewError, match="none of its topics is shown"):
        Recording(name)
    with pytest.raises(ViewError, match="No such file|expected"):
        Recording(str(tmp_path / "missing.bag"))


def test_pages_get_the_bag_and_a_film_of_it(player, path):
    with open(path, "rb") as stream:
        assert player.bag() == stream.read()
    film = player.film()
    assert film[:4] == b"GIF8" and player.film() is film


def test_a_bag_that_is_too_large_for_a_page_is_said(player, path, monkeypatch):
    monkeypatch.setattr("m2wr_live.ros.replay.LARGEST", 1 << 10)
    with pytest.raises(ViewError, match=r"pages get at most 0 MB"):
        player.bag()
