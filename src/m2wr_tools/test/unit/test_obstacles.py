# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles: their descriptions, where they may stand, and the commands."""
import math

import numpy as np
import pytest

from m2wr_sim.errors import ModelError
from m2wr_sim.model.sdf.loader import load_sdf
from m2wr_tools.obstacles import commands as obstacle_commands
from m2wr_tools.obstacles import world as obstacle_world
from m2wr_tools.obstacles.obstacle import COLOURS, KINDS, Obstacle, draw, read_colour, read_link, wall
from m2wr_tools.obstacles.world import ObstacleError, Places, outline_of, overlapped_robots
from m2wr_view.outlines import M2WR_FOOTPRINT, footprint_distances, point_distances

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
SIZES = {"box": (1.0, 0.4, 0.6), "cylinder": (0.2, 0.5), "sphere": (0.3,)}


# -- descriptions ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("mass", [None, 3.0])
def test_a_description_is_read_as_what_was_asked_for(kind, mass):
    obstacle = Obstacle(kind, SIZES[kind], mass, COLOURS["red"])
    (model,), _ = load_sdf(obstacle.sdf("thing"), source="obstacle")
    assert model.name == "thing" and model.static == (mass is None)
    link, = model.links
    assert link.pose[0][2] == pytest.approx(0.5 * obstacle.height)      # it stands on the origin
    assert read_link(link.name) == (kind, SIZES[kind])
    shape = link.collisions[0].geometry
    numbers = getattr(shape, "size", None) or tuple(
        getattr(shape, name) for name in ("radius", "length") if hasattr(shape, name))
    assert tuple(numbers) == SIZES[kind]
    assert link.visuals[0].rgba[:3] == pytest.approx(COLOURS["red"], abs=1e-3)
    if mass:
        assert link.inertial.mass == mass


@pytest.mark.parametrize("kind, moments", [
    ("box", (3 * (0.16 + 0.36) / 12, 3 * (1 + 0.36) / 12, 3 * (1 + 0.16) / 12)),
    ("cylinder", (3 * (3 * 0.04 + 0.25) / 12,) * 2 + (0.5 * 3 * 0.04,)), ("sphere", (0.4 * 3 * 0.09,) * 3)])
def test_moments_are_those_of_an_even_body(kind, moments):
    assert Obstacle(kind, SIZES[kind], 3.0)._inertia(3.0) == pytest.approx(moments)


@pytest.mark.parametrize("kind, size, mass, words", [
    ("cone", (1.0,), None, "cone"), ("box", (1.0, 1.0), None, "expected 3"), ("box", (1.0, -1.0, 1.0), None, "width"),
    ("sphere", (0.0,), None, "radius"), ("sphere", (math.nan,), None, "radius"), ("box", (1.0, 1.0, math.inf), None,
                                                                                  "height"),
    ("cylinder", (0.2, 0.5), 0.0, "mass"), ("cylinder", (0.2, 0.5), -1.0, "mass"),
    ("box", (1, 1, 1), math.nan, "mass")])
def test_what_cannot_be_is_named(kind, size, mass, words):
    with pytest.raises(ModelError, match=words):
        Obstacle(kind, size, mass)


@pytest.mark.parametrize("name", ["link_chassis", "obstacle_", "obstacle_box_1_2", "obstacle_cone_1",
                                  "obstacle_box_a_b_c"])
def test_other_links_are_no_obstacles(name):
    assert read_link(name) is None


def test_a_wall_goes_from_one_point_to_the_other():
    size, (x, y), yaw = wall((1.0, 1.0), (1.0, 4.0), 0.2, 0.5)
    assert size == (3.0, 0.2, 0.5) and (x, y) == (1.0, 2.5) and yaw == pytest.approx(math.pi / 2)


def test_colours_by_name_and_by_number():
    assert read_colour("red") == COLOURS["red"] and read_colour("#ff8000") == pytest.approx((1.0, 128 / 255, 0.0))
    for text in ("reddish", "#ff80", "#gggggg", ""):
        with pytest.raises(ModelError, match="#rrggbb"):
            read_colour(text)


def test_random_ones_can_be_and_follow_their_seed():
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    drawn = [draw(one) for _ in range(50)]
    assert drawn == [draw(other) for _ in range(50)] and {obstacle.kind for obstacle in drawn} == set(KINDS)


# -- places ---------------------------------------------------------------------------------------------------------

def test_outlines_cover_what_the_body_covers():
    turned = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
    box = outline_of("box", SIZES["box"], ((2.0, 3.0, 0.0), turned))
    inside, outside = np.array([[2.0, 3.49], [2.19, 3.0]]), np.array([[2.0, 3.51], [2.21, 3.0]])
    assert (point_distances(inside, box) == 0.0).all() and (point_distances(outside, box) > 0.0).all()
    ball = outline_of("sphere", (0.3,), ((0.0, 0.0, 0.0), UPRIGHT))
    assert point_distances(np.array([[0.5, 0.0]]), ball)[0] == pytest.approx(0.2)
    tube = outline_of("cylinder", (0.2, 0.5), ((0.0, 0.0, 0.0), UPRIGHT))
    assert point_distances(np.array([[0.0, 0.5]]), tube)[0] == pytest.approx(0.3)


def test_a_robot_that_is_covered_is_named():
    robots = {"far": ((5.0, 0.0, 0.1), UPRIGHT), "near": ((0.4, 0.0, 0.1), UPRIGHT)}
    box = outline_of("box", (0.5, 0.5, 0.5), ((0.0, 0.0, 0.0), UPRIGHT))
    assert overlapped_robots(box, robots, M2WR_FOOTPRINT) == ["near"]


def make_places(solids=(), seed=0, within=2.0, clearance=0.3):
    robot = ((1.0, 2.0, 0.1), UPRIGHT)
    return Places(robot, list(solids), {"m2wr": robot}, M2WR_FOOTPRINT, clearance, within, np.random.default_rng(seed))


def test_places_are_near_the_robot_clear_of_it_and_of_each_other():
    places, obstacle, placed = make_places(), Obstacle("cylinder", (0.15, 0.5)), []
    for _ in range(6):
        x, y, yaw = places.draw(obstacle)
        assert math.hypot(x - 1.0, y - 2.0) <= 2.0 + 1e-3
        outline = outline_of("cylinder", obstacle.size, ((x, y, 0.0), UPRIGHT))
        assert footprint_distances(np.array([[1.0, 2.0, 0.0]]), outline)[0] >= 0.3
        assert all(math.hypot(x - a, y - b) >= 0.6 - 1e-9 for a, b in placed)
        placed.append((x, y))


def test_another_seed_other_places():
    obstacle = Obstacle("box", (0.2, 0.2, 0.5))
    first = make_places(seed=1).draw(obstacle)
    assert first == make_places(seed=1).draw(obstacle) and first != make_places(seed=2).draw(obstacle)


def test_no_room_is_said():
    wall_around = [outline_of("box", (3.0, 3.0, 1.0), ((1.0, 2.0, 0.0), UPRIGHT))]
    with pytest.raises(ObstacleError, match="no room for a box of 0.2 x 0.2 x 0.5 m within 1 m"):
        make_places(wall_around, within=1.0).draw(Obstacle("box", (0.2, 0.2, 0.5)))


# -- commands -------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("line", [
    "box", "box --at 1", "box --at 1 2 3 4", "box --at 1 2 --near m2wr", "wall --at 1 2", "wall --from 1 2",
    "box --at 1 2 --from 1 2 --to 3 4", "box --at 1 2 --count 3", "box --near m2wr --count 0", "pyramid --at 1 2",
    "box --near m2wr --within 0", "random --near m2wr --size 1 1 1", "box --at 1 2 --static --mass 3",
    "box --near m2wr --yaw 1", "wall --from 0 0 --to 1 1 --size 1 2 3", "box --near m2wr --seed -1"])
def test_misuse_ends_with_two(line, capsys):
    with pytest.raises(SystemExit) as end:
        obstacle_commands.parse("add_obstacle", line.split())
    assert end.value.code == 2 and "usage" in capsys.readouterr().err


@pytest.mark.parametrize("command, line", [("delete_obstacle", ""), ("delete_obstacle", "--all box1"),
                                           ("move_obstacle", "box1"), ("move_obstacle", "box1 --at 1")])
def test_misuse_of_the_others_ends_with_two(command, line):
    with pytest.raises(SystemExit) as end:
        obstacle_commands.parse(command, line.split())
    assert end.value.code == 2


def test_numbers_may_be_negative_and_small():
    given = obstacle_commands.parse("add_obstacle", "box --size 1 0.4 0.6 --at -2 -1e-3 --yaw -1.5".split())
    assert given.at == [-2.0, -0.001] and given.yaw == -1.5


class FakeWorld:
    """A world of names and poses."""

    def __init__(self):
        self.models = {"ground_plane": None, "m2wr": ((0.0, 0.0, 0.1), UPRIGHT)}
        self.added = {}

    def names(self):
        return list(self.models)

    def robots(self):
        return {"m2wr": self.models["m2wr"]}

    def pose(self, name):
        return self.models[name]

    def solids(self):
        return []

    def obstacles(self):
        return {}

    def free_name(self, taken, stem="obstacle"):
        return next("%s%d" % (stem, k) for k in range(1, 99) if "%s%d" % (stem, k) not in taken)

    def add(self, obstacle, position, yaw=0.0, name=""):
        name = name or self.free_name(self.models)
        self.models[name], self.added[name] = (position, UPRIGHT), (obstacle, position, yaw)
        return name


def run_add(line):
    world = FakeWorld()
    obstacle_commands.add_obstacle(obstacle_commands.parse("add_obstacle", line.split()), world)
    return world.added


@pytest.fixture(autouse=True)
def footprint(monkeypatch):
    monkeypatch.setattr(obstacle_world, "robot_footprint", lambda: M2WR_FOOTPRINT)
    monkeypatch.setattr(obstacle_commands, "start_to_listen", lambda: None)


def test_three_near_the_robot(capsys):
    added = run_add("box --size 0.3 0.3 0.4 --near m2wr --count 3 --seed 5 --name block --mass 2")
    assert sorted(added) == ["block1", "block2", "block3"] and len({place for _, place, _ in added.values()}) == 3
    assert all(obstacle.mass == 2.0 for obstacle, _, _ in added.values())
    assert capsys.readouterr().out.count("2 kg") == 3


def test_a_wall_between_two_points():
    (obstacle, place, yaw), = run_add("wall --from 0 2 --to 4 2 --size 0.2 0.5").values()
    assert obstacle.size == (4.0, 0.2, 0.5) and place == (2.0, 2.0, 0.0) and yaw == 0.0


def test_one_that_stands_in_the_robot_is_warned_of(capsys):
    run_add("box --at 0.3 0")
    assert "overlaps the robot m2wr" in capsys.readouterr().err
    run_add("box --at 3 0")
    assert capsys.readouterr().err == ""


def test_an_unknown_robot_is_named():
    with pytest.raises(ObstacleError, match='no model "ghost"; in the world are ground_plane, m2wr'):
        run_add("box --near ghost")


def test_without_a_master_it_says_what_to_start(monkeypatch, capsys):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    assert obstacle_commands.main("add_obstacle", ["add_obstacle", "box", "--at", "1", "2"]) == 1
    assert "no ROS master at http://127.0.0.1:1" in capsys.readouterr().err
