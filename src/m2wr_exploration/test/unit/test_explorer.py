# SPDX-License-Identifier: BSD-3-Clause
"""Explorations on drawn grids: they see everything, and they end whatever happens."""
import numpy as np
import pytest

from exploration_grids import World, grid
from m2wr_exploration.explorer import DONE, EXPLORING, LOOKED, PARAMETERS, RETURNING, Explorer, Teammate
from m2wr_exploration.frontiers import Frontier, View
from m2wr_exploration.registry import find
from m2wr_navigation.parameters import read

HOUSE = """
####################
#........#.........#
#........#.........#
#..................#
#........#.........#
####.#########.#####
#..................#
#..................#
####################"""
START = (1.25, 3.25, 0.0)
LONG = 5000             # steps of a second: more than any of these explorations may take


def explorer(**given):
    kind = find("nearest")
    values, warnings = read(PARAMETERS, given, "~")
    assert not warnings
    return Explorer(values, kind(read(kind.PARAMETERS, {}, "")[0]))


def run(made, world, answer=lambda goal: "succeeded", moves=True):
    """Explore; the robot is at its goal one second after it was sent. Return decisions and the pose."""
    pose, decisions, result, goal = np.array(START), [], "", None
    for now in range(LONG):
        world.see(pose[0], pose[1])
        decision = made.step(float(now), world.known, pose, result, "a reason" if result == "aborted" else "")
        decisions.append(decision)
        if decision.state == DONE:
            return decisions, pose
        goal = decision.goal if decision.goal is not None else (None if decision.cancel else goal)
        result = "" if goal is None else answer(goal)
        if result == "succeeded" and moves:
            pose = goal
        if result:
            goal = None
    pytest.fail("exploration does not end: %s" % [decision.messages for decision in decisions[-3:]])


def texts(decisions):
    return [message for decision in decisions for message in decision.messages]


def test_a_house_is_seen_whole():
    world, made = World(HOUSE), explorer()
    run(made, world)
    free = world.truth.costs == 0
    assert (world.known.costs[free] == 0).all() and made.summary == "no reachable frontier is left"


def test_aborted_goals_are_told_tried_again_and_given_up():
    world, made = World(HOUSE), explorer(retry_after=10.0, tries=2)
    decisions, _ = run(made, world, lambda goal: "aborted")
    told = texts(decisions)
    assert any("could not be reached: a reason" in text for text in told)
    assert any("they will be tried again" in text for text in told)
    assert "given up" in told[-1] and "a reason" in told[-1]


def end_of_a_wall(goal, beside, path=1.4):
    """A view of one frontier, the end of a wall, with the goal."""
    costmap = grid("\n".join(["." * 10] * 10))
    cell = costmap.cell(*goal)
    points = np.array([(2.75, 3.25), (2.75, 3.75)])
    distance = np.full(costmap.shape, path, np.float32)
    target = Frontier(costmap.cells(points), points, points.mean(axis=0), np.array(goal), cell, 1.0, 1.0, path, beside)
    return View(costmap, costmap, np.array([2.75, 1.25]), distance, [target])


LEFT, RIGHT, AHEAD = (1.25, 2.75), (4.25, 2.75), (3.25, 2.75)


def goals_for(monkeypatch, views):
    """Return the goals that are sent for some views in turn, one each second."""
    made, goals = explorer(), []
    for now, view in enumerate(views):
        monkeypatch.setattr("m2wr_exploration.explorer.look", lambda *_, found=view: found)
        goal = made.step(float(now), view.costmap, np.array((2.75, 1.25, 1.5))).goal
        goals.append(None if goal is None else tuple(goal[:2].tolist()))
    return goals


def test_a_place_to_look_from_is_kept_and_one_beside_moves(monkeypatch):
    assert goals_for(monkeypatch, 3 * [end_of_a_wall(LEFT, False), end_of_a_wall(RIGHT, False)]) == [LEFT] + [None] * 5
    assert goals_for(monkeypatch, 3 * [end_of_a_wall(LEFT, True), end_of_a_wall(RIGHT, True)]) == 3 * [LEFT, RIGHT]


def test_a_place_that_is_much_farther_or_closed_is_not_kept(monkeypatch):
    nearer, closed = end_of_a_wall(AHEAD, False, 0.8), end_of_a_wall(RIGHT, False)
    nearer.distance[:] = 1.4
    closed.distance[closed.costmap.cell(*LEFT)] = np.inf
    assert goals_for(monkeypatch, [end_of_a_wall(LEFT, False), nearer]) == [LEFT, AHEAD]
    assert goals_for(monkeypatch, [end_of_a_wall(LEFT, False), closed]) == [LEFT, RIGHT]


def test_a_robot_that_does_not_move_is_noticed():
    world, made = World(HOUSE), explorer(progress_timeout=5.0, retry_after=1.0)
    decisions, _ = run(made, world, lambda goal: "")
    assert any("came no nearer within 5 s" in text for text in texts(decisions))


def test_a_way_around_a_wall_is_progress():
    """The frontier is just behind a wall; the only way to it leads 9 m away at first."""
    world = grid("\n".join(["#" * 22, "#?" + "." * 19 + "#", "#" * 20 + ".#", "#" + "." * 20 + "#", "#" * 22]))
    made = explorer(progress_timeout=3.0, min_frontier_size=0.0)
    told, columns = [], list(range(3, 20)) + [20, 20] + list(range(20, 3, -1))
    rows = [1] * 17 + [2] + [3] * 18
    for now, (row, column) in enumerate(zip(rows, columns)):
        decision = made.step(float(now), world, np.array((*world.centre(row, column), 0.0)))
        told.extend(decision.messages)
    assert made.target is not None and told == []


def test_ways_that_close_again_and_again_are_no_progress(monkeypatch):
    view = end_of_a_wall(LEFT, True)
    made, told = explorer(progress_timeout=5.0), []
    monkeypatch.setattr("m2wr_exploration.explorer.look", lambda *_: view)
    for now in range(60):
        view.distance[:] = 3.0 + 4.0 * (now // 4 % 2)           # a way of 3 m, one of 7 m, and so on
        told += made.step(float(now), view.costmap, np.array((2.75, 1.25, 1.5))).messages
        if told:
            break
    assert "came no nearer within 5 s" in told[0] and 20 < now < 40


def test_frontiers_that_show_nothing_new_are_set_aside():
    world, made = World(HOUSE), explorer(retry_after=1.0)
    decisions, _ = run(made, world, moves=False)
    assert any("shows nothing new" in text for text in texts(decisions))


def test_a_robot_that_has_arrived_waits_for_the_map():
    """The map of what is seen from a goal comes two seconds later than the robot."""
    world, made, late = World(HOUSE), explorer(look_time=3.0), []
    see = world.see

    def later(x, y):
        late.append((x, y))
        see(*late[max(0, len(late) - 3)])

    world.see = later
    decisions, _ = run(made, world)
    assert not any("set aside" in text for text in texts(decisions))
    assert (world.known.costs[world.truth.costs == 0] == 0).all()


HOLE = "\n".join(["#" * 40] + ["#" + "." * 38 + "#"] * 28 + ["#" * 40])


def holed(shave):
    """Let a robot explore round a hole in a map, of which so many cells more are seen from each goal."""
    world, made = World(HOLE, resolution=0.25), explorer(retry_after=1e6)
    rows, columns = np.mgrid[:30, :40]
    away = np.hypot(rows - 15, columns - 20)
    world.known.costs[:] = np.where(away < 8, 255, world.truth.costs)
    radius = [8.0]

    def answer(goal):
        radius[0] -= shave
        return "succeeded"

    world.see = lambda x, y: world.known.costs.__setitem__(away >= radius[0], world.truth.costs[away >= radius[0]])
    return run(made, world, answer)[0], world


def test_a_hole_that_shrinks_is_looked_at_again():
    """Its middle, and so the place of its frontier, stays where it is."""
    decisions, world = holed(1.0)
    assert not any("set aside" in text for text in texts(decisions))
    assert np.count_nonzero(world.known.costs == 255) < 8       # smaller than the smallest frontier, of 200 at first


def test_a_hole_that_stays_is_tried_again_without_a_pause():
    """Only time opens a door, but a sensor sees no more after a pause of ``retry_after``, 1e6 s."""
    decisions, _ = holed(0.0)
    tries = [text for text in texts(decisions) if "shows nothing new" in text and "set aside" in text]
    assert len(tries) == 3 and len(decisions) < 60


def test_exploration_ends_although_frontiers_come_and_go():
    """A map whose unknown cells change at random, as behind glass: only the known area tells that nothing is found."""
    world, made = World(HOUSE), explorer(stall_timeout=60.0, retry_after=1.0, tries=100)
    random = np.random.default_rng(1)
    see = world.see

    def flicker(x, y):
        see(x, y)
        world.known.costs[random.integers(1, 8, 12), random.integers(1, 19, 12)] = 255

    world.see = flicker
    decisions, _ = run(made, world)
    assert "has not grown for stall_timeout" in made.summary


def test_a_door_that_opens_is_explored():
    """The goal behind it is aborted once; the map around it changes later."""
    world, made = World(HOUSE), explorer(retry_after=1e6, tries=2)
    aborted, see = [], world.see

    def answer(goal):
        if not aborted and goal[1] < 2.0:
            aborted.append(goal)
            return "aborted"
        return "succeeded"

    def changing(x, y):
        see(x, y)
        if len(aborted) == 1 and made.aside.entries:
            aborted.append(None)
            world.known.costs[:4, 4:] = world.truth.costs[:4, 4:]

    world.see = changing
    decisions, _ = run(made, world, answer)
    assert any("has changed: it may be explored again" in text for text in texts(decisions))
    assert (world.known.costs[world.truth.costs == 0] == 0).all()


def test_what_is_too_far_away_is_not_explored():
    world, made = World(HOUSE), explorer(max_distance=3.0)
    decisions, _ = run(made, world)
    assert any("max_distance" in text for text in texts(decisions))
    assert all(np.hypot(*(decision.goal[:2] - np.array(START[:2]))) <= 3.0
               for decision in decisions if decision.goal is not None)


def test_the_limit_of_time_is_told():
    made = explorer(time_limit=3.0)
    run(made, World(HOUSE, reach=1.0))
    assert made.summary == "time_limit of 3 s is over"


def test_the_robot_returns_to_where_it_began():
    decisions, pose = run(explorer(return_to_start=True), World(HOUSE))
    assert pose == pytest.approx(START) and "back at its start" in texts(decisions)[-1]
    assert any(decision.state == RETURNING for decision in decisions)


def test_no_robot_ends_while_a_teammate_will_try_again():
    """It would stand in the way of the other one, and make no room."""
    world, made = World(HOUSE), explorer()
    world.known.costs[:] = world.truth.costs
    waits = [Teammate(np.array([1.5, 1.0]), retries=True)]
    for now in range(20):
        assert made.step(float(now), world.known, np.array(START), others=waits).state == EXPLORING
    gone = [Teammate(np.array([1.5, 1.0]))]
    assert [made.step(now, world.known, np.array(START), others=gone).state for now in (20.0, 30.0)][-1] == DONE


@pytest.mark.parametrize("together", [True, False])
def test_in_a_team_a_robot_looks_until_the_merged_map_shows_it(together):
    """It turned back where its own costmap showed a hole; this was a frontier of the next robot, and of the next."""
    world, made, far = World(HOUSE), explorer(look_time=3.0), np.array((8.25, 0.75))
    world.see(*START[:2])
    others = [Teammate(far, far, goal=far)] if together else []

    def step(now, costmap, known, result=""):
        return made.step(now, costmap, np.array(START), result, others=others, known=known)

    assert step(0.0, world.known, world.known).goal is not None
    target = made.target.centre
    for now in (1.0, 2.0):
        step(now, world.truth, world.known)
        assert (made.target is not None) == together
    if together:
        assert made.target.centre == pytest.approx(target)
        assert not step(3.0, world.truth, world.known, "succeeded").messages and made.target is not None
        assert LOOKED in step(7.0, world.truth, world.known).messages[0]    # the map keeps the hole: it tells others
        assert [entry.reason for entry in made.aside.entries] == [LOOKED]


def test_in_a_team_a_robot_looks_no_longer_than_that():
    world, made, far = World(HOUSE), explorer(), np.array((8.25, 0.75))
    world.see(*START[:2])
    made.step(0.0, world.known, np.array(START), others=[Teammate(far, far, goal=far)], known=world.known)
    made.step(1.0, world.truth, np.array(START), others=[Teammate(far, far, goal=far)], known=world.truth)
    assert made.target is None


def test_a_frontier_that_no_teammate_takes_is_not_left_again(monkeypatch):
    """Maps of robots differ, so each may take another one for nearer: four waited for each other without an end."""
    view, made = end_of_a_wall(AHEAD, False), explorer()
    monkeypatch.setattr("m2wr_exploration.explorer.look", lambda *_: view)
    nearer, pose = Teammate(np.array(AHEAD)), np.array((2.75, 1.25, 1.5))
    first = made.step(0.0, view.costmap, pose, others=[nearer])
    assert first.goal is None and "this one waits" in first.messages[-1]
    assert tuple(made.step(1.0, view.costmap, pose, others=[nearer]).goal[:2]) == AHEAD


def test_a_frontier_that_a_teammate_takes_is_left(monkeypatch):
    view, made = end_of_a_wall(AHEAD, False), explorer()
    monkeypatch.setattr("m2wr_exploration.explorer.look", lambda *_: view)
    place, centre = np.array(AHEAD), view.frontiers[0].centre
    for now, mate in enumerate([Teammate(place)] + 3 * [Teammate(place, centre, goal=place)]):
        assert made.step(float(now), view.costmap, np.array((2.75, 1.25, 1.5)), others=[mate]).goal is None


def test_a_robot_that_will_try_again_says_so():
    made, world = explorer(retry_after=50.0, tries=2), World(HOUSE)
    world.see(*START[:2])
    said = [(made.step(float(now), world.known, np.array(START), "aborted" if now else ""), made.retries)
            for now in range(40)]
    assert said[-1][1] and said[-1][0].state == EXPLORING and not said[0][1]


def test_a_return_that_fails_ends_too():
    sent = []

    def answer(goal):
        sent.append(goal)
        return "aborted" if np.allclose(goal, START) else "succeeded"

    decisions, _ = run(explorer(return_to_start=True), World(HOUSE), answer)
    assert "did not get back" in texts(decisions)[-1]


def test_a_map_that_shrinks_is_no_error():
    world, made = World(HOUSE), explorer()
    world.see(*START[:2])
    made.step(0.0, world.known, np.array(START))
    small = World("...\n...\n...", resolution=1.0)
    small.see(1.5, 1.5)
    decision = made.step(1.0, small.known, np.array([1.5, 1.5, 0.0]))
    assert decision.state != DONE


def test_a_robot_between_two_equal_frontiers_keeps_its_goal():
    world, made = World("#" * 21 + "\n#" + "." * 19 + "#\n" + "#" * 21, reach=2.0), explorer()
    pose, goals = np.array([5.25, 0.75, 0.0]), []
    for now in range(12):
        world.see(5.25, 0.75)                   # the robot turns to and fro, and sees nothing new
        decision = made.step(float(now), world.known, pose)
        goals += [] if decision.goal is None else [tuple(decision.goal[:2])]
        pose = pose + np.array([0.02 if now % 2 else -0.02, 0.0, 0.0])
    assert len(goals) == 1


def test_a_robot_in_a_narrow_place_is_not_at_the_end():
    """The place at the left is too narrow for the robot, which has come from the right; there is more to see there."""
    world = World("""
####################
#...############...#
#...............?..#
#...############...#
####################""", resolution=0.2)
    made = explorer(robot_radius=0.25, min_frontier_size=0.0)
    costmap = world.truth
    assert made.step(0.0, costmap, np.array([3.5, 0.5, 0.0])).goal is not None
    made.target = None
    narrow = made.step(1.0, costmap, np.array([1.5, 0.5, 0.0]), "aborted")
    for now in range(2, 12):
        narrow = made.step(float(now), costmap, np.array([1.5, 0.5, 0.0]))
        assert narrow.state != DONE


#: Two rooms in cells of 0.8 m, with a door of 2.4 m: a disc of 2 m radius does not fit through it.
DOOR = """
################################
#............#.........????????#
#............#.........????????#
#......................????????#
#......................????????#
#......................????????#
#............#.........????????#
#............#.........????????#
################################"""


def narrow_explorer(**given):
    return explorer(robot_radius=2.0, least_clearance=0.8, min_frontier_size=0.0, **given)


def test_a_narrow_way_is_taken_when_nothing_else_is_left():
    world, pose = grid(DOOR, 0.8), np.array([4.8, 3.6, 0.0])
    assert explorer(robot_radius=2.0, min_frontier_size=0.0).step(0.0, world, pose).goal is None
    goal = narrow_explorer().step(0.0, world, pose).goal
    assert goal is not None and goal[0] > 12.0
    world.costs[3:6, 1:3] = 255         # something to see on this side of the door
    assert narrow_explorer().step(0.0, world, pose).goal[0] < 8.0


def test_a_frontier_behind_a_narrow_way_is_tried_once():
    world, made = grid(DOOR, 0.8), narrow_explorer(retry_after=0.0)
    pose, told = np.array([4.8, 3.6, 0.0]), []
    made.step(0.0, world, pose)
    for now in range(1, 20):
        decision = made.step(float(now), world, pose, "aborted" if now == 1 else "", "a reason")
        told += decision.messages
        assert decision.goal is None
        if decision.state == DONE:
            break
    assert "could not be reached: a reason" in told[0] and "given up" in told[-1]


def test_a_narrow_way_does_not_count_as_closed():
    """A robot in the far room can reach the near one on a narrow way."""
    world, made = grid(DOOR, 0.8), narrow_explorer()
    made.step(0.0, world, np.array([4.8, 3.6, 0.0]))
    world.costs[world.costs == 255] = 0
    decisions = [made.step(float(now), world, np.array([20.0, 3.6, 0.0])) for now in range(1, 10)]
    assert texts(decisions) == ["exploration ended: no reachable frontier is left"]
