# SPDX-License-Identifier: BSD-3-Clause
"""Several robots in one world."""
import numpy as np
import pytest

from m2wr_exploration.explorer import PARAMETERS
from m2wr_exploration.registry import find
from m2wr_exploration.study.command import main
from m2wr_exploration.study.scenes import buildings, named
from m2wr_exploration.study.settings import EXPLORER, navigation_parameters
from m2wr_exploration.study.team_run import explore_together, starts
from m2wr_navigation.parameters import read


def together(place, poses, **more):
    kind = find("tour")
    return explore_together(place, poses, [kind(read(kind.PARAMETERS, {}, "")[0]) for _ in poses],
                            read(PARAMETERS, EXPLORER, "")[0], navigation_parameters(), 1, **more)


@pytest.fixture(scope="module")
def house():
    return named("house", 1)


def test_robots_start_apart_from_each_other(house):
    places = np.array(starts(house, 4))[:, :2]
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 9.0 * np.eye(4)
    assert apart.min() >= 1.1


def test_more_robots_than_there_is_room_for_are_told(house):
    with pytest.raises(ValueError, match="of 5000 robots found a place"):
        starts(house, 5000)


def test_no_robot_is_told(house):
    with pytest.raises(ValueError, match="at least one robot"):
        together(house, [])


def test_two_robots_with_one_name_are_told(house):
    with pytest.raises(ValueError, match="two robots have the name anna"):
        together(house, starts(house, 2), names=("anna", "anna"))


def test_unknown_starts_of_one_robot_are_told(capsys):
    with pytest.raises(SystemExit):
        main(["--unknown-starts"])
    assert "--unknown-starts needs --robots" in capsys.readouterr().err


@pytest.mark.parametrize("robots", ["0", "1,x", "17"])
def test_a_number_of_robots_that_cannot_be_used_is_told(robots, capsys):
    with pytest.raises(SystemExit):
        main(["--robots", robots])
    assert "expected numbers from 1 to 16" in capsys.readouterr().err


def test_two_robots_see_a_house_without_a_contact(house):
    run = together(house, starts(house, 2))
    assert run.share >= 0.99 and run.contacts == 0
    assert min(run.lengths) > 2.0               # both have a part of it


def test_robots_that_do_not_know_where_the_other_began():
    place = next(buildings(1, 511))
    poses = [(x, y, heading) for (x, y, _), heading in zip(starts(place, 2), (0.4, -2.7))]
    run = together(place, poses, known=False)
    assert run.share >= 0.99 and run.contacts == 0
    assert run.placed < run.time and run.misplaced < 0.1
    assert any("the map of robot2 lies at" in text for text in run.messages)
