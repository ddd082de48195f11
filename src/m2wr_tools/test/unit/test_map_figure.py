# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of maps over their worlds."""
import numpy as np
import pytest
import rosbag
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from PIL import Image
from visualization_msgs.msg import Marker, MarkerArray

from m2wr_gmapping.graph_view import GraphView
from m2wr_maps import map_file
from m2wr_maps.saved_map_reader import read_map
from m2wr_tools.map_figure import command
from m2wr_tools.map_figure.figure import map_figure
from m2wr_view.outlines import Outline


@pytest.fixture
def plan(tmp_path):
    """Name of a map of 4 x 2 m, a wall at its right side."""
    data = np.zeros((40, 80), np.int8)
    data[:, 75] = 100
    data[:, 76:] = -1
    map_file.save(str(tmp_path / "plan"), data, 0.05, [1.0, -1.0, 0.0])
    return str(tmp_path / "plan.yaml")


def box_bag(path):
    """A bag with the markers of one box at (2, 0)."""
    marker = Marker(ns="crate", type=Marker.CUBE, action=Marker.ADD, scale=Vector3(0.5, 0.5, 1.0),
                    pose=Pose(Point(2.0, 0.0, 0.5), Quaternion(0.0, 0.0, 0.0, 1.0)))
    with rosbag.Bag(path, "w") as bag:
        bag.write("/gazebo/world_markers", MarkerArray([marker]), rospy.Time(10))
    return path


def drawn(figure):
    """Function: the colours (25, 3) around a place in metres."""
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
    place = figure.axes[0].transData

    def at(x, y):
        column, row = place.transform((x, y))
        row, column = int(image.shape[0] - 1 - row), int(column)
        return image[row - 2:row + 3, column - 2:column + 3].reshape(-1, 3)
    return at


def test_cells_are_where_they_are_in_the_world(plan):
    for offset, turn in (((0.0, 0.0, 0.0), lambda x, y: (x, y)),
                         ((5.0, 2.0, np.pi / 2), lambda x, y: (5.0 - y, 2.0 + x))):
        at = drawn(map_figure(read_map(plan), offset=offset))
        assert at(*turn(1.0 + 75 * 0.05, 0.3)).max() < 40           # the wall
        assert at(*turn(2.0, 0.3)).min() > 250                      # free
        assert 200 < np.median(at(*turn(1.0 + 78 * 0.05, 0.3))) < 240    # unknown


def test_world_and_way_are_drawn(plan):
    square = Outline(np.array([(2.0, -0.5), (3.0, -0.5), (3.0, 0.5), (2.0, 0.5)]))
    way = np.array([[1.2, 0.0, 0.0], [1.8, 0.0, 0.0]])
    at = drawn(map_figure(read_map(plan), [square], [("path", way)]))
    assert (at(1.5, 0.0)[:, 0] > at(1.5, 0.0)[:, 2] + 50).any()
    assert np.median(at(2.5, 0.2)) > 250                # free cells cover the obstacle that they contradict


def test_the_graph_is_drawn(plan, tmp_path, capsys):
    graph = GraphView(np.array([[1.5, -0.5, 0.0], [3.5, -0.5, 0.0], [3.5, 0.5, 0.0], [1.5, 0.5, 0.0]]),
                      np.array([[0, 3], [0, 2]]), np.array([True, False]))
    figure = map_figure(read_map(plan), graph=graph)
    at = drawn(figure)
    blue, green = at(2.5, -0.5), at(1.5, 0.0)
    assert (blue[:, 2] > blue[:, 0] + 50).any()                     # the path
    assert (green[:, 1] > green[:, 0] + 50).any()                   # a loop closure
    along = np.concatenate([at(1.5 + 2.0 * k, -0.5 + k) for k in np.linspace(0.1, 0.9, 40)])
    assert (along[:, 0] > along[:, 2] + 100).any() and (along.min(axis=1) > 250).any()      # dashed
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert {"4 nodes", "1 loop closures", "1 not accepted"} <= set(texts)
    (tmp_path / "graph.json").write_text(graph.text())
    assert command.main([plan, "--graph", str(tmp_path / "graph.json"), "--out", str(tmp_path / "g.png")]) == 0
    (tmp_path / "graph.json").write_text("{}")
    assert command.main([plan, "--graph", str(tmp_path / "graph.json")]) == 1
    assert "graph.json: edges: expected rows" in capsys.readouterr().err


def test_an_archive_that_is_no_state_is_refused(plan, tmp_path, capsys):
    np.savez(str(tmp_path / "other.npz"), nodes=np.zeros((3, 3)))
    assert command.main([plan, "--graph", str(tmp_path / "other.npz")]) == 1
    assert "plot_map: " in capsys.readouterr().err


def test_obstacles_hide_no_cell_of_the_map(plan):
    box = np.array([(4.7, -0.5), (5.5, -0.5), (5.5, 0.5), (4.7, 0.5)])
    parts = [Outline(box), Outline(box + (0.0, 0.2))]               # bodies consist of shapes that overlap
    figure = map_figure(read_map(plan), parts)
    at = drawn(figure)
    assert at(1.0 + 75 * 0.05, 0.3).max() < 40                      # occupied, on the face of the box
    for y in (0.0, 0.5, 0.6):                                       # unknown: the box, without lines in it
        place = at(5.1, y)
        assert (place[:, 2] > place[:, 0] + 50).all() and np.ptp(place, axis=0).max() < 5
    assert 200 < np.median(at(5.1, -0.8)) < 240                     # unknown, and nothing stands there
    assert "obstacle of the world" in [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


def test_the_command_writes_a_picture_of_each_kind(plan, tmp_path, capsys):
    (tmp_path / "way.txt").write_text("1 1.2 0 0 0 0 0 1\n2 1.9 0 0 0 0 0 1\n")
    for ending in ("png", "svg", "pdf"):
        out = str(tmp_path / ("out." + ending))
        code = command.main([plan, "--world", box_bag(str(tmp_path / "box.bag")), "--trajectory",
                             str(tmp_path / "way.txt"), "--out", out])
        assert code == 0 and capsys.readouterr().out.strip() == out
    assert min(Image.open(str(tmp_path / "out.png")).size) > 100       # pixels
    assert b"way.txt" in (tmp_path / "out.svg").read_bytes() or (tmp_path / "out.svg").stat().st_size > 5000
    assert command.main([plan]) == 0 and (tmp_path / "plan_plot.png").exists()


@pytest.mark.parametrize("words, told", [
    (["none.yaml"], "none.yaml: No such file"), (["PLAN", "--out", "a.jpeg"], "ends in .png"),
    (["PLAN", "--out", "nowhere/a.png"], "nowhere/a.png: No such file"),
    (["PLAN", "--trajectory", "none.txt"], "none.txt: "), (["PLAN", "--world", "empty.bag"], "/gazebo/world_markers"),
    (["PLAN", "--world", "none.bag"], "none.bag")])
def test_what_cannot_be_read_or_written_is_told(plan, tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    with rosbag.Bag("empty.bag", "w"):
        pass
    assert command.main([plan if word == "PLAN" else word for word in words]) == 1
    assert told in capsys.readouterr().err
