# SPDX-License-Identifier: BSD-3-Clause
"""Models that move along way points: actors and plugins; what they push, resets, lockstep, bad tags."""
import math

import pytest

from m2wr_sim.api import Sim
from m2wr_sim.geometry import yaw_of
from m2wr_sim.model.sdf.loader import load_world
from sdf_documents import BOX

GROUND = ('<model name="ground"><static>1</static><link name="l"><collision name="c"><geometry><plane><normal>0 0 1'
          "</normal></plane></geometry></collision></link></model>")
BODY = ('<link name="body"><pose>0 0 0.5 0 0 0</pose><collision name="c"><geometry><cylinder><radius>0.25</radius>'
        "<length>1</length></cylinder></geometry></collision></link>")
POINT = "<waypoint><time>{}</time><pose>{} {} 0 0 0 {}</pose></waypoint>"
WHEEL = '<sdf version="1.6"><world name="w">{}</world></sdf>'


def actor(points, more="", name="a"):
    script = '<script>{}<trajectory id="0" type="t" tension="1">{}</trajectory></script>'.format(
        more, "".join(POINT.format(*point) for point in points))
    return '<actor name="{}">{}{}</actor>'.format(name, BODY, script)


def moved(tags, library="libm2wr_way_points.so", pose="", static="<static>1</static>"):
    return '<model name="a">{}{}{}<plugin name="p" filename="{}">{}</plugin></model>'.format(
        static, pose, BODY, library, tags)


def simulation(*parts, robot=None, pose=(0.0, 0.0, 0.0), **options):
    return Sim(load_world(WHEEL.format(GROUND + "".join(parts)), "a.world"), robot, pose, **options)


def state(sim, name="a"):
    return sim.simulator.models[name].state(sim.simulator.engine)


LINE = ((0, 1, 2, 0), (4, 3, 2, 0), (8, 1, 2, 0))


def smooth(share):
    return share * share * (3.0 - 2.0 * share)


@pytest.mark.parametrize("engine", ["native", "pyode"])
def test_actor_is_where_its_script_says_after_each_step(engine):
    with simulation(actor(LINE), engine=engine) as sim:
        assert state(sim).position == pytest.approx((1.0, 2.0, 0.0))
        for _ in range(30):
            sim.step(None, 0.217)
            share = sim.time % 8.0 / 4.0
            expected = 1.0 + 2.0 * smooth(share if share < 1.0 else 2.0 - share)
            assert state(sim).position == pytest.approx((expected, 2.0, 0.0), abs=1e-3)


def test_velocity_is_that_of_the_motion():
    with simulation(actor(LINE)) as sim:
        sim.step(None, 2.0)
        assert state(sim).linear_velocity == pytest.approx((0.75, 0.0, 0.0), abs=0.01)


def test_delay_holds_the_own_pose_and_one_cycle_ends():
    more = "<delay_start>1</delay_start><loop>false</loop>"
    text = actor(LINE[:2], more).replace('name="a">', 'name="a"><pose>7 7 0 0 0 0</pose>', 1)
    with simulation(text) as sim:
        sim.step(None, 0.99)
        assert state(sim).position == (7.0, 7.0, 0.0)
        sim.step(None, 0.05)
        assert state(sim).position == pytest.approx((1.0, 2.0, 0.0), abs=1e-3)
        sim.step(None, 10.0)
        assert state(sim).position == pytest.approx((3.0, 2.0, 0.0)) and state(sim).linear_velocity == (0.0, 0.0, 0.0)


def test_without_auto_start_it_stays():
    with simulation(actor(LINE, "<auto_start>false</auto_start>")) as sim:
        sim.step(None, 3.0)
        assert state(sim).position == (0.0, 0.0, 0.0)


def test_actors_have_no_contacts_with_what_nothing_moves():
    wall = ('<model name="wall"><static>1</static><pose>2 2 0.5 0 0 0</pose><link name="l"><collision name="c">' + BOX
            + "</collision></link></model>")
    with simulation(actor(LINE), actor(LINE[::2], name="b"), wall) as sim:
        sim.step(None, 4.0)
        assert sim.simulator.contact_counts == {} and state(sim).position[0] == pytest.approx(3.0, abs=1e-3)


def test_actor_pushes_a_robot_and_is_not_slowed():
    with simulation(actor(((0, 1.5, 0, 0), (4, -0.5, 0, 0))), robot="m2wr") as sim:
        contacts = 0
        for _ in range(80):
            contacts += len(sim.step((0.0, 0.0), 0.05).contacts)
        assert contacts > 0 and sim.observe().pose[0] < -0.4
        assert state(sim).position[0] == pytest.approx(-0.5, abs=0.02)


def test_laser_sees_it_where_it_is():
    with simulation(actor(((0, 4, 0, 0), (4, 2, 0, 0))), robot="m2wr", sensing="now") as sim:
        found = [sim.step((0.0, 0.0), 0.5).scan.ranges.min() for _ in range(8)]
        laser = 2.0 - 0.25 - found[-1]              # where the laser is
        expected = [4.0 - 2.0 * smooth(0.125 * (k + 1)) - 0.25 - laser for k in range(8)]
        assert found == pytest.approx(expected, abs=0.03) and 0.0 < laser < 0.3


def test_runs_repeat_to_the_last_bit_and_resets_restart():
    def trace(sim):
        return [(state(sim), sim.step((0.3, 0.2), 0.05).pose) for _ in range(60)]

    with simulation(actor(((0, 1.0, 0.3, 0), (2, 0.4, -0.3, 1), (3, 1.0, 0.3, 0))), robot="m2wr") as sim:
        first = trace(sim)
        sim.reset()
        assert trace(sim) == first
        sim.simulator.reset_world()
        assert state(sim).position == pytest.approx((1.0, 0.3, 0.0))
        sim.step(None, 0.5)
        again = state(sim).position
    with simulation(actor(((0, 1.0, 0.3, 0), (2, 0.4, -0.3, 1), (3, 1.0, 0.3, 0))), robot="m2wr") as sim:
        assert trace(sim) == first
        sim.reset()
        sim.step(None, 0.5)
        assert state(sim).position == pytest.approx(again, abs=1e-3)


def test_short_and_long_calls_give_the_same_motion():
    ends = []
    for duration in (0.001, 0.05, 1.0):
        with simulation(actor(LINE)) as sim:
            for _ in range(int(round(3.0 / duration))):
                sim.step(None, duration)
            ends.append(state(sim))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize("static", ["<static>1</static>", ""])
def test_plugin_moves_a_model_at_one_speed(static):
    tags = "<speed>0.5</speed><waypoint><pose>0 1 0</pose></waypoint><waypoint><pose>2 1 0 0 0 0</pose></waypoint>"
    with simulation(moved(tags, static=static)) as sim:
        sim.step(None, 2.0)
        assert state(sim).position == pytest.approx((1.0, 1.0, 0.0), abs=1e-6)
        assert state(sim).linear_velocity == pytest.approx((0.5, 0.0, 0.0), abs=1e-6)


def test_plugin_takes_times():
    tags = "".join(POINT.format(*point) for point in ((0, 0, 0, 0), (2, 1, 0, 1.0))) + "<loop>false</loop>"
    with simulation(moved(tags)) as sim:
        sim.step(None, 1.0)
        assert state(sim).position == pytest.approx((0.5, 0.0, 0.0), abs=1e-6)
        assert yaw_of(state(sim).orientation) == pytest.approx(0.5, abs=1e-3)


def test_trajectory_plugin_faces_where_it_goes_and_begins_again():
    tags = "<velocity>1</velocity><obstacle>robot</obstacle>" + "".join(
        "<target>{} {} 1 1.57 0 0</target>".format(x, y) for x, y in ((0, 0), (2, 0), (2, 2)))
    with simulation(moved(tags, "libTrajectoryActorPlugin.so")) as sim:
        sim.step(None, 1.0)
        assert state(sim).position == pytest.approx((1.0, 0.0, 0.0), abs=1e-3)
        sim.step(None, 2.3)
        assert state(sim).position == pytest.approx((2.0, 1.0, 0.0), abs=1e-3)
        assert yaw_of(state(sim).orientation) == pytest.approx(0.5 * math.pi, abs=1e-3)
        sim.step(None, 2.3 + 2.0 * math.sqrt(2.0) - 1.0)
        assert state(sim).position[:2] == pytest.approx((0.3, 0.3), abs=0.6)


@pytest.mark.parametrize("library, tags, words", [
    ("libm2wr_way_points.so", "", "there are 0 <waypoint>"),
    ("libm2wr_way_points.so", "<waypoint><pose>0 0 0</pose></waypoint>", "there are 1 <waypoint>"),
    ("libm2wr_way_points.so", 2 * "<waypoint><pose>nan 0 0</pose></waypoint>", "nan 0 0"),
    ("libm2wr_way_points.so", 2 * "<waypoint><pose>1e7 0 0</pose></waypoint>", "at most 1e+06 m"),
    ("libm2wr_way_points.so", 2 * "<waypoint><pose>1 2</pose></waypoint>", "expected x y z or"),
    ("libm2wr_way_points.so", POINT.format(0, 0, 0, 0) + "<waypoint><pose>1 2 3</pose></waypoint>", "points have"),
    ("libm2wr_way_points.so", POINT.format(-1, 0, 0, 0) + POINT.format(2, 0, 0, 0), "is -1; expected 0 to"),
    ("libm2wr_way_points.so", "<speed>0</speed><waypoint><pose>0 0 0</pose></waypoint><waypoint><pose>1 0 0</pose>"
     "</waypoint>", "the speed is 0"),
    ("libm2wr_way_points.so", "<tension>3</tension>" + 2 * "<waypoint><pose>0 0 0</pose></waypoint>", "<tension> is 3"),
    ("libTrajectoryActorPlugin.so", "<target>0 0 0 0 0 0</target>", "there are 1 <target>"),
    ("libTrajectoryActorPlugin.so", "<velocity>inf</velocity>" + 2 * "<target>0 0 0</target>", "<velocity> holds")])
def test_tags_that_cannot_work_are_told(caplog, library, tags, words):
    with simulation(moved(tags, library)) as sim:
        sim.step(None, 0.5)
        assert state(sim).position == (0.0, 0.0, 0.0)
    told, = [record.getMessage() for record in caplog.records if "will not run" in record.getMessage()]
    assert words in told and "a.world" in told


def test_jump_gives_no_velocity_that_hurts():
    with simulation(actor(((0, 0, 0, 0), (0.001, 900000, 0, 0), (5, 900001, 0, 0)))) as sim:
        sim.step(None, 0.5)
        assert max(map(abs, state(sim).linear_velocity)) <= 1e4 and state(sim).position[0] > 800000.0
