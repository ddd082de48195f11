# SPDX-License-Identifier: BSD-3-Clause
"""The shortest path among rounded obstacles: closed forms, another exact method, and the definition itself."""
import math

import numpy as np
import pytest

from m2wr_navigation.optimum.shortest_path import NoShortestPathError, shortest_path
from m2wr_navigation.planners.visibility_kernels import shortest
from m2wr_view.outlines import Outline, point_distances


def box(x, y, length, width, name=""):
    return Outline(np.array([(x - length / 2, y - width / 2), (x + length / 2, y - width / 2),
                             (x + length / 2, y + width / 2), (x - length / 2, y + width / 2)]), 0.0, name)


def disc(x, y, radius):
    return Outline(np.array([(x, y)]), radius)


def least_distance(path, obstacles):
    parts = [a + (b - a) * np.linspace(0.0, 1.0, 50)[:, None] for a, b in zip(path.points[:-1], path.points[1:])]
    return min(point_distances(np.concatenate(parts), obstacle).min() for obstacle in obstacles)


def test_without_obstacles_the_path_is_straight():
    path = shortest_path([], 0.3, (0.0, 0.0), (3.0, 4.0))
    assert path.length == pytest.approx(5.0, abs=1e-12) and path.points.tolist() == [[0.0, 0.0], [3.0, 4.0]]


def test_around_a_disc_the_path_is_two_tangents_and_an_arc():
    path = shortest_path([disc(0.0, 0.0, 0.7)], 0.3, (-3.0, 0.0), (3.0, 0.0))
    assert path.length == pytest.approx(2.0 * math.sqrt(8.0) + 2.0 * math.asin(1.0 / 3.0), abs=1e-9)


def test_around_a_wall_the_path_turns_at_its_rounded_corners():
    far, high, thick, radius = 3.0, 2.0, 0.2, 0.4
    path = shortest_path([box(0.0, 0.0, 2 * thick, 2 * high)], radius, (-far, 0.0), (far, 0.0))
    away = math.hypot(far - thick, high)
    turn = math.atan2(high, far - thick) + math.asin(radius / away)
    best = 2.0 * (math.sqrt(away ** 2 - radius ** 2) + radius * turn + thick)
    assert path.length == pytest.approx(best, abs=1e-9)


def test_a_wall_without_width_counts_as_a_thin_one():
    thin = shortest_path([box(0.0, 0.0, 0.0002, 2.0)], 0.3, (-2.0, 0.1), (2.0, 0.1))
    line = shortest_path([Outline(np.array([(0.0, -1.0), (0.0, 1.0)]))], 0.3, (-2.0, 0.1), (2.0, 0.1))
    assert line.length == pytest.approx(thin.length, abs=1e-3) and line.length > 4.1


def test_between_two_discs_the_path_takes_the_inner_tangent():
    path = shortest_path([disc(-2.0, -1.0, 1.0), disc(2.0, 1.0, 1.0)], 0.5, (-2.0, 0.5), (2.0, -0.5))
    # both ends lie on the circles of radius 1.5: an arc, the tangent, and the arc again, symmetric about the origin
    tangent = 2.0 * math.sqrt(5.0 - 2.25)
    arc = 1.5 * (0.5 * math.pi - math.acos(1.5 / math.sqrt(5.0)) - math.atan2(1.0, 2.0))
    assert path.length == pytest.approx(tangent + 2.0 * arc, abs=1e-9)


def test_a_gap_is_open_only_to_a_robot_that_fits():
    walls = [box(0.0, 3.3, 0.2, 6.0), box(0.0, -3.3, 0.2, 6.0)]
    assert shortest_path(walls, 0.2999, (-1.0, 0.0), (1.0, 0.0)).length == pytest.approx(2.0, abs=1e-9)
    assert shortest_path(walls, 0.3001, (-1.0, 0.0), (1.0, 0.0)).length > 12.0


def test_a_closed_room_has_no_path():
    room = [box(0.0, 2.0, 4.2, 0.2), box(0.0, -2.0, 4.2, 0.2), box(2.0, 0.0, 0.2, 4.2), box(-2.0, 0.0, 0.2, 4.2)]
    with pytest.raises(NoShortestPathError, match="no way through"):
        shortest_path(room, 0.2, (0.0, 0.0), (5.0, 0.0))


def test_an_end_in_an_obstacle_is_named():
    with pytest.raises(NoShortestPathError, match=r"the goal \(2.00, 0.00\) is 0.00 m from crate"):
        shortest_path([box(2.0, 0.0, 1.0, 1.0, "crate")], 0.2, (0.0, 0.0), (2.0, 0.0))
    with pytest.raises(NoShortestPathError, match="the start .* is 0.10 m from crate; the robot's radius is 0.20 m"):
        shortest_path([box(2.0, 0.0, 1.0, 1.0, "crate")], 0.2, (1.4, 0.0), (5.0, 0.0))


@pytest.mark.parametrize("start, radius", [((math.nan, 0.0), 0.2), ((0.0, 0.0), 0.0), ((0.0, 0.0), math.inf)])
def test_odd_numbers_are_refused(start, radius):
    with pytest.raises(ValueError, match="expected finite numbers and a positive radius"):
        shortest_path([], radius, start, (1.0, 0.0))


@pytest.mark.parametrize("seed", range(4))
def test_a_point_robot_agrees_with_the_exact_path_on_a_grid(seed):
    rng, blocked = np.random.default_rng(seed), np.zeros((24, 24), np.uint8)
    for row in range(2, 22, 3):
        for column in range(2, 22, 3):      # apart from each other: no corner contacts
            high, wide = rng.integers(1, 3, 2)
            blocked[row:row + high, column:column + wide] = rng.random() < 0.7
    outlines = []
    for row in range(2, 22, 3):
        for column in range(2, 22, 3):
            rows, columns = np.nonzero(blocked[row:row + 2, column:column + 2])
            if len(rows):
                low, left, high, wide = row + rows.min(), column + columns.min(), np.ptp(rows) + 1, np.ptp(columns) + 1
                outlines.append(box(left + wide / 2, low + high / 2, wide, high))
    exact = shortest(blocked, (0, 0), (23, 22))[1]
    path = shortest_path(outlines, 1e-5, (0.5, 0.5), (22.5, 23.5))
    assert path.length == pytest.approx(exact, abs=1e-3) and path.length > math.hypot(22.0, 23.0) + 0.01


@pytest.mark.parametrize("seed", range(8))
def test_paths_among_many_shapes_are_free_and_locally_shortest(seed):
    rng, obstacles = np.random.default_rng(seed), []
    for _ in range(25):
        x, y = rng.uniform(1.0, 9.0, 2)
        obstacles.append(disc(x, y, rng.uniform(0.1, 0.6)) if rng.random() < 0.4
                         else box(x, y, *rng.uniform(0.1, 1.5, 2)))
    path = shortest_path(obstacles, 0.2, (0.0, 0.0), (10.0, 10.0))
    assert least_distance(path, obstacles) > 0.2 - 0.2 * (1.0 - math.cos(math.radians(1.5))) - 0.6 * 4e-4
    steps = np.hypot(*np.diff(path.points, axis=0).T)
    assert steps.sum() == pytest.approx(path.length, rel=1e-3) and steps.sum() <= path.length + 1e-9
    # no shortcut: points farther apart along the path than in a straight line do not see each other
    for a in range(0, len(path.points) - 2, 3):
        for b in range(a + 2, len(path.points), 3):
            chord = path.points[a] + (path.points[b] - path.points[a]) * np.linspace(0.0, 1.0, 200)[:, None]
            along = steps[a:b].sum()
            if along > np.hypot(*(path.points[b] - path.points[a])) + 0.01:
                assert min(point_distances(chord, obstacle).min() for obstacle in obstacles) < 0.2


def test_the_path_back_has_the_same_length():
    obstacles = [disc(1.0, 0.2, 0.5), box(2.5, -0.3, 0.4, 2.0), box(4.0, 0.5, 0.4, 2.0)]
    there = shortest_path(obstacles, 0.25, (0.0, 0.0), (5.0, 0.0))
    back = shortest_path(obstacles, 0.25, (5.0, 0.0), (0.0, 0.0))
    assert there.length == pytest.approx(back.length, abs=1e-12) and there.length > 5.1


def test_covered_shapes_do_not_count_among_the_corners():
    """A barrier is made of boxes on each other: 400 of them have more corners than are allowed."""
    walls = [box(2.0, 0.0, 0.8, 2.0), disc(3.5, 0.0, 0.4)]
    layers = [box(2.0, 0.0, 0.8 - 0.001 * k, 2.0) for k in range(400)] + [disc(3.4, 0.0, 0.3), disc(3.5, 0.0, 0.4)]
    assert shortest_path(walls + layers + walls, 0.25, (0.0, 0.0), (5.0, 0.3)).length == pytest.approx(
        shortest_path(walls, 0.25, (0.0, 0.0), (5.0, 0.3)).length, abs=1e-12)
