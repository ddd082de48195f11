# SPDX-License-Identifier: BSD-3-Clause
"""Generated worlds are the same for a seed, can be loaded, and the exact planner finds a way through each."""
import numpy as np
import pytest

from m2wr_campaign.worlds import maze, office, parts
from m2wr_campaign.worlds.generators import GENERATORS, generate
from m2wr_navigation.barn.fields import automaton
from m2wr_navigation.barn.worlds import cylinders_of
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines

RADIUS = 0.45       # m


def defaults(kind):
    return {name: parameter.default for name, parameter in GENERATORS[kind].parameters.items()}


@pytest.mark.parametrize("kind", sorted(GENERATORS))
def test_a_world_has_a_way_and_depends_on_its_seed(kind):
    text, (start, goal) = generate(kind, defaults(kind), 1, 2, RADIUS)
    obstacles = obstacle_outlines(read_world(text))
    way = shortest_path(obstacles, RADIUS, start, goal)
    assert way.length >= np.hypot(goal[0] - start[0], goal[1] - start[1])
    assert (text, (start, goal)) == generate(kind, defaults(kind), 1, 2, RADIUS)
    assert text != generate(kind, defaults(kind), 1, 3, RADIUS)[0]


def test_a_world_without_a_way_is_told(monkeypatch):
    monkeypatch.setattr("m2wr_campaign.worlds.generators.TRIES", 2)
    with pytest.raises(ValueError, match="generator barn with cell 0.15, fill 0.5, rounds 3: no way .* in 2 worlds"):
        generate("barn", {"fill": 0.5, "rounds": 3, "cell": 0.15}, 0, 0, RADIUS)


def test_a_field_follows_the_rules_of_the_automaton():
    full = automaton(np.random.default_rng(5), 0.2, 3)
    assert full.shape == (30, 30) and full[0, 1:-1].all() and full[-1, 1:-1].all() and 0.02 < full[1:-1].mean() < 0.3
    # one round, cell by cell
    start = np.random.default_rng(7).random((30, 30)) < 0.3
    start[0], start[-1] = True, True
    after = automaton(np.random.default_rng(7), 0.3, 1)
    for row, column in ((1, 1), (5, 0), (12, 29), (17, 8), (29, 3)):
        around = 0
        for i in (row - 1, row, row + 1):
            for j in (column - 1, column, column + 1):
                if (i, j) != (row, column):
                    around += (i < 0 or i > 29) or (0 <= j < 30 and bool(start[i, j]))
        assert after[row, column] == (around >= 5 or (around > 1 and start[row, column])), (row, column)


def test_cylinders_are_where_the_benchmark_has_them():
    full = np.zeros((30, 30), bool)
    full[3, 4] = full[10:13, 10:13] = True
    placed = cylinders_of(full, 1.0)
    assert any(np.allclose(one, (-0.075 - 4.5 + 0.15 * 3, 5.075 + 0.15 * 4, 0.075)) for one in placed)
    assert len(placed) == 1 + 8 + 2 * 33 + 30           # the enclosed cell has none
    full[27:, 5:9] = True           # a wall is closed behind full cells, too
    walls = {(round(x, 3), round(y, 3)) for x, y, _ in cylinders_of(full, 1.0)}
    assert {(round(-4.575 + 0.15 * 29, 3), round(5.075 + 0.15 * column, 3)) for column in range(5, 9)} <= walls
    assert cylinders_of(full, 2.0)[0] == tuple(2.0 * value for value in placed[0])


def test_one_way_connects_any_two_cells_of_a_maze():
    ways = maze.passages(5, np.random.default_rng(3))
    assert len(ways) == 2 * (25 - 1) and {cell for pair in ways for cell in pair} == {
        (x, y) for x in range(5) for y in range(5)}


@pytest.mark.parametrize("values, hindrance", [
    ({"door": 0.6}, "a door"), ({"corridor": 0.7}, "the corridor"),
    ({"room": 2.0, "door": 1.9}, "no wall beside a door")])
def test_an_office_too_narrow_for_the_robot_is_refused(values, hindrance):
    given = dict(defaults("office"), **values)
    assert office.attempt(np.random.default_rng(1), given, RADIUS) is None, hindrance


def test_an_office_is_crossed_from_first_to_last_room():
    text, (start, goal) = generate("office", dict(defaults("office"), rooms=4), 5, 0, RADIUS)
    assert 0.0 < start[0] < 4.0 and 1.0 < start[1] < 5.0
    assert 12.0 < goal[0] < 16.0 and -5.0 < goal[1] < -1.0
    assert shortest_path(obstacle_outlines(read_world(text)), RADIUS, start, goal).length > 10.0


def test_furniture_covers_its_share_and_leaves_the_door_free():
    room, door = (0.0, 1.0, 4.0, 4.0), (2.0, 1.0)
    boxes, chairs = office.furniture(room, door, 1.3, 0.1, np.random.default_rng(3))
    pieces = boxes + [(x, y, 2.0 * r, 2.0 * r) for x, y, r in chairs]
    covered = sum(length * width for _, _, length, width in pieces)
    assert 0.1 * 16.0 <= covered < 0.1 * 16.0 + 1.4 * 0.7
    for x, y, length, width in pieces:
        assert 0.5 * length <= x <= 4.0 - 0.5 * length and 1.0 + 0.5 * width <= y <= 5.0 - 0.5 * width
        beside = max(0.0, abs(x - door[0]) - 0.5 * length), max(0.0, abs(y - door[1]) - 0.5 * width)
        assert np.hypot(*beside) >= 0.65 + 0.5


def test_a_point_without_clearance_is_not_free():
    text, _ = generate("office", dict(defaults("office"), rooms=1), 5, 0, RADIUS)
    obstacles = obstacle_outlines(read_world(text))
    random = np.random.default_rng(1)
    assert parts.free_point((0.0, 1.0, 4.0, 4.0), obstacles, 5.0, random) is None
    x, y = parts.free_point((0.0, 1.0, 4.0, 4.0), obstacles, 0.5, random)
    assert 0.0 < x < 4.0 and 1.0 < y < 5.0
