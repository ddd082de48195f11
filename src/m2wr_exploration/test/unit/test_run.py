# SPDX-License-Identifier: BSD-3-Clause
"""Whole explorations in worlds that change while the robot drives: each of them ends, and says what it gave up."""
import re

import numpy as np
import pytest

from m2wr_exploration.explorer import PARAMETERS
from m2wr_exploration.registry import find
from m2wr_exploration.study.run import explore
from m2wr_exploration.study.scenes import place
from m2wr_exploration.study.settings import EXPLORER, navigation_parameters
from m2wr_navigation.parameters import read
from m2wr_sim.api import read_world

BOX = """<collision name="box_{0}"><pose>{1} {2} {5} 0 0 0</pose>
  <geometry><box><size>{3} {4} {6}</size></box></geometry></collision>"""
MODEL = '<model name="{}"><static>1</static><pose>{} {} 0 0 0 0</pose><link name="link">{}</link></model>'
WORLD = """<?xml version="1.0"?><sdf version="1.6"><world name="default">
  <include><uri>model://ground_plane</uri></include>
  <physics type="ode"><max_step_size>0.001</max_step_size></physics>{}</world></sdf>"""
#: Two rooms with a doorway of 1.6 m, and a wall in the right one that hides its end: x, y, length, width [m].
WALLS = ((0.0, 2.0, 8.0, 0.1), (0.0, -2.0, 8.0, 0.1), (-4.0, 0.0, 0.1, 4.0), (4.0, 0.0, 0.1, 4.0),
         (0.0, 1.4, 0.1, 1.2), (0.0, -1.4, 0.1, 1.2), (2.0, -0.9, 0.1, 2.1))
START = (-2.6, 0.0, 0.0)
ASIDE = (0.0, 3.0)          # m: where the door is when it is open
LIMIT = 240.0               # s of simulated time: exploration has to end before it by itself


def shape(number, x, y, length, width, height):
    return BOX.format(number, x, y, length, width, 0.5 * height, height)


def rooms(moved, at):
    walls = "".join(shape(number, *wall, 1.0) for number, wall in enumerate(WALLS))
    return place("rooms", read_world(WORLD.format(MODEL.format("walls", 0.0, 0.0, walls)
                                                  + MODEL.format("moved", at[0], at[1], moved))), START)


def run(world, change=None, **given):
    kind = find("tour")
    values = read(PARAMETERS, dict(EXPLORER, **given), "")[0]
    return explore(world, kind(read(kind.PARAMETERS, {}, "")[0]), values, navigation_parameters(), 1, change, LIMIT)


class Closing:
    """Moves a model into the doorway when the robot drives towards it, and away again after some time."""

    def __init__(self, opens_after):
        self.opens_after, self.closed, self.opened = opens_after, None, False

    def __call__(self, now, sim):
        x = sim.pose("m2wr")[0][0]
        if self.closed is None and -2.5 < x < -0.9:
            self.closed = now
            sim.set_pose((0.0, 0.0, 0.0, 0.0), "moved")
        elif self.closed is not None and not self.opened and now - self.closed > self.opens_after:
            self.opened = True
            sim.set_pose((*ASIDE, 0.0, 0.0), "moved")


PANE = r"\((2\.9|3\.0)"      # the frontier behind the pane, by its x
DOOR, PERSON = shape(0, 0.0, 0.0, 0.08, 1.55, 1.0), shape(0, 0.0, 0.0, 0.4, 0.5, 1.7)


def test_two_rooms_are_seen_whole():
    found = run(rooms(DOOR, ASIDE))
    assert found.share >= 0.99 and found.contacts == 0 and found.ended == "no reachable frontier is left"


@pytest.mark.parametrize("door", [0.7, 1.0])
def test_a_door_in_which_the_robot_cannot_turn_is_passed(door, monkeypatch):
    """The robot is 0.5 m wide, and turns in a disc of 0.86 m. It drives back, too."""
    width = 2.0 - 0.5 * door
    monkeypatch.setattr("test_run.WALLS", (*WALLS[:4], (0.0, 2.0 - 0.5 * width, 0.1, width),
                                           (0.0, 0.5 * width - 2.0, 0.1, width)))
    found = run(rooms(DOOR, ASIDE), return_to_start=True)
    (row, left), (_, right) = found.known.cell(-3.5, 0.0), found.known.cell(3.5, 0.0)
    assert (found.known.costs[row, left:right] == 0).all() and found.contacts == 0, found.messages
    assert np.hypot(*(found.path[-1] - START[:2])) < 0.5 and found.ended == "no reachable frontier is left"


@pytest.mark.parametrize("thing", [DOOR, PERSON], ids=["door", "person"])
def test_what_blocks_the_doorway_is_told_and_waited_for(thing):
    change = Closing(12.0)
    found = run(rooms(thing, ASIDE), change)
    # a corner smaller than min_corner_size is more than 1 % of so small a world
    assert change.opened and found.share >= 0.98 and found.contacts == 0, found.messages
    assert any("has closed" in text for text in found.messages), found.messages


def test_a_door_that_stays_closed_is_given_up_with_the_reason():
    change = Closing(1e9)
    found = run(rooms(DOOR, ASIDE), change)
    assert change.closed is not None and found.time < LIMIT and found.contacts == 0
    assert found.share < 0.9 and "closed" in found.ended, found.messages


def test_a_pane_that_the_laser_does_not_see_is_no_endless_loop():
    """8 cm high: the laser looks over it, the robot cannot pass."""
    found = run(rooms(shape(0, 0.0, 0.0, 0.05, 1.6, 0.08), (0.0, 0.0)), progress_timeout=10.0, tries=2,
                stall_timeout=60.0)
    assert found.time < LIMIT, found.messages
    assert "given up" in found.ended or "has not grown" in found.ended, found.ended
    assert np.isfinite(found.length)


def test_a_frontier_behind_glass_is_named_skipped_and_retried(monkeypatch):
    """The pane of the test above is the nearest frontier; another room, whose end is hidden, is on the other side."""
    more = ((-6.0, 2.0, 4.0, 0.1), (-6.0, -2.0, 4.0, 0.1), (-8.0, 0.0, 0.1, 4.0), (-4.0, 1.4, 0.1, 1.2),
            (-4.0, -1.4, 0.1, 1.2), (-6.0, 0.9, 0.1, 2.1))
    monkeypatch.setattr("test_run.WALLS", tuple(wall for wall in WALLS if wall[:2] != (-4.0, 0.0)) + more)
    monkeypatch.setattr("test_run.START", (-1.2, 0.0, 0.0))
    begun = []

    def watch(now, sim):
        begun.append(now)

    found = run(rooms(shape(0, 0.0, 0.0, 0.05, 1.6, 0.08), (0.0, 0.0)), watch)
    aside = [float(text.split(" s: ")[0]) for text in found.messages if "is set aside" in text]
    named = [text for text in found.messages if "is set aside" in text]
    assert found.time < LIMIT and re.search(PANE, found.ended), found.messages
    assert 2 <= len(named) <= PARAMETERS["tries"].default and all(re.search(PANE, text) for text in named), named
    # what is behind the robot was seen after the first try: the watchdog is on the area that was seen
    seconds = np.linspace(begun[0], begun[-1], len(found.curve))
    grew = seconds[1:][np.diff(np.maximum.accumulate(found.curve[:, 1])) > 1e-3]
    assert grew[-1] > aside[0] and found.share >= 0.98
    assert begun[-1] - grew[-1] < PARAMETERS["stall_timeout"].default and found.path[-1, 0] < 0.0
