# SPDX-License-Identifier: BSD-3-Clause
"""Every planner finds paths that are free and not much longer than the shortest one, or says why there is none."""
import math
import re

import numpy as np
import pytest

from m2wr_navigation.planners.sampling_kernels import line_cost
from m2wr_navigation.planners.visibility_kernels import shortest
from planner_grids import RESOLUTION, blocks, costs_along, grid, inflated, planner, pose

#: name: greatest length over the exact optimum, on grids without inflation. Of A* on eight neighbours: sec(pi / 8).
RATIOS = {"NavfnROS": 1.04, "AStar": 1.083, "ThetaStar": 1.02, "GlobalPlanner": 1.04, "RRT": 1.5, "RRTStar": 1.03,
          "InformedRRTStar": 1.02}
SEARCHING = sorted(RATIOS)
SAMPLING = ("RRT", "RRTStar", "InformedRRTStar")
SIZE = 90


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", SEARCHING)
def test_a_path_is_free_and_nearly_as_short_as_the_optimum(name, seed):
    costs = blocks(SIZE, 25, seed)
    costmap, start, goal = grid(costs), pose(1, 1), pose(SIZE - 2, SIZE - 2, 1.0)
    plan = planner(name).plan(costmap, start, goal)
    best = shortest((costs == 254).astype(np.uint8), (1, 1), (SIZE - 2, SIZE - 2))[1] * RESOLUTION
    assert plan.reason == "" and best < math.inf
    assert plan.poses[0, :2] == pytest.approx(start[:2]) and plan.poses[-1] == pytest.approx(goal)
    assert (costs_along(costmap, plan.poses) < 253).all()
    assert best * 0.999 <= plan.length <= best * RATIOS[name]


@pytest.mark.parametrize("name", SEARCHING)
def test_a_path_keeps_away_from_obstacles_where_there_is_room(name):
    costs = np.zeros((60, 60), np.uint8)
    costs[25:35, :30] = 254
    costmap = grid(inflated(costs))
    plan = planner(name).plan(costmap, pose(10, 5), pose(50, 5))
    assert plan.reason == "" and costs_along(costmap, plan.poses).max() < 200


@pytest.mark.parametrize("name", sorted(set(RATIOS) - set(SAMPLING)))
def test_a_path_through_a_maze_may_be_much_longer_than_the_map(name):
    plan = planner(name).plan(grid(maze()), pose(1, 1), pose(59, 30))
    assert plan.reason == "" and plan.length > 10 * 61 * RESOLUTION


@pytest.mark.parametrize("name", SEARCHING + ["CarrotPlanner"])
@pytest.mark.parametrize("start, goal, reason", [
    ((5, 5), (70, 5), "the goal .* is outside of the map"), ((-3, 5), (5, 5), "the start .* is outside of the map"),
    ((5, 5), (math.nan, 5), "expected finite numbers")])
def test_places_outside_of_the_map_are_named(name, start, goal, reason):
    plan = planner(name).plan(grid(np.zeros((60, 60), np.uint8)), pose(*start), pose(*goal))
    assert len(plan.poses) == 0 and re.search(reason, plan.reason), plan.reason


@pytest.mark.parametrize("name", SEARCHING)
@pytest.mark.parametrize("place, cost, reason", [
    ("start", 254, "the start (0.28, 0.28) is in an obstacle"),
    ("goal", 254, "the goal (2.02, 2.02) is in an obstacle"),
    ("goal", 253, "the goal (2.02, 2.02) is so near to an obstacle"), ("goal", 255, "is in unknown space")])
def test_a_blocked_start_or_goal_is_named(name, place, cost, reason):
    costs = np.zeros((60, 60), np.uint8)
    centre = 5 if place == "start" else 40
    costs[centre - 2:centre + 3, centre - 2:centre + 3] = cost
    plan = planner(name, allow_unknown=False).plan(grid(costs), pose(5, 5), pose(40, 40))
    assert reason in plan.reason and len(plan.poses) == 0


@pytest.mark.parametrize("name", SEARCHING)
def test_no_way_through_is_told_with_the_area_that_is_left(name):
    costs = np.zeros((60, 60), np.uint8)
    costs[:, 20] = 254
    plan = planner(name).plan(grid(costs), pose(5, 5), pose(5, 40))
    assert "there is no way through" in plan.reason and "3.0 m^2" in plan.reason


@pytest.mark.parametrize("name", SEARCHING)
def test_with_a_tolerance_the_nearest_reachable_place_will_do(name):
    costs = np.zeros((60, 60), np.uint8)
    costs[38:43, 38:43] = 254
    plan = planner(name).plan(grid(costs), pose(5, 5), pose(40, 40, 0.5), tolerance=0.2)
    assert plan.reason == "" and plan.poses[-1, 2] == 0.5
    assert np.hypot(*(plan.poses[-1, :2] - pose(40, 40)[:2])) == pytest.approx(3 * RESOLUTION)
    assert planner(name).plan(grid(costs), pose(5, 5), pose(40, 40), tolerance=0.1).reason


@pytest.mark.parametrize("name", SEARCHING)
def test_unknown_space_is_crossed_only_if_allowed(name):
    costs = np.zeros((60, 60), np.uint8)
    costs[:, 20:25] = 255
    assert planner(name).plan(grid(costs), pose(5, 5), pose(5, 40)).reason == ""
    assert "no way through" in planner(name, allow_unknown=False).plan(grid(costs), pose(5, 5), pose(5, 40)).reason


@pytest.mark.parametrize("name", SEARCHING)
def test_a_robot_in_an_inscribed_cell_gets_out(name):
    costs = inflated(np.where(np.arange(3600).reshape(60, 60) == 3600 // 2 + 30, 254, 0).astype(np.uint8))
    costmap = grid(costs)
    plan = planner(name).plan(costmap, pose(30, 31), pose(5, 50))
    assert costmap.costs[30, 31] == 253 and plan.reason == ""
    seen = costs_along(costmap, plan.poses)
    assert seen.max() == 253 and (seen[len(seen) // 4:] < 253).all()


@pytest.mark.parametrize("name", SEARCHING)
def test_a_planner_finds_the_same_again_and_on_other_grids(name):
    made = planner(name)
    first = made.plan(grid(blocks(60, 12, 4)), pose(1, 1), pose(58, 58))
    made.plan(grid(blocks(70, 12, 5)), pose(1, 1), pose(60, 50))
    again = made.plan(grid(blocks(60, 12, 4)), pose(1, 1), pose(58, 58))
    assert (first.poses == again.poses).all()


@pytest.mark.parametrize("name", SEARCHING)
def test_start_and_goal_in_one_cell_give_a_path(name):
    plan = planner(name).plan(grid(np.zeros((20, 20), np.uint8)), pose(5, 5), pose(5, 5, 2.0) + [0.01, 0.0, 0.0])
    assert plan.reason == "" and plan.poses[-1].tolist() == [pose(5, 5)[0] + 0.01, pose(5, 5)[1], 2.0]


def test_a_carrot_stops_before_an_obstacle():
    costs = np.zeros((60, 60), np.uint8)
    costs[5, 30:] = 254
    plan = planner("CarrotPlanner").plan(grid(costs), pose(5, 5), pose(5, 50))
    assert plan.poses.shape == (2, 3) and plan.poses[1, 0] == pytest.approx(pose(5, 29)[0], abs=RESOLUTION)
    costs[:] = 254
    assert "is free" in planner("CarrotPlanner").plan(grid(costs), pose(5, 5), pose(5, 50)).reason


@pytest.mark.parametrize("mode, middle", [
    (0, 0.0), (1, 0.5 * math.pi), (2, None), (4, -0.5 * math.pi), (5, 0.0), (6, math.pi)])
def test_the_global_planner_turns_poses_as_asked(mode, middle):
    plan = planner("GlobalPlanner", orientation_mode=mode).plan(
        grid(np.zeros((60, 60), np.uint8)), pose(5, 20, 0.2), pose(50, 20, 0.4))
    yaw = plan.poses[len(plan.poses) // 2, 2]
    assert yaw == pytest.approx(0.3, abs=0.02) if middle is None else math.cos(yaw - middle) > 0.999
    assert plan.poses[-1, 2] == 0.4


def test_the_global_planner_has_four_ways_to_search():
    costs, ways = inflated(blocks(80, 15, 8)), set()
    costs[1, 1] = costs[78, 78] = 0
    for given in ({}, {"use_grid_path": True}, {"use_quadratic": False}, {"use_dijkstra": False}):
        plan = planner("GlobalPlanner", **given).plan(grid(costs), pose(1, 1), pose(78, 78))
        assert plan.reason == ""
        ways.add(round(plan.length, 6))
    assert len(ways) >= 3         # two of them may find paths of the same length


def maze(side=61):
    costs = np.zeros((side, side), np.uint8)
    for k, row in enumerate(range(4, side - 1, 4)):
        costs[row, 3 * (k % 2):side - 3 * ((k + 1) % 2)] = 254
    return costs


@pytest.mark.parametrize("name", SAMPLING)
def test_too_few_samples_are_told(name):
    plan = planner(name, iterations=50).plan(grid(maze()), pose(1, 1), pose(59, 30))
    assert plan.reason.startswith("no path with 50 of 50 samples although start and goal are connected")


@pytest.mark.parametrize("name", SAMPLING)
def test_a_path_from_samples_depends_only_on_the_seed(name):
    costs = blocks(SIZE, 25, 3)
    first, again, other = (planner(name, seed=seed, iterations=800).plan(grid(costs), pose(1, 1), pose(88, 80)).poses
                           for seed in (1, 1, 2))
    assert (first.shape == again.shape) and (first == again).all() and len(first) > 2
    assert other.shape != first.shape or (other != first).any()


@pytest.mark.parametrize("name", ["RRTStar", "InformedRRTStar"])
def test_when_the_time_is_over_the_best_path_so_far_is_taken(name):
    costs, reads = blocks(SIZE, 25, 2), []

    def clock():
        reads.append(None)
        return 0.1 * len(reads)

    ends = grid(costs), pose(1, 1), pose(88, 88)
    short = planner(name, clock, iterations=20000, planning_time=0.55).plan(*ends)
    assert len(reads) == 7                  # the begin, and six batches
    same = planner(name, iterations=6 * 200).plan(*ends)
    assert len(short.poses) > 2 and (short.poses == same.poses).all()
    assert len(planner(name, clock, iterations=1200, planning_time=0.0).plan(*ends).poses) == len(same.poses)


def test_a_search_without_time_says_so():
    ticks = iter(range(100))
    plan = planner("RRT", lambda: float(next(ticks)), planning_time=2.0).plan(grid(maze()), pose(1, 1), pose(59, 30))
    assert plan.reason.startswith("no path with 400 of 5000 samples")


def test_more_samples_give_rrt_star_shorter_paths():
    costs, lengths = blocks(SIZE, 25, 2), []
    for iterations in (300, 1500, 6000):
        made = [planner("RRTStar", seed=seed, iterations=iterations, shortcut=False) for seed in range(5)]
        lengths.append(np.mean([one.plan(grid(costs), pose(1, 1), pose(88, 88)).length for one in made]))
    best = shortest((costs == 254).astype(np.uint8), (1, 1), (88, 88))[1] * RESOLUTION
    assert best < lengths[2] < lengths[1] < lengths[0] and lengths[2] < 1.03 * best


def test_the_ellipse_helps_where_little_of_the_map_matters():
    costs = np.zeros((300, 300), np.uint8)
    costs[130:170, 40] = 254
    ends, lengths = (pose(150, 20), pose(150, 60)), {}
    best = shortest((costs == 254).astype(np.uint8), (150, 20), (150, 60))[1] * RESOLUTION
    for name in ("RRTStar", "InformedRRTStar"):
        made = [planner(name, seed=seed, iterations=2000, shortcut=False) for seed in range(5)]
        lengths[name] = np.mean([one.plan(grid(costs), *ends).length for one in made])
    assert best < lengths["InformedRRTStar"] < 1.02 * best < lengths["RRTStar"]


def test_a_tree_keeps_clear_of_obstacles_if_costs_count():
    costs = np.zeros((80, 80), np.uint8)
    costs[38:42, 20:60] = 254
    costmap = grid(inflated(costs, radius=0.6, scaling=3.0))
    near, far = (planner("InformedRRTStar", cost_factor=factor).plan(costmap, pose(10, 40), pose(70, 40))
                 for factor in (0.0, 2.0))
    assert near.length < far.length
    assert costs_along(costmap, near.poses).max() > costs_along(costmap, far.poses).max()


@pytest.mark.parametrize("ends, cost", [
    ((0.5, 0.5, 9.5, 0.5), 9.0), ((0.5, 0.5, 6.5, 8.5), 10.0 + 1.25), ((0.5, 3.5, 9.5, 3.5), 1.5 + 3.0 * 2.0 + 4.5),
    ((9.5, 3.5, 0.5, 3.5), 1.5 + 3.0 * 2.0 + 4.5), ((0.5, 7.5, 9.5, 7.5), math.inf), ((0.5, 0.5, 0.5, -0.5), math.inf),
    ((2.5, 2.5, 2.5, 2.5), 0.0)])
def test_the_cost_of_a_line_is_its_integral(ends, cost):
    costs = np.zeros((10, 10), np.uint8)
    costs[3, 2:5], costs[7, 9] = 100, 254
    table = np.where(np.arange(256) == 254, np.inf, np.where(np.arange(256) == 100, 2.0, 1.0)).astype(np.float32)
    assert line_cost(costs, table, *ends) == pytest.approx(cost)


def crossing():
    """A wall with a gap of 4 cells in the middle, and one of 12 cells at its far end."""
    costs = np.zeros((60, 60), np.uint8)
    costs[29:31, 12:] = 254
    costs[29:31, 40:44] = 0
    return grid(inflated(costs, inscribed=0.04, scaling=30.0))


@pytest.mark.parametrize("name", sorted(set(RATIOS) - set(SAMPLING)))
@pytest.mark.parametrize("half, crossed", [(0.0, (41, 43)), (0.12, (0, 12))])
def test_a_plan_has_room_for_the_width_on_each_side(name, half, crossed):
    costmap = crossing()
    costmap.beside = half
    before = costmap.costs.copy()
    plan = planner(name).plan(costmap, pose(10, 42), pose(50, 42))
    across = plan.poses[np.argmin(np.abs(plan.poses[:, 1] - 1.5)), 0] / RESOLUTION
    assert plan.reason == plan.remark == "" and crossed[0] - 1 <= across <= crossed[1], across
    assert (costmap.costs == before).all()


@pytest.mark.parametrize("row", [28, 27])
def test_a_goal_in_front_of_a_wall_may_be_nearer_than_the_width(row):
    costmap = crossing()
    costmap.beside = 0.17
    plan = planner("NavfnROS").plan(costmap, pose(10, 20), pose(row, 30))
    assert plan.poses[-1, :2] == pytest.approx(pose(row, 30)[:2]) and plan.remark == ""


def test_a_plan_through_the_only_gap_tells_that_it_is_narrow():
    costmap = crossing()
    costmap.beside = 0.12
    costmap.costs[29:31, :12] = 254
    plan = planner("NavfnROS").plan(costmap, pose(10, 42), pose(50, 42))
    assert len(plan.poses) and plan.remark == "the plan leads through a place that is narrower than the robot, 0.24 m"


def doorway(wide_too):
    """A wall with a gap of 6 cells in the middle and, if wanted, one of 16 cells at its far end."""
    costs = np.zeros((60, 60), np.uint8)
    costs[29:31] = 254
    costs[29:31, 39:45] = 0
    if wide_too:
        costs[29:31, :16] = 0
    costmap = grid(inflated(costs, inscribed=0.2, scaling=30.0))
    costmap.least_clearance = 0.1
    return costmap


@pytest.mark.parametrize("name", sorted(set(RATIOS) - set(SAMPLING)))
def test_a_narrow_way_is_taken_if_there_is_no_other(name):
    for wide_too, crossed in ((True, (3, 13)), (False, (40, 44))):
        costmap = doorway(wide_too)
        before = costmap.costs.copy()
        plan = planner(name).plan(costmap, pose(10, 42), pose(50, 42))
        across = plan.poses[np.argmin(np.abs(plan.poses[:, 1] - 1.5)), 0] / RESOLUTION
        assert plan.reason == "" and crossed[0] <= across <= crossed[1], across
        assert (costmap.costs == before).all()


def test_a_gap_below_the_least_clearance_is_no_way():
    costmap = doorway(False)
    costmap.least_clearance = 0.16
    assert "no way" in planner("NavfnROS").plan(costmap, pose(10, 42), pose(50, 42)).reason
