# SPDX-License-Identifier: BSD-3-Clause
"""The replay command on bags written here: whole, or without what it needs."""
import signal

import numpy as np
import pytest
import rosbag
import rospy
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_gmapping import graph_view
from m2wr_gmapping.replay import replay_command as command
from replay_bag import SETTINGS, run, table, transform, write_bag

pytestmark = pytest.mark.usefixtures("no_master")


@pytest.mark.parametrize("late, static, compression", [(0, True, "none"), (12, False, "bz2"), (40, True, "lz4")])
def test_scans_with_late_transforms_are_used(tmp_path, ring, laser, late, static, compression):
    truth = write_bag(tmp_path / "drive.bag", ring, laser, late, static, compression=compression)
    code, stats = run(tmp_path, "--trajectory", str(tmp_path / "path"), "--online", str(tmp_path / "online"),
                      "--tracked", str(tmp_path / "tracked"),
                      "--map", str(tmp_path / "plan"))
    assert code == 0 and stats["scans"] == len(truth) and stats["without_transform"] == 0
    path = table(tmp_path / "path")
    assert path.shape == (stats["processed"], 8) and len(table(tmp_path / "online")) == stats["used"] > len(path)
    assert len(table(tmp_path / "tracked")) == stats["processed"] + stats["tracked"] > len(path)
    assert (np.diff(path[:, 0]) > 0).all() and np.allclose(np.hypot(path[:, 6], path[:, 7]), 1.0)
    length = np.hypot(*(path[-1, 1:3] - path[0, 1:3]))
    assert length == pytest.approx(np.hypot(*(truth[-1] - truth[0])[:2]), abs=0.2)      # of the base, not of the laser
    assert (tmp_path / "plan.pgm").stat().st_size > 10000 and (tmp_path / "plan.yaml").exists()


def test_transform_far_ahead_drops_no_scan(tmp_path, ring, laser):
    truth = write_bag(tmp_path / "drive.bag", ring, laser, late=12)
    with rosbag.Bag(str(tmp_path / "drive.bag"), "a") as bag:
        messages = list(bag.read_messages())
    with rosbag.Bag(str(tmp_path / "drive.bag"), "w") as bag:
        for index, (topic, message, stamp) in enumerate(messages):
            if index == len(messages) // 2:
                bag.write("/tf", TFMessage([transform("odom", "base", rospy.Time(10**6), (0.0, 0.0, 0.0))]), stamp)
            bag.write(topic, message, stamp)
    code, stats = run(tmp_path)
    assert code == 0 and stats["scans"] == len(truth) and stats["without_transform"] == 0


def rewrite(path, change):
    """Write a bag again with other messages: ``change`` makes (topic, message, stamp) of those that are there."""
    with rosbag.Bag(str(path)) as bag:
        messages = [tuple(entry) for entry in bag.read_messages()]
    with rosbag.Bag(str(path), "w") as bag:
        for topic, message, stamp in change(messages):
            bag.write(topic, message, stamp)


def test_scans_before_the_first_transform_are_counted_apart(tmp_path, ring, laser, caplog):
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    rewrite(tmp_path / "drive.bag", lambda all_of_them: [
        entry for entry in all_of_them if entry[0] != "/tf" or entry[2] >= rospy.Time.from_sec(100.25)])
    code, stats = run(tmp_path)
    assert code == 0 and (stats["before_first_transform"], stats["without_transform"]) == (3, 0)
    assert stats["scans"] == len(truth) and "3 of %d scans not used" % len(truth) in caplog.text


@pytest.mark.parametrize("late", [0, 3])
def test_time_jump_in_a_bag_starts_a_new_run(tmp_path, ring, laser, caplog, late):
    """As where a simulation was reset while it was recorded: the robot stands elsewhere at the same times."""
    write_bag(tmp_path / "drive.bag", ring, laser, late)
    run(tmp_path, "--trajectory", str(tmp_path / "once"))

    with rosbag.Bag(str(tmp_path / "drive.bag")) as bag:
        whole = [tuple(entry) for entry in bag.read_messages()]
    shifted = []
    for topic, message, stamp in whole:
        if topic == "/tf" and stamp < rospy.Time.from_sec(103):
            message = TFMessage([transform("odom", "base", entry.header.stamp, (3.0, 1.0, 0.0))
                                 for entry in message.transforms])
        if stamp < rospy.Time.from_sec(103):
            shifted.append((topic, message, stamp))
    rewrite(tmp_path / "drive.bag", lambda _: shifted + whole)
    code, stats = run(tmp_path, "--trajectory", str(tmp_path / "twice"))
    assert code == 0 and stats["time_jumps"] == 1 and caplog.text.count("time jumps back") == 1
    assert stats["processScan"]["count"] == stats["processed"]
    assert (tmp_path / "twice").read_bytes() == (tmp_path / "once").read_bytes()


def add_scans(path, odd):
    """Let further scans follow those of a bag: ``odd`` of a scan's number, from 1 on, and message; frame and stamp."""
    def more(messages):
        number = 0
        for topic, message, stamp in messages:
            yield topic, message, stamp
            number += topic == "/scan"
            header = odd(number, message) if topic == "/scan" else None
            if header is not None:
                scan = LaserScan(ranges=message.ranges)
                scan.header.frame_id, scan.header.stamp = header
                yield topic, scan, stamp
    rewrite(path, more)


def test_single_scans_of_other_time_or_laser_are_skipped(tmp_path, ring, laser, caplog):
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    run(tmp_path, "--trajectory", str(tmp_path / "once"))

    def odd(number, message):
        if number in (5, 9, len(truth)):
            return "laser", rospy.Time(3)
        return ("base", message.header.stamp) if number == 7 else None
    add_scans(tmp_path / "drive.bag", odd)
    code, stats = run(tmp_path, "--trajectory", str(tmp_path / "twice"))
    assert code == 0 and stats["refused"] == 4 and stats["time_jumps"] == 0
    assert "4 of %d scans not used (out of order: 3, refused: 1)" % (len(truth) + 4) in caplog.text
    assert stats["used"] == len(truth) and stats["unused"] == {"out of order": 3, "refused": 1}
    assert "its frame is base; expected laser" in caplog.text
    assert (tmp_path / "twice").read_bytes() == (tmp_path / "once").read_bytes()


@pytest.mark.parametrize("settings, unused", [
    (["_throttle_scans:=3"], {"throttle_scans": 38}), (["_settle_time:=1"], {"settle_time": 10}), ([], {})])
def test_every_scan_is_used_or_counted(tmp_path, ring, laser, caplog, settings, unused):
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    code, stats = run(tmp_path, *settings)
    assert code == 0 and stats["unused"] == unused and stats["used"] == len(truth) - sum(unused.values())
    assert stats["scans"] == len(truth) and "WARNING" not in caplog.text


def test_scans_that_no_transform_fits_are_warned_about(tmp_path, ring, laser, caplog):
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    rewrite(tmp_path / "drive.bag", lambda whole: [
        entry for entry in whole if entry[0] != "/tf" or entry[2] < rospy.Time.from_sec(103)])
    code, stats = run(tmp_path)
    missing = stats["unused"]["no transform"]
    assert code == 0 and missing > 20 and stats["used"] == len(truth) - missing
    assert caplog.text.count("a scan has no transform: odom -> laser at 103") == 1
    assert "%d of %d scans not used (no transform: %d)" % (missing, len(truth), missing) in caplog.text


def test_the_graph_has_a_node_for_each_processed_scan(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    code, stats = run(tmp_path, "--graph", str(tmp_path / "graph"), "--trajectory", str(tmp_path / "path"))
    found = graph_view.read(str(tmp_path / "graph"))
    assert code == 0 and len(found.nodes) == stats["processed"] and found.accepted.sum() == stats["links"]
    np.testing.assert_allclose(found.nodes[:, :2], table(tmp_path / "path")[:, 1:3], atol=1e-5)


def delayed(delays):
    """Function for ``rewrite``: scans are recorded later, {number from 1 on: delay in seconds}."""
    def late(messages):
        kept, place = [], 0
        for topic, message, stamp in messages:
            place += topic == "/scan"
            if topic == "/scan" and place in delays:
                kept.append((topic, message, stamp + rospy.Duration(delays[place])))
            else:
                yield topic, message, stamp
            while kept and kept[0][2] <= stamp:
                yield kept.pop(0)
    return late


def test_late_scans_in_a_row_are_no_time_jump(tmp_path, ring, laser, caplog):
    """As over a bad radio link: transforms arrive in time, three scans after scans 2 s newer."""
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    rewrite(tmp_path / "drive.bag", delayed(dict.fromkeys((30, 31, 32), 2.05)))
    code, stats = run(tmp_path, "--trajectory", str(tmp_path / "late"))
    assert len(truth) > 54
    assert code == 0 and (stats["time_jumps"], stats["unused"]) == (0, {"out of order": 3})
    assert "a scan after the one at 105.000 is not used" in caplog.text


def test_a_scan_that_arrives_after_newer_ones_is_left_out(tmp_path, ring, laser, caplog):
    """As in the live node: between the poses before and after it the robot may have been turned."""
    write_bag(tmp_path / "drive.bag", ring, laser)
    rewrite(tmp_path / "drive.bag", delayed({26: 0.25}))
    code, stats = run(tmp_path, "--online", str(tmp_path / "poses"))
    assert code == 0 and stats["unused"] == {"out of order": 1}
    assert "the scan at 102.500 is not used: it arrived after one at 102.700" in caplog.text
    assert (np.diff(table(tmp_path / "poses")[:, 0]) > 0.0).all()


def test_each_late_scan_is_counted_once(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    rewrite(tmp_path / "drive.bag", delayed({30: 2.15, 49: 0.26}))      # arrive one after the other
    code, stats = run(tmp_path)
    assert code == 0 and stats["unused"] == {"out of order": 2}


def test_scans_that_wait_for_transforms_are_sorted(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser, late=12)

    def swapped(messages):
        before = None
        for topic, message, stamp in messages:
            if topic == "/scan" and message.header.stamp == rospy.Time(102, 500000000):
                before = message
                continue
            yield topic, message, stamp
            if before is not None and topic == "/scan":
                yield topic, before, stamp
                before = None
    rewrite(tmp_path / "drive.bag", swapped)
    code, stats = run(tmp_path, "--online", str(tmp_path / "poses"))
    stamps = table(tmp_path / "poses")[:, 0]
    assert code == 0 and not stats["unused"] and 102.5 in stamps and (np.diff(stamps) > 0.0).all()


def test_scan_far_ahead_at_the_begin_is_skipped(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    add_scans(tmp_path / "drive.bag", lambda number, _: ("laser", rospy.Time(10**6)) if number == 1 else None)
    code, stats = run(tmp_path)
    assert code == 0 and stats["processed"] > 5 and stats["refused"] <= 2


def test_single_scan_far_ahead_is_skipped(tmp_path, ring, laser):
    truth = write_bag(tmp_path / "drive.bag", ring, laser)
    run(tmp_path, "--trajectory", str(tmp_path / "once"))

    add_scans(tmp_path / "drive.bag",
              lambda number, _: ("laser", rospy.Time(10**6)) if number == len(truth) // 2 else None)
    code, stats = run(tmp_path, "--trajectory", str(tmp_path / "twice"))
    assert code == 0 and (stats["time_jumps"], stats["refused"], stats["without_transform"]) == (0, 1, 0)
    assert (tmp_path / "twice").read_bytes() == (tmp_path / "once").read_bytes()


def test_statistics_count_the_run(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    _, stats = run(tmp_path)
    assert stats["particles"] == 5 and stats["beams"] == 181 and stats["processScan"]["count"] == stats["processed"]
    for clock in ("wall", "cpu"):
        times = stats["processScan"][clock]
        assert 0.0 < times["median_ms"] <= times["p95_ms"] and times["total_s"] > 0.0
    assert stats["peak_memory_mib"] > 10.0


def test_without_a_master_only_the_last_map_is_made(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    code, stats = run(tmp_path, "_map_update_interval:=0.0")
    assert code == 0 and stats["processed"] > 5 and stats["map_updates"]["count"] == 1


def test_same_seed_gives_the_same_files(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    made = {}
    for name, seed, compatible in (("a", 7, False), ("b", 7, False), ("c", 7, True), ("d", 7, True), ("e", 8, True)):
        run(tmp_path, "--seed", str(seed), "_compatible:=%s" % str(compatible).lower(), "--map", str(tmp_path / name),
            "--trajectory", str(tmp_path / name))
        made[name] = (tmp_path / (name + ".pgm")).read_bytes(), (tmp_path / name).read_bytes()
    assert made["a"] == made["b"] and made["c"] == made["d"]
    # the best of the particles is drawn away from its match only there, so a short drive tells seeds apart only there
    assert made["c"][1] != made["e"][1]


def test_settle_time_skips_the_first_scans(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    run(tmp_path, "--trajectory", str(tmp_path / "whole"))
    run(tmp_path, "_settle_time:=1.0", "--trajectory", str(tmp_path / "late"))
    assert table(tmp_path / "late")[0, 0] >= table(tmp_path / "whole")[0, 0] + 1.0
    assert run(tmp_path, "_settle_time:=soon")[0] == command.USAGE


def test_run_without_output_files_warns(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    assert command.main(["--bag_filename", str(tmp_path / "drive.bag")] + SETTINGS) == 0
    assert "no result is kept" in caplog.text


def test_error_if_all_scans_are_skipped(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    for parameter in ("_throttle_scans:=5000", "_settle_time:=1e4"):
        assert run(tmp_path, parameter)[0] == command.FAILED and "skip all" in caplog.text
        caplog.clear()


@pytest.mark.parametrize("words", [["--max_duration_buffer", "0"], ["--max_duration_buffer", "nan"],
                                   ["--max_duration_buffer", "1e12"], ["_particles:=[1,2"], ["--seed", "x"]])
def test_invalid_arguments_are_reported_at_start(tmp_path, words, capsys):
    with pytest.raises(SystemExit) as left:
        run(tmp_path, *words)
    assert left.value.code == command.USAGE and words[0].partition(":=")[0] in capsys.readouterr().err


def test_track_between_can_be_disabled(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    for parameter in ("_track_between:=false", "_compatible:=true"):
        _, stats = run(tmp_path, parameter, "--trajectory", str(tmp_path / "path"))
        assert len(table(tmp_path / "path")) == stats["processed"] and stats["tracked"] == 0


@pytest.mark.parametrize("options, more, words", [
    (dict(tf=False), [], "no transforms on /tf"), (dict(), ["--scan_topic", "/lidar"], "/scan (sensor_msgs/LaserScan)"),
    (dict(), ["_odom_frame:=odometry"], "Frames in the bag: base, laser, odom"),
    (dict(), ["_base_frame:=foot"], "base_frame foot")])
def test_missing_topics_are_named(tmp_path, ring, laser, options, more, words, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser, **options)
    code, stats = run(tmp_path, *more)
    assert code == command.FAILED and stats is None and words in caplog.text


def test_scans_of_another_length_are_refused(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser, beams=90)
    code, stats = run(tmp_path)
    assert code == 0 and stats["refused"] > 0 and caplog.text.count("expected 181") == 1


def test_unreachable_score_and_unknown_parameters_warn(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    run(tmp_path, "_minimumScore:=200", "_particels:=3")
    assert "can never be reached" in caplog.text and "particels" in caplog.text
    assert command.main(["--bag_filename", str(tmp_path / "drive.bag"), "_delta:=-1"]) == command.USAGE


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_saves_the_results_so_far(tmp_path, ring, laser, monkeypatch, number):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)            # the tests may run under nohup
    write_bag(tmp_path / "drive.bag", ring, laser)
    scan, seen = command.Replay._scan, []

    def interrupted(self, *arguments):
        scan(self, *arguments)
        seen.append(1)
        if len(seen) == 20:
            signal.raise_signal(number)

    monkeypatch.setattr(command.Replay, "_scan", interrupted)
    code, stats = run(tmp_path, "--map", str(tmp_path / "plan"))
    assert code == command.INTERRUPTED and stats["processed"] > 1 and len(seen) == 20
    assert (tmp_path / "plan.yaml").exists()


def test_on_done_command_returns_its_exit_code(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    code, _ = run(tmp_path, "--on_done", ": > {}; exit 7".format(tmp_path / "done"))
    assert code == 7 and (tmp_path / "done").exists()


def test_missing_output_folder_is_reported_at_start(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    nowhere = tmp_path / "nowhere"
    for option in ("--map", "--trajectory", "--stats", "--save-state"):
        code, _ = run(tmp_path, option, str(nowhere / "plan"))
        assert code == command.USAGE and "no folder {}: expected one to write into".format(nowhere) in caplog.text
        caplog.clear()


def test_one_unwritable_file_does_not_stop_the_others(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    (tmp_path / "taken").mkdir()                # no file takes the place of a folder
    code, _ = run(tmp_path, "--trajectory", str(tmp_path / "taken"), "--map", str(tmp_path / "plan"))
    assert code == command.FAILED and "cannot write {}: ".format(tmp_path / "taken") in caplog.text
    assert (tmp_path / "plan.pgm").exists() and not list(tmp_path.glob(".replay*"))


# ---- resuming

def half_bags(tmp_path, ring, laser):
    """drive.bag, and the same in two pieces: one.bag and two.bag."""
    write_bag(tmp_path / "drive.bag", ring, laser, static=False)
    with rosbag.Bag(str(tmp_path / "drive.bag")) as whole:
        middle = 0.5 * (whole.get_start_time() + whole.get_end_time())
        with rosbag.Bag(str(tmp_path / "one.bag"), "w") as one, rosbag.Bag(str(tmp_path / "two.bag"), "w") as two:
            for topic, message, stamp in whole.read_messages():
                (one if stamp.to_sec() < middle else two).write(topic, message, stamp)


def outputs(tmp_path, name, *more):
    """Run over NAME.bag; return the bytes of map and trajectory."""
    code = command.main(["--bag_filename", str(tmp_path / (name + ".bag")), "--map", str(tmp_path / name),
                         "--trajectory", str(tmp_path / (name + ".txt"))] + SETTINGS + list(more))
    assert code == 0
    return (tmp_path / (name + ".pgm")).read_bytes(), (tmp_path / (name + ".txt")).read_bytes()


@pytest.mark.parametrize("more", [[], ["_throttle_scans:=3"]])
def test_resumed_replay_gives_the_files_of_one_run(tmp_path, ring, laser, more):
    half_bags(tmp_path, ring, laser)
    state = str(tmp_path / "half.state")
    whole = outputs(tmp_path, "drive", *more)
    first = outputs(tmp_path, "one", "--save-state", state, *more)
    assert outputs(tmp_path, "two", "--load-state", state, *more) == whole
    assert first[1] != whole[1]


def test_unusable_state_is_reported(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    (tmp_path / "text.state").write_text("no state")
    for words, told in ((["--load-state", str(tmp_path / "text.state")], "expected a state"),
                        (["--load-state", str(tmp_path / "none.state")], "No such file"),
                        (["--load-map", str(tmp_path / "none.yaml")], "none.yaml"),
                        (["--load-map", "a.yaml", "--load-state", "a.state"], "expected one of them")):
        assert run(tmp_path, *words)[0] == command.USAGE and told in caplog.text
    with pytest.raises(SystemExit):
        run(tmp_path, "--pose", "1", "2", "3")
    (tmp_path / "a.state").mkdir()              # no file takes the place of a folder
    code, _ = run(tmp_path, "--save-state", str(tmp_path / "a.state"))
    assert code == command.FAILED and "cannot write the state" in caplog.text


def test_overridden_parameters_are_named(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    run(tmp_path, "--save-state", str(tmp_path / "a.state"))
    code, stats = run(tmp_path, "--load-state", str(tmp_path / "a.state"), "--new-odometry", "_particles:=9")
    assert code == 0 and stats["particles"] == 5 and "particles 5 (asked for 9)" in caplog.text
    assert caplog.text.count("the state overrides") == 1 and "odometry was reset" in caplog.text


def test_replay_starts_on_a_saved_map(tmp_path, ring, laser):
    write_bag(tmp_path / "drive.bag", ring, laser)
    every = "--tracked", str(tmp_path / "matched.txt")      # the matched motion decides which scans are processed
    outputs(tmp_path, "drive", *every)
    (tmp_path / "drive.pgm").rename(tmp_path / "old.pgm")
    (tmp_path / "old.yaml").write_text((tmp_path / "drive.yaml").read_text().replace("drive.pgm", "old.pgm"))
    before = table(tmp_path / "matched.txt")
    outputs(tmp_path, "drive", "--load-map", str(tmp_path / "old.yaml"), "--pose", "0.3", "-0.3", "0.2", *every)
    after = table(tmp_path / "matched.txt")
    _, one, other = np.intersect1d(before[:, 0], after[:, 0], return_indices=True)
    assert len(one) > 0.9 * max(len(before), len(after))
    assert np.hypot(*(after[other] - before[one])[:, 1:3].T).max() < 0.12


def test_bag_of_empty_scans_is_reported(tmp_path, ring, laser, caplog):
    write_bag(tmp_path / "drive.bag", ring, laser)
    with rosbag.Bag(str(tmp_path / "drive.bag")) as bag:
        messages = list(bag.read_messages())
    with rosbag.Bag(str(tmp_path / "drive.bag"), "w") as bag:
        for topic, message, stamp in messages:
            if topic == "/scan":
                message.ranges = []
            bag.write(topic, message, stamp)
    code, _ = run(tmp_path, "--save-state", str(tmp_path / "a.state"))
    assert code == command.FAILED and "no ranges" in caplog.text
    assert not (tmp_path / "a.state").exists()
