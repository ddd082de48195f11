# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a run: its lines carry the numbers of the bag, and it says what a bag lacks."""
import os

import numpy as np
import pytest

from m2wr_view import run_series
from m2wr_view.errors import ViewError
from m2wr_view.run_figure import main, run_page
from m2wr_view.run_log import read_run


def lines_of(panel):
    return {line.get_label(): np.array(line.get_data()) for line in panel.get_lines()}


def test_clearance_is_the_distance_of_the_outlines(corner_bag):
    path = corner_bag()
    figure, missing = run_page(path)
    assert not missing
    times, distance = lines_of(figure.axes[1])["_child0"]
    # the cart reaches 0.2 m to its side, the crate begins at y = 1 and ends at x = 2.5; later the cart goes up at x = 4
    assert np.interp(3.0, times, distance) == pytest.approx(0.8, abs=1e-6)
    assert np.interp(6.5, times, distance) == pytest.approx(1.3, abs=1e-6)
    assert "least clearance 0.80 m" in figure._suptitle.get_text()
    assert "goal reached" in figure._suptitle.get_text()


def test_odometry_is_compared_with_the_truth(corner_bag):
    figure, _ = run_page(corner_bag(truth_off=(-0.1, 0.03)))
    lines = lines_of(figure.axes[4])
    early = lines["along [mm]"][0] < 4.5
    assert lines["along [mm]"][1][early] == pytest.approx(100.0, abs=0.1)       # driving along x
    assert lines["across [mm]"][1][early] == pytest.approx(-30.0, abs=0.1)
    late = lines["along [mm]"][0] > 5.5
    assert lines["along [mm]"][1][late] == pytest.approx(-30.0, abs=0.1)        # driving along y
    assert lines["across [mm]"][1][late] == pytest.approx(-100.0, abs=0.1)
    assert lines["heading [mrad]"][1][early] == pytest.approx(0.0, abs=1e-6)


def test_states_are_bands(corner_bag):
    figure, _ = run_page(corner_bag())
    bands = [patch.get_xy()[:, 0] for patch in figure.axes[2].patches]
    assert [(band.min(), band.max()) for band in bands[:2]] == [pytest.approx((1.0, 5.0)), pytest.approx((5.0, 8.0))]


def test_jitter_of_the_recorder_is_taken_out():
    beat = np.arange(50) * 0.05
    noted = beat.copy()
    noted[[7, 20, 31]] -= 0.01
    assert run_series.steady(noted) == pytest.approx(beat)
    paused = np.concatenate((beat, 7.013 + beat))
    assert run_series.steady(paused)[-1] == pytest.approx(paused[-1], abs=0.026)


@pytest.mark.parametrize("ending, begins", [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_the_command_writes_a_file(corner_bag, tmp_path, capsys, ending, begins):
    out = str(tmp_path / ("figure." + ending))
    assert main([corner_bag(), "--out", out]) == 0
    assert capsys.readouterr().out.strip() == out
    with open(out, "rb") as stream:
        assert stream.read(5).startswith(begins)


def test_what_a_bag_lacks_is_said_and_the_rest_is_drawn(corner_bag, capsys):
    path = corner_bag(without=("/gazebo/world_markers", "/gazebo/robot_states", "/cmd_vel", "/bug2/state"))
    assert main([path]) == 0
    text = capsys.readouterr().err
    for topic in ("/gazebo/world_markers", "/gazebo/robot_states", "/cmd_vel"):
        assert "no " in text and topic in text
    assert os.path.getsize(path[:-4] + "_run.png") > 10000


def test_what_cannot_be_done_is_said(corner_bag, tmp_path, capsys):
    assert main([corner_bag(without=("/odom",))]) == 1
    assert "no run in topic /odom" in capsys.readouterr().err
    assert main([str(tmp_path / "no.bag")]) == 1
    assert "no.bag: No such file" in capsys.readouterr().err
    assert main([corner_bag(), "--out", str(tmp_path / "none" / "figure.png")]) == 1
    assert "expected a file in a folder that can be written to" in capsys.readouterr().err
    assert main([corner_bag(), "--out", "figure.doc"]) == 1
    assert "expected one of .png" in capsys.readouterr().err


def test_a_broken_bag_is_named(corner_bag, tmp_path):
    with open(corner_bag(), "rb") as stream:
        data = stream.read()
    path = str(tmp_path / "half.bag")
    with open(path, "wb") as stream:
        stream.write(data[:len(data) // 2])
    with pytest.raises(ViewError, match="half.bag: "):
        read_run(path)
