# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of bags and of streams of messages: how many, of what, and what is said when something is missing."""
import logging
import os
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from m2wr_view.dumping import make_dump
from m2wr_view.errors import ViewError
from m2wr_view.renderer import ROBOT_COLOUR
from m2wr_view.ros import image_dump
from m2wr_view.ros.image_dump import main
from m2wr_view.run_picture import OBSTACLE_COLOUR, STATE_COLOURS
from m2wr_view.shapes import rgb


def count(path, colour):
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")) / 255.0
    return int(np.count_nonzero(np.abs(pixels - rgb(colour)).max(axis=2) < 0.03))


@pytest.fixture(autouse=True)
def quiet_handlers():
    """Take the screen's handler away again."""
    log = logging.getLogger("rosout.m2wr_view")
    before = list(log.handlers), log.propagate
    yield
    log.handlers, log.propagate = before


def said(capsys):
    return capsys.readouterr().err


def test_a_bag_becomes_pictures(corner_bag, tmp_path, capsys):
    out = str(tmp_path / "out")
    assert main(["--bag", corner_bag(), "--out", out, "--out", str(tmp_path / "run.gif")]) == 0
    names = sorted(os.listdir(out))
    assert 15 <= len(names) <= 19           # 7 s at 2 Hz, three states, the end
    last = os.path.join(out, names[-1])
    assert count(last, OBSTACLE_COLOUR) > 500 and count(last, ROBOT_COLOUR) > 500
    assert count(last, STATE_COLOURS["go_to_point"]) > 200 and count(last, STATE_COLOURS["wall_following"]) > 200
    assert count(os.path.join(out, names[2]), STATE_COLOURS["wall_following"]) == 0
    with Image.open(str(tmp_path / "run.gif")) as image:
        assert image.n_frames == len(names)
    assert "run.gif (%d pictures)" % len(names) in said(capsys)


def test_size_rate_and_view_are_chosen(corner_bag, tmp_path):
    out = str(tmp_path / "out")
    assert main(["--bag", corner_bag(), "--out", out, "--rate", "1", "--size", "300", "240", "--view", "-1", "-1", "5",
                 "4"]) == 0
    assert 9 <= len(os.listdir(out)) <= 12
    with Image.open(os.path.join(out, "frame_00000.png")) as image:
        assert image.size == (300, 240)


def test_a_bag_without_a_world_is_drawn_and_told(corner_bag, tmp_path, capsys):
    bag = corner_bag(without=("/gazebo/world_markers", "/robot_description"))
    assert main(["--bag", bag, "--out", str(tmp_path / "out")]) == 0
    text = said(capsys)
    assert "no topic /gazebo/world_markers; the pictures lack the world" in text
    assert "no topic /robot_description" in text


def test_topics_are_remapped(corner_bag, tmp_path, capsys):
    bag = corner_bag(without=("/odom", "/gazebo/world_markers", "/gazebo/robot_states", "/clock"))
    assert main(["--bag", bag, "--out", str(tmp_path / "out"), "map:=/odom"]) == 1
    assert "none of the topics /odom" in said(capsys)


def test_bags_that_cannot_be_drawn_are_named(corner_bag, tmp_path, capsys):
    assert main(["--bag", str(tmp_path / "no.bag")]) == 1
    assert "no.bag: No such file" in said(capsys)
    (tmp_path / "text.bag").write_text("no bag at all, but long enough to look at")
    assert main(["--bag", str(tmp_path / "text.bag")]) == 1
    assert "text.bag: it cannot be read" in said(capsys)
    shutil.move(corner_bag(), str(tmp_path / "late.bag.active"))
    assert main(["--bag", str(tmp_path / "late.bag")]) == 1
    assert "rosbag reindex" in said(capsys)


def test_a_read_only_folder_does_not_stop_other_writers(corner_bag, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["--bag", corner_bag(), "--out", str(tmp_path / "file"), "--out", str(tmp_path / "good")]) == 0
    assert "file" in said(capsys) and len(os.listdir(str(tmp_path / "good"))) > 10
    assert main(["--bag", corner_bag(), "--out", str(tmp_path / "file")]) == 1


@pytest.mark.parametrize("words, told", [(["--rate", "0"], "rate 0.0: expected more than 0"),
                                         (["--size", "10", "10"], "size .10, 10.: expected"),
                                         (["--view", "1", "0", "0", "1"], "view .*expected least x")])
def test_numbers_that_make_no_sense_are_refused(corner_bag, capsys, words, told):
    assert main(["--bag", corner_bag()] + words) == 1
    assert re.search(told, said(capsys))


class Broken:
    path, count = "broken", 0

    def write(self, image):
        raise ViewError("picture broken: No space left on device")


class Kept:
    path, count = "kept", 0

    def write(self, image):
        self.count += 1

    def close(self):
        pass


def test_a_failed_writer_is_left_out_and_the_others_continue(make, caplog):
    kept, shown = Kept(), []
    dump = make_dump(10.0, (200, 200), None, [Broken(), kept], lambda image, now: shown.append(now))
    for number in range(21):
        dump.take("odom", make.odometry(0.1 * number, 0.0, 0.0))
    assert dump.close() == "kept (22 pictures)" and len(shown) == 22
    assert [record.getMessage() for record in caplog.records if "No space left" in record.getMessage()] == [
        "picture broken: No space left on device. No more pictures are written there; earlier ones are kept."]


def test_messages_that_make_no_sense_are_told_once(make, caplog):
    dump = make_dump(10.0, (200, 200), None, [])
    broken = make.grid([[0, 100]], 0.5, 1.0, 2.0)
    broken.info.width = 3
    for number in range(5):
        dump.take("odom", make.odometry(0.1 * number, 0.0, 0.0))
        dump.take("map", broken)
        dump.take("robot_description", make.text("<robot>"))
    texts = [record.getMessage() for record in caplog.records]
    assert len([text for text in texts if text.startswith("map: ")]) == 1
    assert len([text for text in texts if text.startswith("robot_description: ")]) == 1 and dump.count >= 4


def test_a_change_of_state_is_drawn_at_once(make):
    shown = []
    dump = make_dump(0.1, (200, 200), None, [], lambda image, now: shown.append(now))
    dump.take("odom", make.odometry(1.0, 0.0, 0.0))
    dump.take("odom", make.odometry(1.5, 0.0, 0.0))
    dump.take("bug2/state", make.text("wall_following"))
    assert shown == [1.0, 1.5]


def test_drawing_time_is_measured_by_the_given_clock(make):
    ticks = iter(range(1000))
    dump = make_dump(10.0, (200, 200), None, [Kept()], clock=lambda: 1e-3 * next(ticks))
    for number in range(4):
        dump.take("odom", make.odometry(0.1 * number, 0.0, 0.0))
    assert dump.timing() == [
        "drawing: 4 times, median 1.0 ms, 95 of 100 within 1.0 ms, longest 1.0 ms",
        "kept: 4 times, median 1.0 ms, 95 of 100 within 1.0 ms, longest 1.0 ms",
        "a picture: 4 times, median 5.0 ms, 95 of 100 within 5.0 ms, longest 5.0 ms"]


def test_without_a_clock_nothing_is_measured(make):
    dump = make_dump(10.0, (200, 200), None, [])
    dump.take("odom", make.odometry(0.0, 0.0, 0.0))
    assert dump.count == 1 and dump.timing() == []


def test_what_is_left_alone_fills_no_disk(make, caplog):
    shown, kept = [], Kept()
    dump = make_dump(10.0, (200, 200), None, [kept], lambda image, now: shown.append(now), limit=3)
    for number in range(21):
        dump.take("odom", make.odometry(0.1 * number, 0.0, 0.0))
    assert len(shown) >= 10 and kept.count == 3 and not dump.failed
    assert dump.close().startswith(kept.path) and kept.count == 3
    assert caplog.text.count("the limit (max_pictures") == 1


def test_the_last_picture_is_published_too(monkeypatch):
    published, rospy = [], image_dump.rospy
    publisher = SimpleNamespace(get_num_connections=lambda: 1, publish=published.append)
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: publisher)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(rospy, "get_param", lambda name, default: default)
    monkeypatch.setattr(rospy, "signal_shutdown", lambda reason: None)
    monkeypatch.setattr(image_dump, "note_signals", lambda: [2])
    monkeypatch.setattr(image_dump, "register", lambda *_, **__: None)
    node = image_dump.Node(image_dump._parser().parse_args([]))
    start = node._start

    def start_with_a_robot():
        started = start()
        node._dump.scene.place(1.0, (0.0, 0.0, 0.0))
        return started

    monkeypatch.setattr(node, "_start", start_with_a_robot)
    assert node.run() == 0 and len(published) == 1 and published[0].header.frame_id == "odom"
