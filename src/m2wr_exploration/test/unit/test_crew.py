# SPDX-License-Identifier: BSD-3-Clause
"""Crews on drawn grids: they see everything together; robots that do not answer are named, and others take over."""
from dataclasses import replace

import numpy as np
import pytest

from exploration_grids import World, grid
from m2wr_exploration.crew import BODY, DETOUR_OCCUPANCY, STANDS, Crew
from m2wr_exploration.explorer import DONE, EXPLORING, LOOKED, PARAMETERS, Explorer
from m2wr_exploration.frontiers import look
from m2wr_exploration.registry import find
from m2wr_exploration.team.placing import Placing
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.parameters import read

HALL = """
##############################
#............................#
#............................#
#............................#
#............................#
##############################"""
LONG = 2000             # steps of a second: more than any of these explorations may take
MIDDLE = (7.5, 1.5)


def explorer(**given):
    kind = find("nearest")
    return Explorer(read(PARAMETERS, given, "~")[0], kind(read(kind.PARAMETERS, {}, "")[0]))


def crew(count=2, **given):
    names = ["robot%d" % (number + 1) for number in range(count)]
    return Crew(names, [explorer(**given) for _ in names])


class Run:
    """Robots that are at their goal one second after it was sent, unless they are stuck."""

    def __init__(self, made, world, starts):
        self.crew, self.world = made, world
        self.poses = [np.array([*start, 0.0]) for start in starts]
        self.goals, self.results = [None] * len(starts), [""] * len(starts)
        self.told, self.stuck, self.sent, self.now = [], set(), [[] for _ in starts], 0.0

    def step(self):
        for number, pose in enumerate(self.poses):
            self.world.see(pose[0], pose[1])
            self.crew.see(number, self.now, pose[:2])
        for number, member in enumerate(self.crew.members):
            if not member.fault:
                self.decide(number, member)
        self.now += 1.0

    def decide(self, number, member):
        decision = member.explorer.step(self.now, self.world.known, self.poses[number], self.results[number], "",
                                        self.crew.others(number, self.now))
        self.told += [(number, message) for message in decision.messages]
        self.results[number] = ""
        if decision.goal is not None:
            self.goals[number] = decision.goal
            self.crew.drive(number, self.now, True)
            self.sent[number].append(decision.goal)
        elif decision.cancel:
            self.goals[number], member.driving = None, False
        if self.goals[number] is not None and number not in self.stuck:
            self.poses[number], self.goals[number] = self.goals[number], None
            self.results[number], member.driving = "succeeded", False

    def whole(self):
        for _ in range(LONG):
            self.step()
            if self.crew.ended:
                return
        pytest.fail("exploration does not end: %s" % self.told[-4:])

    def seen(self):
        return (self.world.known.costs[self.world.truth.costs == 0] == 0).all()


def hall(count=2, **given):
    return Run(crew(count, **given), World(HALL), [(7.0 + number, 1.0) for number in range(count)])


def test_two_robots_see_a_hall_from_both_ends():
    run = hall()
    run.whole()
    assert run.seen() and run.crew.summary() == "no reachable frontier is left"
    assert all(run.sent) and min(member.length for member in run.crew.members) > 1.0
    first = [goals[0][0] for goals in run.sent]
    assert (first[0] - MIDDLE[0]) * (first[1] - MIDDLE[0]) < 0.0         # one to each side


def test_a_robot_that_is_lost_is_named_and_the_other_takes_over():
    run = hall()
    run.stuck.add(0)
    run.step()
    place = run.crew.members[0].explorer.target.centre
    told = run.crew.lose(0, run.now, "nothing has come on /robot1/odom for 10 s")
    assert told == ("robot1 takes no part: nothing has come on /robot1/odom for 10 s; its frontier at ({:.2f}, {:.2f}) "
                    "goes to another robot".format(*place))
    run.whole()
    assert run.seen() and len(run.sent[0]) == 1
    assert min(np.hypot(*(goal[:2] - place)) for goal in run.sent[1]) < 4.0
    assert run.crew.summary().endswith("robot1 took no part: nothing has come on /robot1/odom for 10 s")


def test_a_robot_that_is_stuck_leaves_its_frontier_to_the_other():
    run = hall(progress_timeout=5.0)
    run.stuck.add(0)
    run.whole()
    assert run.seen()
    told = [message for number, message in run.told if number == 0 and "came no nearer" in message]
    assert told and "is set aside: the robot came no nearer within 5 s" in told[0]


def test_what_a_teammate_set_aside_it_does_not_bid_for():
    run = hall()
    run.step()
    first = run.crew.members[0].explorer
    first.give_up(run.now, "stuck")
    teammate = run.crew.others(1, run.now)[0]
    assert teammate.target is None and len(teammate.refused) == 1
    frontier = min(first.view.frontiers, key=lambda each: np.hypot(*(each.centre - teammate.refused[0])))
    assert teammate.refuses(frontier)
    later = run.now + first.values["retry_after"]
    assert not run.crew.others(1, later)[0].refuses(frontier)


def test_what_one_robot_has_looked_at_no_other_looks_at():
    run = hall()
    run.step()
    first, second = (member.explorer for member in run.crew.members)
    costmap, frontier = first.view.costmap, first.view.frontiers[0]
    first.aside.add(run.now, costmap, frontier, "could not be reached")
    run.crew.share(0)
    assert second.aside.allows(run.now, frontier)
    entry = first.aside.add(run.now, costmap, frontier, LOOKED)
    run.crew.share(0)
    assert not second.aside.allows(run.now, frontier) and [each.tries for each in second.aside.entries] == [entry.tries]
    again = second.aside.add(entry.until, costmap, frontier, LOOKED)
    assert again.tries == entry.tries + 1
    run.crew.share(0)
    run.crew.share(1)
    assert [each.tries for each in first.aside.entries + second.aside.entries] == [again.tries] * 2


def test_what_a_teammate_gave_is_not_forgotten_because_of_it():
    """The teammate stands beside the frontier, so in this robot's map less is unknown there."""
    run = hall()
    run.step()
    first, second = (member.explorer for member in run.crew.members)
    frontier = first.view.frontiers[0]
    costs = second.view.costmap.costs.copy()
    row, column = (int(value) for value in frontier.cells.mean(axis=0))
    costs[row - 1:row + 2, column - 1:column + 2] = LETHAL
    other = replace(second.view.costmap, costs=costs)
    second.view = replace(second.view, costmap=other)
    first.aside.add(run.now, first.view.costmap, frontier, LOOKED)
    run.crew.share(0)
    assert len(second.aside.entries) == 1 and not second.aside.forget_changed(other)


def test_a_robot_that_is_back_takes_part_again():
    made = crew()
    made.see(1, 0.0, np.array(MIDDLE))
    made.lose(1, 0.0, "silent")
    assert not made.others(0, 0.0)
    assert made.welcome(1) == "robot2 takes part" and len(made.others(0, 0.0)) == 1


def test_without_any_robot_it_ends_and_says_so():
    made = crew()
    for number in range(2):
        made.lose(number, 0.0, "silent")
    assert made.explored and made.ended
    assert made.summary() == "no robot answers; robot1 took no part: silent; robot2 took no part: silent"


def test_only_robots_that_do_not_get_on_are_obstacles():
    known = grid("\n".join(["." * 30] * 20), 0.1)
    made = crew()
    for number, place in enumerate([(0.5, 0.5), (2.05, 1.05)]):
        made.see(number, 0.0, np.array(place))
        made.drive(number, 0.0, True)
    assert not made.occupancy(0, STANDS, known).any()
    drawn = made.occupancy(0, STANDS + 0.1, known)
    rows, columns = np.nonzero(drawn == 100)
    assert drawn[10, 20] == 100 and np.count_nonzero(drawn) == len(rows)
    assert np.hypot(rows - 10.0, columns - 20.0).max() <= BODY / 0.1
    made.see(1, STANDS, np.array([2.3, 1.05]))
    assert not made.occupancy(0, STANDS + 0.1, known).any()


def test_a_robot_that_waits_costs_a_detour():
    known = grid("\n".join(["." * 30] * 20), 0.1)
    made = crew()
    made.see(1, 0.0, np.array([2.05, 1.05]))
    drawn = made.occupancy(0, 100.0, known)
    assert set(np.unique(drawn)) == {0, DETOUR_OCCUPANCY} and drawn[10, 20] == DETOUR_OCCUPANCY
    made.drive(1, 100.0, True)              # it makes room
    assert not made.occupancy(0, 100.0, known).any()
    made.members[1].explorer.state = DONE
    made.drive(1, 100.0, False)
    assert made.occupancy(0, 100.0, known)[10, 20] == 100       # for good


ALLEY = """
########################
#......................#
########.###############
########.###############
########.###############
########################"""


def meeting(first, second):
    """Two robots in a narrow alley, of which all is known but its right end."""
    run = Run(crew(), World(ALLEY, reach=100.0), [first, second])
    run.world.known.costs[:] = run.world.truth.costs
    run.world.known.costs[4, 21:23] = 255
    run.world.see = lambda *_: None
    return run


def test_a_frontier_goes_to_a_robot_that_is_nearer():
    run = meeting((1.25, 2.25), (7.25, 2.25))
    far, near = (member.explorer for member in run.crew.members)
    assert far.step(0.0, run.world.known, run.poses[0]).goal is not None        # before the other one was there
    for number in range(2):
        run.crew.see(number, 0.0, run.poses[number][:2])
    run.decide(1, run.crew.members[1])
    assert near.target is not None and near.looks_at[0] > 9.5
    run.decide(0, run.crew.members[0])
    assert far.target is None and run.goals[0] is None


def test_a_robot_that_waits_makes_room_and_does_not_end():
    """It looked at the frontier already, and stands between it and the other robot."""
    run = meeting((1.25, 2.25), (6.25, 2.25))
    first, second = (member.explorer for member in run.crew.members)
    run.stuck.update((0, 1))
    for now in range(2):
        run.now = float(now)
        for number in range(2):
            run.crew.see(number, run.now, run.poses[number][:2])
        if now == 0:
            view = look(run.world.known, run.poses[1][:2], 0.5)
            second.aside.add(0.0, run.world.known, view.frontiers[0], "a reason")
        for number in range(2):
            run.decide(number, run.crew.members[number])
    assert first.target is not None and second.target is None and second.state == EXPLORING
    column, row = (int(value / 0.5) for value in run.goals[1][:2])
    assert column == 8 and row in (1, 2)            # the side branch
    assert [text for number, text in run.told if number == 1] == [
        "no frontier is left for this robot; it waits for the others"]
    run.poses[1] = run.goals[1]
    run.results[1] = "succeeded"
    run.decide(1, run.crew.members[1])
    assert second.state == EXPLORING and len(run.sent[1]) == 1


def test_a_robot_that_has_ended_claims_its_place():
    made = crew()
    made.see(1, 0.0, np.array(MIDDLE))
    made.members[1].explorer.state = DONE
    assert made.others(0, 0.0)[0].target.tolist() == list(MIDDLE)


def test_robots_that_do_not_know_where_others_are_are_alone():
    names = ["robot1", "robot2"]
    made = Crew(names, [explorer() for _ in names], Placing(names))
    for number in range(2):
        made.see(number, 0.0, np.array(MIDDLE))
    known = grid("\n".join(["." * 30] * 20), 0.1)
    assert made.others(0, 0.0) == [] and not made.occupancy(0, 0.0, known).any()
    assert made.summary().endswith("it is not certain where the maps of robot2 lie on that of robot1")


def test_what_others_do_is_told_in_the_frame_of_each_robot():
    run = hall()
    run.step()
    placing = Placing(["robot1", "robot2"])
    placing.join(0, 1, np.array([1.0, 0.5, np.pi / 2.0]))
    made = Crew(["robot1", "robot2"], [member.explorer for member in run.crew.members], placing)
    made.see(0, 0.0, np.array([1.0, 1.5]))
    made.see(1, 0.0, np.array([0.3, 0.0]))
    teammate, target = made.others(0, 0.0)[0], made.members[1].explorer.target.centre
    assert teammate.place == pytest.approx([1.0, 0.8])
    assert teammate.target == pytest.approx([1.0 - target[1], 0.5 + target[0]])
    assert made.others(1, 0.0)[0].place == pytest.approx([1.0, 0.0])
    drawn = made.occupancy(0, 0.0, grid("\n".join(["." * 30] * 20), 0.1))       # robot2 does not drive
    rows, columns = np.nonzero(drawn)
    assert [0.1 * (columns.mean() + 0.5), 0.1 * (rows.mean() + 0.5)] == pytest.approx([1.0, 0.8], abs=0.06)
    first = made.members[0].explorer
    entry = first.aside.add(0.0, first.view.costmap, first.view.frontiers[0], LOOKED)
    made.share(0)
    taken = made.members[1].explorer.aside.entries[-1]
    back = np.array([1.0, 0.5]) + np.column_stack([-taken.points[:, 1], taken.points[:, 0]])
    assert back == pytest.approx(entry.points) and taken.tries == entry.tries
