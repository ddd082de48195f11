# SPDX-License-Identifier: BSD-3-Clause
"""A map against its world: a perfect map agrees, a shifted or doubled one does not."""
import copy

import numpy as np
import pytest

from m2wr_sim.errors import WorldError
from m2wr_sim.model.sdf.loader import load_world
from m2wr_tools.map_comparison.agreement import INSIDE, OUTSIDE, WALL, Truth, compare, format_agreement, picture

WORLD = """<sdf version="1.6"><world name="w"><model name="box"><static>true</static><pose>1 0.5 0.5 0 0 0</pose>
<link name="l"><collision name="c"><geometry><box><size>2 1 1</size></box></geometry></collision></link></model>
</world></sdf>"""
CELL, ORIGIN, SHAPE = 0.1, np.array([-1.0, -1.0]), (30, 40)


@pytest.fixture(scope="module")
def truth():
    return Truth(load_world(WORLD))


def perfect(truth):
    drawn = truth.drawn(SHAPE, CELL, ORIGIN)
    return np.where(drawn == WALL, 100, np.where(drawn == INSIDE, -1, 0)).astype(np.int8)


def test_the_truth_has_walls_where_the_box_ends(truth):
    drawn = truth.drawn(SHAPE, CELL, ORIGIN)
    assert (drawn[10, 10:30] == WALL).all() and (drawn[20, 10:30] == WALL).all()
    assert (drawn[11:20, 11:30] == INSIDE).all()
    assert (drawn[:10] == OUTSIDE).all() and (drawn[:, :10] == OUTSIDE).all()


def test_a_perfect_map_agrees(truth):
    found = compare(perfect(truth), CELL, ORIGIN, truth)
    assert (found.on_walls, found.truly_free, found.found, found.doubled) == (1.0, 1.0, 1.0, 0)
    assert found.farthest <= 0.5 * CELL + 1e-9


def test_a_map_that_is_three_cells_off_does_not(truth):
    found = compare(np.roll(perfect(truth), 3, axis=0), CELL, ORIGIN, truth)
    assert found.on_walls < 0.5 and found.truly_free < 0.97
    assert found.farthest == pytest.approx(3 * CELL, abs=0.6 * CELL)


def test_a_wall_drawn_twice_is_counted(truth):
    data = perfect(truth)
    data[6, 12:28] = 100
    found = compare(data, CELL, ORIGIN, truth)
    assert found.doubled == 16
    assert "doubled 16" in format_agreement(found)


def test_walls_that_were_seen_and_not_drawn_are_missed(truth):
    data = perfect(truth)
    data[10, :] = 0
    assert 0.5 < compare(data, CELL, ORIGIN, truth).found < 0.95


def test_the_picture_shows_a_wrong_wall_in_red(truth):
    data = perfect(truth)
    data[3, 20] = 100
    colours = picture(data, CELL, ORIGIN, truth)
    assert ((colours == (230, 30, 30)).all(axis=2)).sum() == 1


@pytest.mark.parametrize("yaw", [0.0, 0.1, 1.2, -2.0])
def test_walls_that_overlap_and_lie_flush_are_all_seen(yaw):
    """Rounding puts either surface a hair's breadth inside the other obstacle."""
    box = WORLD[WORLD.index("<model"):WORLD.index("</world>")]
    turned = "<pose>%r %r 0.5 0 0 %r</pose>"
    parts = [box.replace('"box"', '"b%d"' % k).replace(
        "<pose>1 0.5 0.5 0 0 0</pose>", turned % (along * np.cos(yaw), along * np.sin(yaw), yaw))
        for k, along in enumerate((-0.73, 0.41, 0.9))]
    truth = Truth(load_world("<sdf version='1.6'><world name='w'>%s</world></sdf>" % "".join(parts)))
    points = truth._surfaces(0.01)
    along = np.arange(-1.7, 1.85, 0.01)
    for side in (-0.5, 0.5):
        wall = np.stack((along * np.cos(yaw) - side * np.sin(yaw), along * np.sin(yaw) + side * np.cos(yaw)), -1)
        gaps = np.hypot(*(wall[:, None] - points[None]).transpose(2, 0, 1)).min(axis=1)
        assert gaps.max() < 0.011


def test_a_world_with_nothing_at_the_lasers_height_is_refused():
    with pytest.raises(WorldError, match="nothing at the height of the laser"):
        Truth(load_world(WORLD), height=2.0)


@pytest.mark.parametrize("frame", [(0.4, -0.7, 0.0), (-1.3, 0.6, 0.8), (2.0, 1.0, -2.5)])
def test_a_map_in_another_frame_is_compared_there(truth, frame):
    """A robot that counts from its start draws the same walls at other coordinates."""
    elsewhere = Truth(load_world(WORLD), frame=frame)
    shape, origin = (120, 120), np.array([-6.0, -6.0])
    columns, rows = np.meshgrid(*(origin[k] + CELL * np.arange(shape[1 - k]) for k in (0, 1)))
    cosine, sine = np.cos(frame[2]), np.sin(frame[2])
    x, y = frame[0] + cosine * columns - sine * rows, frame[1] + sine * columns + cosine * rows
    gone = np.maximum(np.abs(x - 1.0) - 1.0, np.abs(y - 0.5) - 0.5)         # below 0 within the box
    data = np.where(np.abs(gone) < 0.5 * CELL, 100, np.where(gone < 0.0, -1, 0)).astype(np.int8)
    found = compare(data, CELL, origin, elsewhere)
    assert (found.on_walls, found.found, found.doubled) == (1.0, 1.0, 0) and found.truly_free > 0.999
    assert compare(data, CELL, origin, truth).on_walls < 0.5


def test_one_truth_draws_any_grid_like_a_fresh_one(truth):
    for shape, resolution, origin in (((60, 80), 0.05, (-2.0, -1.5)), ((30, 40), 0.1, (-2.0, -1.5)),
                                      ((90, 60), 0.05, (-1.02, -2.2)), ((60, 80), 0.05, (-2.0, -1.5))):
        fresh = copy.copy(truth)
        fresh._step = None
        drawn = truth.drawn(shape, resolution, np.array(origin))
        assert np.array_equal(drawn, fresh.drawn(shape, resolution, np.array(origin))) and len(np.unique(drawn)) == 3
