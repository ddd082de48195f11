# SPDX-License-Identifier: BSD-3-Clause
"""Invalid numbers are refused with their limits or handled in a defined way; no state becomes nan or infinite."""
import logging
import math
from dataclasses import replace

import pytest

from conftest import at
from m2wr_sim.api import Sim
from m2wr_sim.errors import ModelError, SimError, WorldError
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.physics.engine import whole_step
from m2wr_sim.ros.loop import Loop
from m2wr_sim.runtime.schedule import misfit

MS = 1000000


def numbers_of(rig, models):
    """Return everything that is known and was published of some models, as one list of numbers."""
    found = []
    for name in models:
        for link in rig.simulator.models[name].handle.links.values():
            for part in rig.engine.link_state(link):
                found.extend(part)
    for topic, port in rig.ports.topics.items():
        for message in port.messages:
            if topic.endswith("odom"):
                pose, twist = message.pose.pose, message.twist.twist
                found += [pose.position.x, pose.position.y, pose.position.z, pose.orientation.x, pose.orientation.y,
                          pose.orientation.z, pose.orientation.w, twist.linear.x, twist.linear.y, twist.angular.z]
            elif topic.endswith("joint_states"):
                found += list(message.position) + list(message.velocity)
            elif topic.endswith("scan"):
                found += [value for value in message.ranges if value != math.inf]
    for _, _, _, position, orientation in rig.ports.transforms:
        found += list(position) + list(orientation)
    return found


# ---- steps and rates ---------------------------------------------------------------------------------------------

@pytest.mark.parametrize("step", [0.0, -0.001, 1e-6, 0.11, 1.0, math.inf, math.nan])
def test_a_step_out_of_bounds_is_rejected_with_the_bounds(step):
    with pytest.raises(WorldError, match=r"a.world: physics step of .* s; expected 1e-05 to 0.1 s"):
        whole_step(step, "a.world")
    if math.isfinite(step):
        with pytest.raises(WorldError, match="expected 1e-05 to 0.1 s"):
            Sim("empty", step=step)


@pytest.mark.parametrize("step, ns, warned", [(1e-5, 10000, False), (0.001, MS, False), (0.02, 20 * MS, False),
                                              (0.021, 21 * MS, True), (0.1, 100 * MS, True)])
def test_a_long_step_is_taken_with_a_warning(step, ns, warned, caplog):
    assert whole_step(step, "a.world") == ns
    assert ("above 20 ms" in caplog.text) is warned


@pytest.mark.parametrize("step_ms", [20, 50, 100])
def test_at_long_steps_the_numbers_stay_numbers(m2wr_rig, build, step_ms):
    rig = m2wr_rig(build.box("wall", 2.0, 0.0, 0.5, size=(0.2, 4.0, 1.0)),
                   build.box("crate", 0.9, 0.0, 0.15, size=(0.3,) * 3, static=False), step_ms=step_ms)
    rig.send(0.5, 0.3).run(10.0)
    found = numbers_of(rig, ["m2wr", "crate"])
    assert len(found) > 1000 and all(map(math.isfinite, found))
    assert math.hypot(*rig.pose()[0][:2]) < 10.0


@pytest.mark.parametrize("rate, step_ms, told", [
    (20.0, 1, None), (20.0, 5, None), (0.0, 1, None),
    (30.0, 1, "30 Hz does not fit into steps of 1 ms: intervals are 33 or 34 ms"),
    (30.0, 5, "intervals are 30 or 35 ms"), (200.0, 10, "more often than there are steps of 10 ms"), (-3.0, 1, None)])
def test_rates_that_do_not_fit_are_reported(rate, step_ms, told):
    said = misfit(rate, step_ms * MS)
    assert said is None if told is None else told in said


def test_rate_between_steps_is_reported_and_kept_on_average(make_rig, m2wr, caplog):
    caplog.set_level(logging.INFO)
    link, = [link for link in m2wr.links if link.sensors]
    sensors = tuple(replace(sensor, update_rate=30.0) for sensor in link.sensors)
    robot = replace(m2wr, links=tuple(replace(each, sensors=sensors) if each is link else each for each in m2wr.links))
    rig = make_rig(step_ms=5)
    for k in range(3):
        rig.simulator.spawn(robot, at(3.0 * k, 0.0, 0.1), "r%d" % k, "/r%d" % k)
    assert caplog.text.count("30 Hz does not fit into steps of 5 ms") == 1
    rig.run(2.0)
    stamps = rig.stamps_ms("/m2wr/laser/scan")
    assert len(stamps) == pytest.approx(60, abs=1)


# ---- sensors -----------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("limits", [(5.0, 1.0), (2.0, 2.0)])
def test_laser_with_an_empty_range_is_reported(m2wr_rig, m2wr, build, limits, caplog):
    link, = [link for link in m2wr.links if link.sensors]
    ray = replace(link.sensors[0].ray, range_min=limits[0], range_max=limits[1])
    sensors = (replace(link.sensors[0], ray=ray),)
    robot = replace(m2wr, links=tuple(replace(each, sensors=sensors) if each is link else each for each in m2wr.links))
    rig = m2wr_rig(build.box("wall", 2.0, 0.0, 0.5, size=(0.2, 4.0, 1.0)), robot=robot).run(0.2)
    assert "<min> range %g m is not below <max> range %g m" % limits in caplog.text
    scan = rig.messages("/m2wr/laser/scan")[-1]
    assert set(scan.ranges) == {math.inf} and (scan.range_min, scan.range_max) == limits


# ---- bodies ------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf])
def test_body_without_mass_is_rejected(m2wr_rig, build, mass):
    rig = m2wr_rig()
    with pytest.raises(ModelError, match="ghost::link.*mass"):
        rig.simulator.spawn(build.box("ghost", 1.0, 0.0, 1.0, static=False, mass=mass), at(1.0, 0.0, 1.0))
    rig.send(0.5, 0.0).run(1.0)
    assert "ghost" not in rig.simulator.models and rig.pose()[0][0] > 0.3


MASSLESS = """<sdf version="1.6"><world name="w"><model name="ghost"><link name="l"><inertial><mass>%s</mass></inertial>
<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link></model></world></sdf>"""


@pytest.mark.parametrize("mass", ["0", "-2"])
def test_a_body_without_mass_in_a_world_is_reported_and_skipped(mass):
    world = load_world(MASSLESS % mass)
    note, = world.notes
    assert "model[ghost]" in note and "mass is %s" % mass in note and "left out" in note
    with Sim(world) as sim:
        sim.step(None, 0.01)
        assert not sim.simulator.models


@pytest.mark.parametrize("mass", ["nan", "1e999", "heavy"])
def test_invalid_mass_is_reported_and_uses_the_default(mass):
    world = load_world(MASSLESS % mass)
    note, = world.notes
    assert 'mass is "%s"; expected a finite number; using 1' % mass in note
    assert world.models[0].links[0].inertial.mass == 1.0


@pytest.mark.parametrize("step_ms", [1, 5])
def test_things_that_overlap_at_the_start_part_gently(make_rig, build, step_ms):
    crates = [build.box("crate%d" % k, 0.02 * k, 0.01 * k, 0.2 + 0.05 * k, size=(0.4, 0.4, 0.4), static=False)
              for k in range(8)]
    same = [build.sphere("ball%d" % k, 3.0, 0.0, 0.3, radius=0.3, static=False) for k in range(3)]
    rig = make_rig(build.box("pillar", 0.1, 0.0, 0.5, size=(0.3, 0.3, 1.0)), *(crates + same), step_ms=step_ms)
    names, fastest = [model.name for model in crates + same], 0.0
    for _ in range(60):
        rig.run(0.02)
        for name in names:
            state = rig.engine.link_state(rig.simulator.models[name].root)
            assert all(math.isfinite(value) for part in state for value in part)
            fastest = max(fastest, math.sqrt(sum(value * value for value in state.linear_velocity)))
    assert fastest < 5.0        # what is lifted high enough to fall has its own speed; nothing is shot away
    for name in names:
        position = rig.pose(name)[0]
        assert math.hypot(*position[:2]) < 5.0 and -0.5 < position[2] < 3.0


@pytest.mark.parametrize("shift, step_ms", [(0.0, 1), (0.0, 5), (1e-9, 5), (0.1, 5)])
def test_overlapping_robots_separate_with_finite_poses(make_rig, m2wr, shift, step_ms):
    rig = make_rig(step_ms=step_ms)
    for k in range(3):
        rig.simulator.spawn(m2wr, at(shift * k, 0.0, 0.1), "r%d" % k, "/r%d" % k)
    for _ in range(2):
        rig.send(0.5, 0.5, "/r0/cmd_vel").send(-0.5, 0.5, "/r1/cmd_vel").run(0.1 * (step_ms + 1))
    names = ["r0", "r1", "r2"]
    assert all(map(math.isfinite, numbers_of(rig, names)))
    for name in names:
        position, orientation = rig.pose(name)
        assert math.hypot(*position[:2]) < 5.0 and -0.2 < position[2] < 1.0


@pytest.mark.parametrize("far", [1e9, -1e9, 1e300])
def test_coordinates_beyond_reach_are_rejected_with_the_limit(m2wr_rig, build, far):
    rig = m2wr_rig()
    for position in ((far, 0.0, 0.1), (0.0, far, 0.1), (0.0, 0.0, far)):
        with pytest.raises(ModelError, match="expected at most 1e\\+06 m from the origin"):
            rig.simulator.spawn(build.box("far", 0, 0, 0, static=False), (position, at()[1]))
        with pytest.raises(ModelError, match="expected at most 1e\\+06 m from the origin"):
            rig.simulator.set_model_state("m2wr", (position, at()[1]), (0, 0, 0), (0, 0, 0))
    rig.send(0.5, 0.0).run(1.0)
    assert rig.pose()[0][0] > 0.3


def test_a_robot_at_the_edge_of_what_is_allowed_drives(m2wr_rig):
    rig = m2wr_rig(pose=at(999000.0, -999000.0, 0.1)).send(0.5, 0.0).run(3.0)
    position = rig.pose()[0]
    assert position[0] - 999000.0 == pytest.approx(1.45, abs=0.1) and position[2] == pytest.approx(0.1, abs=1e-3)
    assert all(map(math.isfinite, numbers_of(rig, ["m2wr"])))


# ---- a simulation that diverges ----------------------------------------------------------------------------------

def test_diverged_world_ends_the_loop_before_publishing(m2wr_rig):
    rig = m2wr_rig(loss_ends=True).send(0.4, 0.0).run(0.5)
    rig.engine.add_link_force(rig.simulator.models["m2wr"].root, (1e13, 0.0, 1e13), (0.0, 0.0, 0.0))
    loop = Loop(rig.simulator, 0.0, lambda: False, lambda: None)
    with pytest.raises(SimError, match=r"step 50\d \(1 ms each\): the simulation diverged: m2wr::link_chassis is at .*"
                                       r"joint_right_wheel -?4 with up to 5"):
        loop.run()
    found = numbers_of(rig, [])
    assert len(found) > 100 and all(abs(value) < 1e3 for value in found)
