# SPDX-License-Identifier: BSD-3-Clause
"""The ends of what the engines can do: bodies thrown out of the world, heaps, and the end of the process."""
import math
import subprocess
import sys

import pytest

from conftest import ENGINES, SOURCE, at
from m2wr_sim.errors import ModelError, SimError
from m2wr_sim.model.types import Surface
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import TOO_FAST, EngineSettings
from m2wr_sim.physics.factory import make_engine as engine_of_kind

MS = 1000000


# ---- diverging simulations ---------------------------------------------------------------------------------------

@pytest.mark.parametrize("linear, angular", [
    ((0.0, 0.0, 2.0 * TOO_FAST), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 5.0 * TOO_FAST, 0.0)),
    ((0.6 * TOO_FAST, 0.0, 0.6 * TOO_FAST), (0.0, 0.0, 0.0))])
@pytest.mark.parametrize("batch", [1, 100])
def test_a_body_thrown_out_is_named_with_step_and_motors(make_engine, m2wr, build, linear, angular, batch):
    engine = make_engine(1, [build.ground(), build.box("crate", 3.0, 0.0, 0.2, static=False)])
    robot = engine.add_model(m2wr, build.at(z=0.1))
    engine.set_joint_motor(robot.joints["joint_left_wheel"], 3.0, 5.0)
    engine.step(10)
    engine.set_link_velocity(engine.handles[1].links["link"], linear, angular)
    with pytest.raises(SimError, match=r"step 11 \(1 ms each\): .*: crate::link is at .* velocity .* Motors: none"):
        for _ in range(100 // batch):
            engine.step(batch)


def test_a_thrown_robot_is_told_with_its_last_command(make_engine, m2wr, build):
    engine = make_engine(1, [build.ground()])
    robot = engine.add_model(m2wr, build.at(z=0.1), "rover")
    engine.set_joint_motor(robot.joints["joint_left_wheel"], 3.0, 5.0)
    engine.set_joint_motor(robot.joints["joint_right_wheel"], -2.5, 5.0)
    engine.set_link_velocity(robot.links["link_chassis"], (0.0, 0.0, 1e12), (0.0, 0.0, 0.0))
    with pytest.raises(SimError, match=r"step 1 .*rover::\w+ is at .*joint_left_wheel 3 with up to 5.*"
                                       r"joint_right_wheel -2.5"):
        engine.step(100)


def test_fast_but_finite_motion_continues(make_engine, build):
    engine = make_engine(1, [build.box("crate", 0.0, 0.0, 0.0, static=False)])
    engine.set_link_velocity(engine.handles[0].links["link"], (0.2 * TOO_FAST, 0.0, 0.0), (0.0, 0.0, 0.0))
    engine.step(5)
    assert engine.link_pose(engine.handles[0].links["link"])[0][0] == pytest.approx(1e-3 * TOO_FAST)


# ---- heaps -------------------------------------------------------------------------------------------------------

def heap(engine, build, count):
    engine.add_model(build.ground(), at())
    side = int(math.ceil(math.sqrt(count)))
    for k in range(count):
        engine.add_model(build.box("crate%d" % k, 0, 0, 0, size=(0.21, 0.21, 0.2), static=False, mass=0.5),
                         at(0.2 * (k % side), 0.2 * (k // side), 0.12))


def test_many_contacts_that_begin_at_once_are_all_reported(build):
    contacts = []
    for kind in ENGINES:
        engine = engine_of_kind(kind, EngineSettings(step_ns=MS, solver="quick"))
        heap(engine, build, 196)            # 2 * 14 * 13 neighbours overlap, and as many diagonals at their corners
        engine.reseed(1)
        engine.step(3)
        contacts.append(sorted(engine.drain_contact_events()))
        engine.close()
    assert contacts[0] == contacts[-1] and len(contacts[0]) >= 2 * 14 * 13


def test_contacts_beyond_the_size_of_the_log_are_reported(build):
    """Balls between two posts each, which part and meet again in one long batch of steps."""
    rubber, told = Surface(mu=0.0, mu2=0.0, restitution=1.0, restitution_threshold=0.0), []
    for kind in ENGINES:
        engine = engine_of_kind(kind, EngineSettings(step_ns=5 * MS))
        for k in range(12):
            for x in (-0.31, 0.31):
                engine.add_model(build.sphere("post", 0, 0, 0, radius=0.1, surface=rubber), at(x, 0.5 * k, 0.0),
                                 "post%d_%g" % (k, x))
            ball = engine.add_model(build.sphere("ball", 0, 0, 0, radius=0.1, static=False, gravity=False,
                                                 surface=rubber), at(0.0, 0.5 * k, 0.0), "ball%d" % k)
            engine.set_link_velocity(ball.links["link"], (1.0 + 0.1 * k, 0.0, 0.0), (0.0, 0.0, 0.0))
        engine.step(1600)
        told.append(engine.drain_contact_events())
        engine.close()
    assert told[0] == told[-1] and len(told[0]) > 256 + 128


def test_room_for_contacts_grows_and_lost_ones_are_counted(build, monkeypatch, caplog):
    pytest.importorskip("numba", reason="the compiled loop needs numba")
    native_ode.publish_symbols()
    from m2wr_sim.physics import step_layout
    monkeypatch.setattr(step_layout, "CONTACT_PAIR_ROOM", 8)
    engine, told = engine_of_kind("native", EngineSettings(step_ns=MS)), []
    for k in range(20):
        engine.add_model(build.box("post", 0, 0, 0, size=(0.05, 0.1, 0.5)), at(-1.5 + 0.15 * k, 0.0999, 0.25),
                         "post%d" % k)
    beam = engine.add_model(build.box("beam", 0, 0, 0, size=(4.0, 0.1, 0.1), static=False, gravity=False), at(z=0.25))
    engine.step(1)
    told.append(len(engine.drain_contact_events()))
    assert "12 contacts are not reported" in caplog.text
    engine.set_link_pose(beam.links["link"], at(0.0, -1.0, 0.25))
    engine.step(1)
    engine.set_link_pose(beam.links["link"], at(0.0, 0.0, 0.25))
    engine.set_link_velocity(beam.links["link"], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    caplog.clear()
    engine.step(1)
    told.append(len(engine.drain_contact_events()))
    assert told == [8, 20] and caplog.text == ""
    engine.close()


# ---- the process -------------------------------------------------------------------------------------------------

PROGRAM = """
import gc, logging, numpy, random, sys
import conftest
from m2wr_sim.api import Sim
from m2wr_sim.api.loading import read_robot
from m2wr_sim.physics.engine import EngineSettings
robot = read_robot("m2wr")
logging.disable(logging.CRITICAL)
kind, end = sys.argv[1], sys.argv[2]
"""
CYCLES = PROGRAM + """
chance, kept = random.Random(4), []
sim = Sim("world02", robot, (0, 8, 0), engine=kind)
for turn in range(20):
    names = ["r%d" % k for k in range(4)]
    for k, name in enumerate(names):
        sim.spawn(robot, (2.0 * k, 12.0, 0.0), name)
    crate = conftest.box("crate%d" % turn, 1 + turn, 14, 0.3, static=False)
    sim.simulator.spawn(crate, crate.pose)
    sim.step({name: (0.5, 0.3) for name in names}, 0.1)
    chance.shuffle(names)
    for name in names:
        kept.append((sim, sim.simulator.models[name]))      # deleted models are still referenced
        sim.delete(name)
        if chance.random() < 0.1:
            gc.collect()
    sim.step(None, 0.05)
    if turn % 5 == 4:
        del kept[:]
        gc.collect()
"""
DROPPED = PROGRAM + """
def world(turn):
    engine = conftest.factory.make_engine(kind, EngineSettings())
    handles = [engine.add_model(conftest.ground(), conftest.at()), engine.add_model(robot, conftest.at(z=0.1))]
    links = list(handles[1].links.values())
    reader = engine.pose_reader([(link, conftest.at()) for link in links], numpy.zeros((len(links), 7)))
    engine.step(20)
    if turn % 3 == 0:
        engine.close()
    ring = [engine, handles, reader]
    ring.append(ring)                       # only the cycle collector can free it
    return ring
worlds = [world(turn) for turn in range(9)]
random.Random(2).shuffle(worlds)
while worlds:
    worlds.pop()
    gc.collect()
"""
RAISED = PROGRAM + """
class Broken(Exception):
    pass
def broken(*_):
    raise Broken
sims = [Sim("empty", robot, engine=kind) for _ in range(3)]
sims[0].step((0.5, 0.0), 0.2)
sims[0].drive().callbacks.append(broken)
sims[1].simulator.engine.set_link_velocity(sims[1].simulator.models["m2wr"].root, (0, 0, 1e12), (0, 0, 0))
for sim in sims[:2]:
    try:
        sim.step((0.5, 0.0), 0.2)
    except Exception as error:
        print(type(error).__name__)
    try:
        sim.spawn(conftest.box("bad", 0, 0, 0, static=False, mass=-1.0), name="bad")
    except Exception as error:
        print(type(error).__name__)
    gc.collect()
"""


LONG = PROGRAM + """
from dataclasses import replace
from m2wr_sim.model.types import Inertial
logging.disable(logging.NOTSET)
engine = conftest.factory.make_engine(kind, EngineSettings(step_ns=2000000))
engine.add_model(conftest.ground(), conftest.at())
def put(name, model, pose, inertia):
    link = replace(model.links[0], inertial=Inertial(1.0, inertia=(inertia, 0, 0, inertia, 0, inertia)))
    return engine.add_model(replace(model, links=(link,)), pose, name)
beam = put("beam", conftest.box("b", 0, 0, 0, (0.5, 65536.0, 0.5), static=False), conftest.at(z=0.25), 1.0)
put("crate", conftest.box("b", 0, 0, 0, static=False), conftest.at(z=0.75), 1.0)
turned = ((0.1, 0.0, 1.2), (numpy.sin(0.1), 0.0, 0.0, numpy.cos(0.1)))
put("drum", conftest.cylinder("c", 0, 0, 0, 0.25, 0.4, static=False), turned, 1.0)
engine.step(200)
engine.remove_model(beam)
assert not engine._iterative
"""
SPIT = PROGRAM + """
engine = conftest.factory.make_engine(kind, EngineSettings())
engine.add_model(conftest.cylinder("post", 0, 0, 0, 0.3, 1.0), conftest.at(z=0.5))
ball = engine.add_model(conftest.sphere("ball", 0, 0, 0, 0.2, static=False), conftest.at(z=0.5))
engine.step(20)
assert all(map(numpy.isfinite, engine.link_pose(ball.links["link"])[0]))
"""
SOFT = PROGRAM + """
engine = conftest.factory.make_engine(kind, EngineSettings())
engine.add_model(conftest.ground(), conftest.at())
handle = engine.add_model(robot, conftest.at(z=0.1))
for joint in robot.joints:
    if joint.kind == "revolute":
        engine.change_joint(handle.joints[joint.name], joint.axis, {"lower": 0.2, "upper": 1.2, "stop_erp": 0.0,
                                                                    "stop_cfm": float(end), "rate": 0.2}, 0)
engine.step(200)
assert all(map(numpy.isfinite, engine.link_pose(handle.links["link_chassis"])[0]))
"""


@pytest.mark.parametrize("softness", ["1e5", "1e9", "1e16"])
def test_a_stop_may_be_as_soft_as_the_limit_allows(engine_kind, softness):
    """The direct solver ends the process where softness over the step makes it lose the bodies' mobility."""
    result = subprocess.run([sys.executable, "-c", SOFT, engine_kind, softness], timeout=600,
                            cwd=str(SOURCE.parent / "test" / "unit"), stderr=subprocess.PIPE, universal_newlines=True)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("program, said", [(LONG, "beam::link: it has contacts up to 32768 m from its centre of mass"),
                                           (SPIT, "")], ids=["long beam", "ball on the axis of a cylinder"])
def test_too_many_contacts_do_not_end_the_process(engine_kind, program, said):
    result = subprocess.run([sys.executable, "-c", program, engine_kind, ""], timeout=600,
                            cwd=str(SOURCE.parent / "test" / "unit"), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            universal_newlines=True)
    assert result.returncode == 0, result.stderr
    assert said in result.stderr and result.stderr.count("solved iteratively") == (1 if said else 0)


@pytest.mark.parametrize("program", [CYCLES, DROPPED, RAISED], ids=["cycles", "dropped", "raised"])
@pytest.mark.parametrize("end", ["falls off the end", "collects"])
def test_the_process_ends_well(engine_kind, program, end):
    finish = "globals().pop('sim', None); globals().pop('sims', None); gc.collect()" if end == "collects" else ""
    result = subprocess.run([sys.executable, "-c", program + finish, engine_kind, end], timeout=120,
                            cwd=str(SOURCE.parent / "test" / "unit"), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            universal_newlines=True)
    assert (result.returncode, result.stderr) == (0, "")
    if program is RAISED:
        assert "LostError" in result.stdout and "ModelError" in result.stdout


def test_a_refused_model_leaves_the_others_alone(make_engine, build, m2wr):
    engine = make_engine(1, [build.ground()])
    robot = engine.add_model(m2wr, build.at(z=0.1))
    engine.step(500)
    before = engine.link_state(robot.links["link_chassis"])
    for mass in (0.0, -1.0, math.nan, math.inf, 1e-30):
        with pytest.raises(ModelError, match="mass"):
            engine.add_model(build.box("bad", 0, 0, 0, static=False, mass=mass), build.at(z=1.0))
    engine.step(500)
    assert math.dist(engine.link_state(robot.links["link_chassis"]).position, before.position) < 1e-5
