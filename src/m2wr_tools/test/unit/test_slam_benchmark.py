# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark: logs found and turned into bags, errors in closed form, the table and its place in a README."""
import gzip
import json
import math

import numpy as np
import pytest
import rosbag

from m2wr_maps.se2 import between, compose, inverse
from m2wr_tools.slam_benchmark import benchmark_command as command
from m2wr_tools.slam_benchmark import benchmark_table as table
from m2wr_tools.slam_benchmark import difficulty_table, log_details
from m2wr_tools.slam_benchmark import laser_logs as logs
from m2wr_tools.slam_benchmark import trajectory_errors as scoring
from m2wr_tools.slam_logs import make_command

ROOM = 4.0


def drive(count=60):
    """Poses (K, 3) back and forth in a room, with loop closures."""
    along = np.abs((0.05 * np.arange(count) + 2.0) % 4.0 - 2.0)
    return np.column_stack([along, np.zeros(count), 0.3 * np.sin(0.2 * np.arange(count))])


def ranges(pose, beams=181):
    """What a laser sees in a square room."""
    angles = pose[2] + np.linspace(-math.pi / 2, math.pi / 2, beams)
    with np.errstate(divide="ignore"):
        walls = [np.where(side * part > 1e-9, (ROOM - side * at) / (side * part), np.inf)
                 for part, at in ((np.cos(angles), pose[0]), (np.sin(angles), pose[1])) for side in (1.0, -1.0)]
    return np.minimum.reduce(walls)


def carmen(path, poses, packed=False, step=1.0):
    """Write a CARMEN log of poses as odometry; every third record has no scan."""
    lines = []
    for k, (x, y, theta) in enumerate(poses):
        end = "{:.6f} {:.6f} {:.6f}".format(x, y, theta)
        if k % 3 == 2:
            lines.append("ODOM {0} 0 0 0 {1} host {1}".format(end, step * k))
        else:
            seen = " ".join("%.3f" % value for value in ranges((x, y, theta)))
            lines.append("FLASER 181 {0} {1} {1} {2} host {2}".format(seen, end, step * k))
    text = "# a comment\n" + "\n".join(lines) + "\n"
    if packed:
        with gzip.open(str(path), "wt") as stream:
            stream.write(text)
    else:
        path.write_text(text)


def relations(path, poses, pairs, step=1.0, by=(0.0, 0.0, 0.0)):
    """Write the true relations of some pairs, each moved ``by``."""
    lines = []
    for one, two in pairs:
        x, y, theta = between(poses[one], poses[two]) + by
        lines.append("{} {} {} {} 0 0 0 {}".format(step * one, step * two, x, y, theta))
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def folder(tmp_path):
    poses = drive()
    carmen(tmp_path / "room.clf", poses)
    relations(tmp_path / "room.relations", poses, [(0, 5), (3, 40), (10, 50), (20, 31)])
    return tmp_path


def tum(path, stamps, poses):
    path.write_text("".join("{} {} {} 0 0 0 {} {}\n".format(
        stamp, x, y, math.sin(0.5 * theta), math.cos(0.5 * theta)) for stamp, (x, y, theta) in zip(stamps, poses)))
    return str(path)


# ---- logs

def test_logs_and_truths_are_found_packed_or_not(folder):
    carmen(folder / "hall.clf.gz", drive(5), packed=True)
    (folder / "hall.graph.gz").write_bytes(b"")
    hall, room = logs.find(str(folder))
    assert (hall.name, sorted(hall.truth), room.name, sorted(room.truth)) == ("hall", ["graph"], "room", ["relations"])
    assert len(list(logs.records(hall.path))) == 5
    with pytest.raises(logs.LogError, match="no log attic.*found hall, room"):
        logs.find(str(folder), ["attic"])
    with pytest.raises(logs.LogError, match="found nothing"):
        logs.find(str(folder / "nothing"))


def test_a_log_becomes_a_bag_with_all_that_was_in_it(folder):
    logs.write_bag(logs.find(str(folder))[0], str(folder / "out.bag"), laser_x=-0.1)
    with rosbag.Bag(str(folder / "out.bag")) as bag:
        scans = [message for _, message, _ in bag.read_messages("/scan")]
        transforms = [message.transforms for _, message, _ in bag.read_messages("/tf")]
    assert (len(scans), len(transforms)) == (40, 60)
    assert scans[1].header.stamp.to_sec() == logs.EPOCH + 1.0 and len(scans[1].ranges) == 181
    np.testing.assert_allclose(scans[1].ranges, ranges(drive()[1]), atol=1e-3)
    assert transforms[7][0].transform.translation.x == pytest.approx(drive()[7][0], abs=1e-6)
    assert transforms[7][1].transform.translation.x == -0.1


@pytest.mark.parametrize("line", ["FLASER 3 1 2", "ODOM 1 2", "FLASER many 1"])
def test_a_broken_line_of_a_log_is_named(tmp_path, line):
    (tmp_path / "a.clf").write_text("# x\n" + line + "\n")
    with pytest.raises(logs.LogError, match="a.clf: line 2"):
        list(logs.records(str(tmp_path / "a.clf")))


# ---- scores

def test_the_truth_moved_anywhere_has_no_error(folder):
    log, poses = logs.find(str(folder))[0], drive()
    stamps = logs.EPOCH + np.arange(60.0)
    for rows in (np.arange(60), np.arange(0, 60, 7)):           # odometry, exact here, fills the gaps
        found = scoring.score(log, tum(folder / "t.txt", stamps[rows], compose([3.0, -7.0, 2.0], poses[rows])))
        assert found["kind"] == "relations" and found["pairs"] == 4
        assert found["metres"] < 2e-5 and found["degrees"] < 1e-3 and found["again_metres"] < 2e-5


def test_known_errors_come_out(folder):
    relations(folder / "room.relations", drive(), [(0, 5), (3, 40)], by=(0.03, 0.04, math.radians(2.0)))
    path = tum(folder / "t.txt", logs.EPOCH + np.arange(60.0), drive())
    found = scoring.score(logs.find(str(folder))[0], path)
    assert found["metres"] == pytest.approx(0.05, abs=1e-4) and found["degrees"] == pytest.approx(2.0, abs=1e-2)
    assert found["again_metres"] == pytest.approx(0.05, abs=1e-4)


def test_turns_wrap():
    stamps, poses = np.array([0.0, 1.0]), np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1]])
    found = scoring.against_relations(stamps, poses, np.array([[0, 1, 0, 0, 0, 0, 0, 2 * math.pi - 6.2]], float))
    assert found["degrees"] < 1e-9


def test_poses_at_scans_replace_missing_relations(tmp_path):
    poses = drive()
    carmen(tmp_path / "room.clf", poses)
    (tmp_path / "room.ref").write_text("".join("{} {} {} {}\n".format(k, *pose) for k, pose in enumerate(poses)))
    log = logs.find(str(tmp_path))[0]
    stretched = poses * [1.1, 1.0, 1.0]
    found = scoring.score(log, tum(tmp_path / "t.txt", logs.EPOCH + np.arange(60.0), stretched))
    right = np.hypot(*np.diff(poses, axis=0)[:, :2].T).mean()
    assert found["kind"] == "ref" and found["metres"] == pytest.approx(0.1 * right, rel=0.02)
    assert 0.0 < found["again_metres"] < 0.15 and found["pairs"] == 59


def test_a_log_without_truth_has_no_score(tmp_path):
    carmen(tmp_path / "room.clf", drive())
    assert scoring.score(logs.find(str(tmp_path))[0], tum(tmp_path / "t.txt", [1000.0], [(0.0, 0.0, 0.0)])) is None


def test_a_trajectory_that_is_none_is_told(folder):
    (folder / "t.txt").write_text("nothing here\n")
    with pytest.raises(logs.LogError, match="no line with 8 numbers"):
        scoring.score(logs.find(str(folder))[0], str(folder / "t.txt"))


def test_live_poses_are_measured_locally_and_at_revisits():
    """A live pose that is 0.2 m off until a loop is closed at 30 s: local relations cross that moment for 10 s."""
    stamps, poses = np.arange(60.0), np.zeros((60, 3))
    truth = np.column_stack([stamps, poses])
    live = poses + np.where(stamps < 30.0, 0.2, 0.0)[:, None] * [1.0, 0.0, 0.0]
    found = scoring.live_errors(stamps, live, truth, "ref")
    assert found["live_metres"] == pytest.approx(0.2 * 10 / 59)
    far = [abs(live[i, 0] - live[j, 0]) for i in range(60) for j in range(i) if i - j > 20]
    assert found["live_again_metres"] == pytest.approx(np.mean(far), rel=0.01)
    pairs = np.array([[5.0, 12.0], [28.0, 32.0], [10.0, 50.0]])
    truth = np.column_stack([pairs, np.zeros((3, 6))])
    found = scoring.live_errors(stamps, live, truth, "relations")
    assert found["live_metres"] == pytest.approx(0.1) and found["live_again_metres"] == pytest.approx(0.2)


def test_live_poses_continue_with_the_odometry_since_then():
    stamps, poses = np.array([0.0, 10.0]), np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]])
    raw = np.arange(11.0), np.column_stack([np.arange(11.0), np.zeros((11, 2))])
    wanted = np.array([0.0, 9.0, 10.0])
    assert scoring.poses_at(wanted, stamps, poses, raw, live=True)[:, 0] == pytest.approx([0.0, 9.0, 7.0])
    assert scoring.poses_at(wanted, stamps, poses, raw)[:, 0] == pytest.approx([0.0, 6.0, 7.0])


def test_odometry_alone_is_measured():
    """Straight on for 30 m and back, while it drifts sideways by 3 m."""
    stamps = np.arange(61.0)
    x = np.concatenate([np.arange(31.0), np.arange(29.0, -1.0, -1.0)])
    truth = np.column_stack([stamps, x, np.zeros((61, 2))])
    wrong = truth[:, 1:].copy()
    wrong[:, 1] = 0.05 * stamps
    found = scoring.odometry_errors((stamps, wrong), truth, "ref")
    assert found["odometry_drift"] == pytest.approx(3.0 / 60.0)
    assert found["odometry_again_metres"] == pytest.approx(0.05 * 40, rel=0.1)


def test_odometry_of_a_bag_is_that_of_its_log(folder):
    path = str(folder / "out.bag")
    logs.write_bag(logs.find(str(folder))[0], path)
    stamps, poses = logs.bag_odometry(path)
    assert stamps == pytest.approx(logs.EPOCH + np.arange(60.0)) and poses == pytest.approx(drive(), abs=1e-5)
    with rosbag.Bag(str(folder / "empty.bag"), "w"):
        pass
    assert logs.bag_odometry(str(folder / "empty.bag")) is None


# ---- what is known about a log

def log_with(tmp_path, text):
    (tmp_path / "a.bag").write_bytes(b"")
    if text is not None:
        (tmp_path / "a.json").write_text(text)
    return logs.find(str(tmp_path))[0]


def test_difficulties_and_mount_are_read(tmp_path):
    log = log_with(tmp_path, '{"difficulties": {"scans": "late"}, "laser": {"mount": [0.01, -0.02, 0.03]}}')
    assert log_details.read(log) == log_details.LogDetails({"scans": "late"}, (0.01, -0.02, 0.03))


def test_a_wrong_mount_moves_the_base_but_not_the_laser():
    nominal, mount = np.array([0.2, 0.0, 0.0]), np.array([0.03, -0.04, 0.1])
    details = log_details.LogDetails({}, tuple(mount), tuple(nominal))
    base = np.array([3.0, 2.0, 1.0])
    believed = compose(compose(compose(base, nominal), mount), inverse(nominal))    # from the laser, by /tf
    assert compose(believed, details.base_correction()) == pytest.approx(base)
    assert log_details.LogDetails({}, (0.0, 0.0, 0.0)).base_correction() is None


def test_a_log_without_details_has_none(tmp_path):
    assert log_details.read(log_with(tmp_path, None)) == log_details.LogDetails()


@pytest.mark.parametrize("text", ["{", "[]", '{"difficulties": {"scans": 3}}', '{"difficulties": []}'])
def test_details_that_cannot_be_read_are_refused(tmp_path, text):
    with pytest.raises(logs.LogError, match="a.json"):
        log_details.read(log_with(tmp_path, text))


@pytest.mark.parametrize("estimate, expected", [
    ({"laser_x": 0.03, "laser_y": 0.04, "laser_yaw": 0.2}, {"laser_metres": 0.05, "laser_degrees": math.degrees(0.1)}),
    ({"laser_yaw": 0.1 - 2.0 * math.pi}, {"laser_degrees": 0.0}), ({"laser_x": 1.0}, {}), ({"laser_yaw": "x"}, {}),
    (None, {}), ([], {})])
def test_errors_of_the_estimated_mount(estimate, expected):
    details = log_details.LogDetails({}, (0.0, 0.0, 0.1))
    found = log_details.calibration_errors(details, {"calibration": estimate})
    assert found == pytest.approx(expected, abs=1e-9)
    assert log_details.calibration_errors(log_details.LogDetails(), {"calibration": estimate}) == {}


# ---- the command

def test_a_benchmark_ends_with_a_table_and_all_runs(folder, capsys):
    readme = folder / "README.md"
    readme.write_text("before\n{}\nold\n{}\nafter\n".format(table.BEGIN, table.END))
    code = command.main([str(folder), "--particles", "5", "--sets", "report", "--seeds", "2", "--set",
                         "linearUpdate=0.2", "xmin=-6", "xmax=6", "ymin=-6", "ymax=6", "--json",
                         str(folder / "all.json"), "--table", str(readme), "--keep", str(folder / "kept")])
    told = capsys.readouterr()
    assert code == 0
    assert "2 of 2: room, report, 5 particles, seed 2" in told.err
    runs = json.loads((folder / "all.json").read_text())["runs"]
    assert [(run["particles"], run["seed"]) for run in runs] == [(5, 1), (5, 2)]
    assert all(run["score"]["metres"] < 0.03 and run["score"]["degrees"] < 1.5 for run in runs)
    assert all(run["statistics"]["beams"] == 181 for run in runs)
    lines = [line for line in told.out.splitlines() if line.startswith("| room | report |")]
    assert len(lines) == 1 and "Means over 2 seeds" in told.out
    text = readme.read_text()
    assert text == "before\n{}\n{}{}\nafter\n".format(table.BEGIN, told.out, table.END)
    assert (folder / "kept" / "room_report_5_2.yaml").exists()


def test_a_benchmark_that_was_ended_resumes(folder, capsys, monkeypatch):
    words = [str(folder), "--particles", "2", "--sets", "report", "--set", "linearUpdate=0.5", "xmin=-6", "xmax=6",
             "ymin=-6", "ymax=6", "--keep", str(folder / "kept"), "--quiet"]
    assert command.main(words + ["--seeds", "1"]) == 0
    first, begun = capsys.readouterr().out, []

    def run(line, **_):
        """In the place of the replay: what it wrote the first time."""
        begun.append(line)
        for option, ending in (("--tracked", ".txt"), ("--online", ".online"), ("--stats", ".json")):
            text = (folder / "kept" / ("room_report_2_1" + ending)).read_text()
            with open(line[line.index(option) + 1], "w") as stream:
                stream.write(text)
        return command.subprocess.CompletedProcess(line, 0, "")
    monkeypatch.setattr(command.subprocess, "run", run)
    assert command.main(words + ["--seeds", "1", "--resume"]) == 0
    assert not begun and capsys.readouterr().out == first
    assert command.main(words + ["--seeds", "2", "--resume"]) == 0
    assert len(begun) == 1 and begun[0][begun[0].index("--seed") + 1] == "2"
    # another program, other parameters, another log, a record that was cut off: all is done again
    (folder / "kept" / "room_report_2_1.run").write_text('{"key": ')
    assert command.main(words + ["--seeds", "1", "--resume"]) == 0 and len(begun) == 2
    assert command.main(words + ["--seeds", "1", "--resume", "--threads", "2"]) == 0 and len(begun) == 3
    monkeypatch.setattr(command.finished_runs, "program_digest", lambda: "another one")
    assert command.main(words + ["--seeds", "1", "--resume"]) == 0 and len(begun) == 4


@pytest.mark.parametrize("words, told", [
    ([".", "--resume"], "expected --keep"),
    ([], "no folder"), (["nowhere"], "no such folder"), ([".", "--particles", "0"], "at least 1"),
    ([".", "--set", "delta"], "expected NAME=VALUE"), ([".", "--table", "none.md"], "none.md"),
    ([".", "--json", "nowhere/all.json"], "no folder"), ([".", "--count", "3"], "expected --make"),
    ([".", "--make", "exam", "--logs", "a"], "expected only one")])
def test_words_that_do_not_fit_are_told_at_once(tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(command.FOLDER_VARIABLE, raising=False)
    with pytest.raises(SystemExit) as caught:
        command.main(words)
    assert caught.value.code == command.USAGE and told in capsys.readouterr().err


def test_closed_loops_are_counted_for_each_set():
    def run(name, error):
        return {"set": name, "particles": 30, "score": error and {"again_metres": error}}

    text = table.closed([run("default", 0.1), run("report", 0.2), run("default", 0.4), run("default", None),
                         run("default", 0.2)])
    assert "default, 30 particles: loops closed (mean error at revisits at most 0.3 m) in 2 of 3 runs" in text
    assert "median 0.200 m, worst 0.400 m" in text
    assert "report, 30 particles" in text and "in 1 of 1 runs" in text


def finished(log, error, first_ms=1.0, drift=0.0, **difficulties):
    times = dict(total_s=2.0, mean_ms=1.0, max_ms=9.0, first_ms=first_ms, last_ms=3.0)
    statistics = dict(processScan=dict(cpu=times, wall=times), processed=100, peak_memory_mib=50.0,
                      map_updates=dict(count=0, cpu=times), beams=3)
    return dict(log=log, set="default", particles=30, seed=1, statistics=statistics, difficulties=difficulties,
                score=dict(kind="ref", metres=0.1, degrees=1.0, again_metres=error, again_degrees=2.0,
                           odometry_drift=drift))


def test_runs_are_grouped_by_their_difficulties():
    runs = [finished("a", 0.1, scans="late"), finished("b", 0.5, scans="late", drift=0.2), finished("c", 0.2, turn="x")]
    lines = difficulty_table.markdown(runs).splitlines()
    cells = {tuple(line.split(" | ")[1:3]): line.split(" | ") for line in lines[2:]}
    assert cells[("all", "")][3:6] == ["2 of 3", "0.200 m", "0.50 m"]
    assert cells[("odometry", "less than 10% off")][3] == "2 of 2"
    assert cells[("scans", "late")][3:6] == ["1 of 2", "0.300 m", "0.50 m"]
    assert cells[("turn", "x")][3] == "1 of 1"
    assert difficulty_table.markdown([finished("a", 0.1)]) is None


def test_growth_of_the_time_is_the_last_tenth_by_the_first():
    run = finished("a", 0.1, first_ms=2.0)
    assert table.growth(run["statistics"]) == pytest.approx(1.5)
    run["statistics"]["processed"] = 10
    assert table.growth(run["statistics"]) is None


def test_a_set_of_logs_is_made_and_mapped(tmp_path, monkeypatch, capsys):
    def make(words):
        assert words == [str(tmp_path / "new"), "--set", "exam", "--count", "2"]
        (tmp_path / "new").mkdir()
        return 0

    monkeypatch.setattr(make_command, "main", make)
    assert command.main([str(tmp_path / "new"), "--make", "exam", "--count", "2"]) == command.FAILED
    assert "no log exam_000" in capsys.readouterr().err       # the fake has written none
    monkeypatch.setattr(make_command, "main", lambda _: 7)
    assert command.main([str(tmp_path / "new"), "--make", "exam"]) == 7


def test_a_run_that_fails_says_why(folder, capsys):
    assert command.main([str(folder), "--sets", "default", "--seeds", "1", "--particles", "2", "--set", "delta=0"]) == 1
    assert "parameter delta is 0" in capsys.readouterr().err


def test_a_readme_without_the_two_lines_is_refused(tmp_path):
    (tmp_path / "a.md").write_text(table.END + table.BEGIN)
    with pytest.raises(ValueError, match="once each, in this order"):
        table.check(str(tmp_path / "a.md"))
