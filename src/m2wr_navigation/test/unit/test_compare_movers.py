# SPDX-License-Identifier: BSD-3-Clause
"""Worlds with obstacles that move: the same for a seed, shipped ones, what a comparison measures in them."""
import re
from dataclasses import replace

import numpy as np
import pytest

from m2wr_navigation.compare import command, plaza
from m2wr_navigation.compare.comparison import Comparison
from m2wr_navigation.compare.drive import M2WR_ROBOT, drive
from m2wr_navigation.compare.movers import Watch, least_start_distance, movers_of
from m2wr_navigation.compare.scenes import generated, given
from m2wr_navigation.methods.method import Decision
from m2wr_sim.api import Sim, read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import FLOOR, M2WR_FOOTPRINT, ROBOT_HEIGHT, point_distances

RADIUS = 0.45
WORLD = '<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>{}</world></sdf>'
ACTOR = """<actor name="a"><link name="body"><pose>0 0 {} 0 0 0</pose><collision name="c"><geometry><cylinder>
<radius>0.25</radius><length>1</length></cylinder></geometry></collision></link><script><trajectory id="0" type="t"
tension="1"><waypoint><time>0</time><pose>3 0 0 0 0 0</pose></waypoint><waypoint><time>6</time><pose>{} 0 0 0 0 0</pose>
</waypoint></trajectory></script></actor>"""


@pytest.mark.parametrize("count", [5, 20, 50])
def test_generated_worlds_have_movers_that_keep_away_from_walls(count):
    scene, = generated(1, 3, RADIUS, count)
    assert scene == next(generated(2, 3, RADIUS, count)) and scene.name == "{} moving, 0".format(count)
    world = read_world(scene.world)
    assert world.notes == () and world.remarks == ()
    movers, obstacles = movers_of(world, FLOOR, ROBOT_HEIGHT), obstacle_outlines(world)
    assert len(movers) == count and not {mover.name for mover in movers} & {one.name for one in obstacles}
    for mover in movers:
        gap = min(point_distances(mover.path, one).min() for one in obstacles)
        assert gap > plaza.RADIUS and np.allclose(mover.path[0], mover.path[-1], atol=2e-3)
        steps = np.hypot(*np.diff(mover.path, axis=0).T)
        assert steps.max() / 0.2 < 1.6 * plaza.FAST
    assert least_start_distance(movers, np.array([scene.start[:2]]))[0] > plaza.FREE


@pytest.mark.parametrize("count", [5, 20, 50])
def test_shipped_worlds_are_those_of_the_generator(count):
    made = read_world(next(generated(1, 0, RADIUS, count)).world)
    shipped = read_world("moving_{:02d}".format(count))
    assert shipped.models == made.models and len(movers_of(shipped, FLOOR, ROBOT_HEIGHT)) == count


def test_a_given_world_starts_away_from_its_movers():
    scene = given("moving_50", 4, RADIUS)
    movers = movers_of(read_world("moving_50"), FLOOR, ROBOT_HEIGHT)
    assert least_start_distance(movers, np.array([scene.start[:2]]))[0] > plaza.FREE


def test_too_many_are_told(capsys, monkeypatch):
    monkeypatch.setattr(plaza, "TRIES", 100)
    with pytest.raises(ValueError, match="no room for 200 moving obstacles"):
        plaza.actors(200, np.random.default_rng(0), obstacle_outlines(read_world("world02")), (0.0, 0.0))
    with pytest.raises(SystemExit):
        command.main(["--worlds", "1", "--moving", "201"])
    assert "--moving 201; expected 0 to 200" in capsys.readouterr().err


def test_contact_with_a_robot_that_waits_is_counted():
    run = drive(read_world(WORLD.format(ACTOR.format(0.5, -1))), (0.0, 0.0, 0.0), lambda _: Decision(0.0, 0.0), 5.0)
    assert run.contacts > 0 and run.moving_clearance < 0.01 and run.outcome == "time out"
    assert run.met == run.struck == 1
    run = drive(read_world(WORLD.format(ACTOR.format(0.5, 2))), (0.0, 0.0, 0.0), lambda _: Decision(0.0, 0.0), 6.5)
    front = max(float(part.vertices[:, 0].max()) + part.radius for part in M2WR_FOOTPRINT)
    assert run.contacts == 0 and run.moving_clearance == pytest.approx(2.0 - 0.25 - front, abs=0.02)


@pytest.mark.parametrize("begin, end, struck", [(1.0, 1.3, False), (3.0, 0.0, True), (1.2, 1.2, False)])
def test_who_closes_the_gap_faster_has_run_into_the_other(begin, end, struck):
    """The robot drives at 0.3 m/s; the obstacle flees at 0.05 m/s, comes at 0.5 m/s, or stands."""
    world = read_world(WORLD.format(ACTOR.format(0.5, end).replace("<pose>3 0 0 0", "<pose>%g 0 0 0" % begin)))
    met = []

    def until_they_meet(result):
        met.extend(result.contacts)
        return Decision(0.3, 0.0, "reached" if met else "running")

    run = drive(world, (0.0, 0.0, 0.0), until_they_meet, 6.0)
    assert run.contacts > 0 and (run.met, run.struck) == (1, int(struck))


def test_only_the_heights_of_the_robot_count():
    high = read_world(WORLD.format(ACTOR.format(2.0, -1)))
    movers = movers_of(high, FLOOR, ROBOT_HEIGHT)
    assert movers[0].outlines == () and len(movers_of(high, FLOOR, 1.6)[0].outlines) == 1
    shelf = ('<model name="shelf"><static>1</static><pose>2 0 0.5 0 0 0</pose><link name="l"><collision name="c">'
             "<geometry><box><size>1 4 0.2</size></box></geometry></collision></link></model>")
    world = WORLD.format(shelf)
    low = Comparison(world, (0.0, 0.0, 0.0), (4.0, 0.0))
    assert low.obstacles == [] and low.optimum.length == pytest.approx(4.0, abs=0.1)
    tall = M2WR_ROBOT.__class__("m2wr", replace(M2WR_ROBOT.body, height=0.5))
    assert Comparison(world, (0.0, 0.0, 0.0), (4.0, 0.0), robot=tall).optimum.length > 5.0


def test_watch_measures_only_what_is_near():
    with Sim(read_world(WORLD.format(ACTOR.format(0.5, 3.1)))) as sim:
        watch = Watch(movers_of(sim.world, FLOOR, ROBOT_HEIGHT), M2WR_FOOTPRINT)
        watch.look(sim, (-10.0, 0.0, 0.0))
        assert watch.least == np.inf
        watch.look(sim, (2.0, 0.0, 0.0))
        assert 0.0 < watch.least < 0.75


def test_page_shows_where_they_move(tmp_path):
    out = tmp_path / "page.html"
    assert command.main(["--worlds", "1", "--moving", "3", "--seed", "1", "--methods", "follow_the_gap", "--limit", "5",
                         "--workers", "1", "--out", str(out)]) == 0
    assert len(re.findall("class=mover", out.read_text())) == 6
