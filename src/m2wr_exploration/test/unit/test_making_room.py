# SPDX-License-Identifier: BSD-3-Clause
"""Robots that wait are not where others drive."""
import numpy as np
import pytest

from exploration_grids import grid
from m2wr_exploration.team.making_room import DETOUR, ROOM, disc, paths, place_to_wait

HALL = grid("\n".join(["#" * 60] + ["#" + "." * 58 + "#"] * 38 + ["#" * 60]), 0.1)          # 5.8 m x 3.8 m
#: A corridor along x of 0.8 m with a room in the middle of its upper side.
CORRIDOR = grid("\n".join(["#" * 60] + ["#" * 26 + "." * 10 + "#" * 24] * 12 + ["#" + "." * 58 + "#"] * 8
                          + ["#" * 60]), 0.1)
ALONG = np.column_stack([np.arange(0.3, 5.6, 0.1), np.full(53, 0.5)])
FAR = np.array([[0.3, 0.5]])


def test_a_robot_beside_a_path_stays():
    assert place_to_wait(HALL, np.array([3.0, 0.5 + ROOM + 0.01]), [ALONG], FAR) is None


def test_a_robot_on_a_path_goes_the_shortest_way_out():
    place = place_to_wait(HALL, np.array([3.0, 0.6]), [ALONG], FAR)
    assert place[0] == pytest.approx(3.0, abs=0.15) and ROOM < place[1] - 0.5 < ROOM + 0.25


def test_a_place_that_is_clear_is_kept():
    robot, kept = np.array([3.0, 0.6]), np.array([4.0, 3.0])
    assert place_to_wait(HALL, robot, [ALONG], FAR, kept) is kept
    assert place_to_wait(HALL, robot, [ALONG, kept[None]], FAR, kept) is not kept


def test_in_a_corridor_it_drives_to_the_next_room():
    place = place_to_wait(CORRIDOR, np.array([1.5, 0.5]), [ALONG], FAR)
    assert 2.6 < place[0] < 3.6 and place[1] > 0.5 + ROOM


def test_it_does_not_pass_the_teammate():
    assert place_to_wait(CORRIDOR, np.array([1.5, 0.5]), [ALONG[::-1]], np.array([[2.3, 0.5]])) is None


def test_without_teammates_that_drive_it_stays():
    assert place_to_wait(HALL, np.array([3.0, 0.6]), [], FAR) is None


def test_a_robot_outside_of_the_map_stays():
    assert place_to_wait(HALL, np.array([-0.05, 0.5]), [ALONG], FAR) is None


def test_paths_lead_round_a_robot_where_there_is_room():
    robot = np.array([3.0, 1.9])
    (path,) = paths(HALL, robot, [(np.array([0.5, 1.9]), np.array([5.5, 1.9]))])
    assert np.hypot(*(path - robot).T).min() > DETOUR - 0.1
    (path,) = paths(CORRIDOR, np.array([1.5, 0.5]), [(np.array([0.5, 0.5]), np.array([5.5, 0.5]))])
    assert np.hypot(*(path - (1.5, 0.5)).T).min() < 0.5 * ROOM


def test_a_teammate_that_finds_no_path_has_none():
    assert paths(HALL, np.array([3.0, 0.6]), [(np.array([0.5, 0.5]), np.array([50.0, 0.5]))]) == []


def test_a_disc_ends_at_the_border_of_the_map():
    drawn = np.zeros(HALL.shape, int)
    drawn[disc(HALL, np.array([0.0, 0.0]), 0.5)] = 1
    rows, columns = np.nonzero(drawn)
    assert len(rows) and np.hypot(0.1 * (rows + 0.5), 0.1 * (columns + 0.5)).max() <= 0.5
    assert not len(disc(HALL, np.array([50.0, 50.0]), 0.5)[0])
