# SPDX-License-Identifier: BSD-3-Clause
"""The engine after models were removed or the world was closed: memory, contacts, and the end of the process."""
import gc
import math
import subprocess
import sys

import pytest

from conftest import SOURCE
from m2wr_sim.model.types import Inertial, Link, Model

SMALL = Inertial(1.0, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))


def root_of(engine, index):
    """Return the number of the first link of the model added as number ``index``."""
    return next(iter(engine.handles[index].links.values()))


def state_of(engine, index=-1):
    return engine.link_state(root_of(engine, index))


CHURN = """
import resource
import conftest
from m2wr_sim.api.loading import read_robot
from m2wr_sim.physics.engine import EngineSettings
engine = conftest.factory.make_engine("%s", EngineSettings(step_ns=2000000))
engine.add_model(conftest.ground(), conftest.at())
robot = read_robot("m2wr")
sizes = []
for turn in range(%d):
    handles = [engine.add_model(robot, conftest.at(x=2.0 * k, z=0.1), "robot%%d" %% k) for k in range(4)]
    handles.append(engine.add_model(conftest.box("box", 0.6, 0, 0.3), conftest.at(0.6, 0, 0.3)))
    for handle in handles[:4]:
        engine.set_joint_motor(handle.joints["joint_left_wheel"], 5.0, 5.0)
    engine.step(10)
    for handle in handles:
        engine.remove_model(handle)
    with open("/proc/self/statm") as stream:
        sizes.append(int(stream.read().split()[1]) * resource.getpagesize())
print(sizes[-1] - sizes[len(sizes) // 5])
"""

LITTER = """
import conftest
from m2wr_sim.physics.engine import EngineSettings
kept = []
for turn in range(3):
    engine = conftest.factory.make_engine("%s", EngineSettings())
    handles = [engine.add_model(model, model.pose) for model in (
        conftest.ground(), conftest.box("a", 0, 0, 0.3, static=False), conftest.box("b", 2, 0, 0.3))]
    engine.step(50)
    kept.append((engine, handles, kept))        # a cycle, and nothing is closed
"""


def run_python(program):
    return subprocess.run([sys.executable, "-c", program], cwd=str(SOURCE.parent / "test" / "unit"), timeout=60,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)


def test_memory_is_level_over_fifty_spawns_and_deletions(engine_kind):
    result = run_python(CHURN % (engine_kind, 50))
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) < 2 ** 20


@pytest.mark.parametrize("end", ["", "del engine, handles, kept; import gc; gc.collect()",
                                 "engine.close(); engine.close()"])
def test_a_program_with_engines_left_open_ends_well(engine_kind, end):
    result = run_python(LITTER % engine_kind + end)
    assert (result.returncode, result.stderr) == (0, "")


def test_what_was_removed_is_not_felt_any_more(make_engine, build):
    engine = make_engine(2, [build.ground(), build.box("step", 0, 0, 0.25),
                             build.box("slab", 0.2, 0, 0.25, static=False)])
    for handle in engine.handles[1:]:
        engine.remove_model(handle)
    engine.handles.append(engine.add_model(build.sphere("ball", 0, 0, 1.0, static=False), build.at(z=1.0)))
    engine.step(800)
    assert state_of(engine).position[2] == pytest.approx(0.25, abs=1e-3)
    with pytest.raises(KeyError):
        engine.link_pose(engine.handles[1].links["link"])


def test_contact_of_two_bodies_is_reported_once(make_engine, build):
    engine = make_engine(models=[build.ground()])
    for index in range(3):
        engine.add_model(build.box("box%d" % index, 0.0, 0.0, 0.25 + 0.501 * index, static=False),
                         build.at(0.0, 0.0, 0.25 + 0.501 * index))
    for _ in range(300):
        engine.step(1)
    pairs = [(contact.first, contact.second) for contact in engine.drain_contact_events()]
    assert pairs and all(pair == tuple(sorted(pair)) for pair in pairs)
    assert len(pairs) == len(set(pairs)) == 2


def test_contact_of_a_model_spawned_again_is_reported(make_engine, build):
    engine = make_engine(models=[build.ground(), build.box("table", 0.0, 0.0, 0.5, (1.0, 1.0, 1.0), static=False)])
    for _ in range(2):
        handle = engine.add_model(build.box("cup", 0.0, 0.0, 1.2495, static=False), build.at(0.0, 0.0, 1.2495))
        engine.step(50)
        events = engine.drain_contact_events()
        assert [(event.first.split("::")[0], event.second.split("::")[0]) for event in events] == [
            ("cup", "table")]
        engine.remove_model(handle)


def test_reset_with_a_model_without_shapes(make_engine, build):
    """An empty space that is taken out of another and put back once made libode end the process."""
    ghost = Model("ghost", (Link("link", inertial=SMALL, gravity=False),))
    crates = [build.box(name, 0.1 * index, 0.0, 0.3 + 0.4 * index, static=False) for index, name in enumerate("ab")]
    engine = make_engine(1, [build.ground(), crates[0], ghost])
    engine.step(300)
    engine.forget()
    engine.add_model(crates[1], crates[1].pose)
    engine.step(300)
    assert all(math.isfinite(value) for value in state_of(engine, 1).position)


def test_a_closed_engine_holds_no_body(make_engine, build):
    def bodies():
        gc.collect()
        return sum(type(found).__name__ == "Body" and type(found).__module__ == "ode" for found in gc.get_objects())

    before = bodies()
    engine = make_engine(1, [build.ground(), build.box("box", 0, 0, 0.3, static=False)])
    engine.step(50)
    assert bodies() == before + 1
    engine.close()              # libode frees bodies with their world: releasing one later would abort the process
    assert bodies() == before
