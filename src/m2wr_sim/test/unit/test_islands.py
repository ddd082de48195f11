# SPDX-License-Identifier: BSD-3-Clause
"""Islands: models connected by too many contacts are solved iteratively, and no others."""
import math
import random
import time

import pytest

from conftest import ENGINES, at
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine as engine_of_kind
from m2wr_sim.physics.islands import ITERATIVE_ABOVE, Islands

MS = 1000000


def largest_group(meetings):
    """The slow plain way: grow each group until nothing is added; returns its contacts and names."""
    best = (0, [])
    for start, _, _, _ in meetings:
        group = {start}
        while True:
            more = {name for one, two, _, _ in meetings if one in group or two in group for name in (one, two)}
            if more <= group:
                break
            group |= more
        inside = [meeting for meeting in meetings if meeting[0] in group]
        if any(awake for _, _, _, awake in inside):
            best = max(best, (sum(count for _, _, count, _ in inside), sorted(group)))
    return best


def test_largest_island_agrees_with_plain_search_in_any_order():
    places, seen, islands = random.Random(5), set(), Islands()
    for _ in range(200):
        meetings = [("m%d" % places.randrange(12), "m%d" % places.randrange(12), places.choice((1, 2, 3, 4, 7, 11)),
                     places.random() < 0.4) for _ in range(places.randrange(10))]
        contacts, names = largest_group(meetings)
        for _ in range(3):
            places.shuffle(meetings)
            islands.clear()
            for meeting in meetings:
                islands.join(*meeting)
            assert islands.largest == contacts
            if contacts:
                found = islands.members()
                assert sum(count for one, _, count, _ in meetings if one in found) == contacts
        seen.add(len(names))
    assert {0, 2, 3, 4} <= seen, "too few kinds of islands: %s" % seen


def pile(kind, robot, count, step_ms=5):
    """Robots of one kind in one place, their wheels turning this way and that."""
    engine = engine_of_kind(kind, EngineSettings(step_ns=step_ms * MS))
    engine.reseed(count)
    engine.add_model(robot[1], at())
    for k in range(count):
        handle = engine.add_model(robot[0], at(z=0.1), "robot%d" % k)
        for index, joint in enumerate(handle.joints.values()):
            engine.set_joint_motor(joint, 3.0 * (k - index), 5.0)
    return engine


def states(engine):
    return [engine.link_state(link) for link in engine._links]


@pytest.fixture
def robot(m2wr, build):
    return m2wr, build.ground()


def test_overlapping_robots_do_not_stall_and_are_repeatable(robot):
    ends = []
    engine = pile(ENGINES[0], robot, 1)
    engine.step(1)                                  # what is compiled is compiled before the clock starts
    engine.close()
    for draws in (0, 3):
        engine, began = pile(ENGINES[0], robot, 8), time.process_time()
        native_ode.seed_random(draws)               # as if others had drawn before
        for _ in range(40 if ENGINES[0] == "native" else 4):
            engine.step(10)
        assert time.process_time() - began < 20.0   # the direct solver takes 20 minutes
        assert native_ode.random_seed() == draws    # nor do others see anything of it
        ends.append(states(engine))
        engine.close()
    assert ends[0] == ends[1]
    assert all(math.isfinite(value) and abs(value) < 50.0 for state in ends[0] for part in state for value in part)


@pytest.mark.parametrize("batch", [1, 40])
def test_engines_agree_on_an_island_to_the_last_bit(robot, batch):
    ends = []
    for kind in ENGINES:
        engine = pile(kind, robot, 4)
        for _ in range(40 // batch):
            engine.step(batch)
        ends.append((states(engine), sorted(engine.drain_contact_events())))
        engine.close()
    assert ends[0] == ends[-1]


def crates(engine, build, columns, rows, spacing=0.199):
    """Boxes of 0.1 x 0.2 x 0.1 m, a little into the ground and one another."""
    for row in range(rows):
        for column in range(columns):
            engine.add_model(build.box("crate", 0, 0, 0, size=(0.1, 0.2, 0.1), static=False, mass=0.5),
                             at(0.9, spacing * (column - 0.5 * columns), 0.049 + 0.099 * row),
                             "crate%d_%d" % (row, column))


def test_a_wall_of_bricks_may_be_run_into(make_engine, m2wr, build, caplog):
    engine = make_engine(5, [build.ground()])
    crates(engine, build, 8, 8)
    handle = engine.add_model(m2wr, at(z=0.1), "robot")
    for joint in handle.joints.values():
        engine.set_joint_motor(joint, 12.0, 5.0)
    began = time.process_time()
    engine.step(300)
    assert time.process_time() - began < 20.0       # the direct solver takes a minute
    assert any(int(record.getMessage().split()[5]) > 40 for record in caplog.records), caplog.text
    spread = [engine.link_state(link) for link in engine._links]
    assert all(math.isfinite(value) for state in spread for part in state for value in part)
    assert max(state.position[2] for state in spread) < 0.9
    assert any("crate" in contact.first + contact.second and "robot" in contact.first + contact.second
               for contact in engine.drain_contact_events())


def test_members_of_an_island_are_logged_now_and_then(make_engine, build, caplog):
    engine = make_engine(5, [build.ground()])
    engine.iterative_above = 10
    for k in range(7):
        engine.add_model(build.box("box", 0, 0, 0, size=(0.2, 0.2, 0.2), static=False), at(0.19 * k, 0.0, 0.1),
                         "box%d" % k)
    engine.add_model(build.box("far", 9.0, 0, 0.25, static=False), at(9.0, 0.0, 0.25))
    engine.step(20)
    told = [record.getMessage() for record in caplog.records if "are in contact" in record.getMessage()]
    assert len(told) == 1
    assert told[0].startswith("step 1 (5 ms each): 7 models are in contact at 24 points: box0, box1, box2, box3, "
                              "box4 and 2 more.") and "50 iterations" in told[0]


def test_many_small_islands_are_solved_directly(make_engine, build, caplog):
    ends = []
    for limit in (ITERATIVE_ABOVE, 10 ** 6):
        engine = make_engine(5, [build.ground()])
        engine.iterative_above = limit
        crates(engine, build, 20, 2, spacing=0.3)
        assert 4 * 20 > ITERATIVE_ABOVE
        engine.step(60)
        ends.append(states(engine))
    assert ends[0] == ends[1] and "are in contact" not in caplog.text


def test_sleeping_models_are_no_island_until_woken(make_engine, build, caplog):
    engine = make_engine(5, [build.ground()])
    engine.iterative_above = 10
    crates(engine, build, 1, 5)
    engine.step(600)
    assert "5 models are in contact" in caplog.text
    engine._islands = Islands()                       # as if nothing had been told
    caplog.clear()
    engine.step(400)
    assert "are in contact" not in caplog.text
    engine.set_link_velocity(next(iter(engine._links)) + 3, (0.0, 0.0, 0.01), (0.0, 0.0, 0.0))
    engine.step(1)
    assert "5 models are in contact" in caplog.text


def test_long_steps_may_be_broken_off(make_engine, build):
    engine, calls = make_engine(5, [build.ground()]), []
    engine.iterative_above = 10
    crates(engine, build, 1, 5)

    def between():
        calls.append(engine._steps)
        if len(calls) == 3:
            raise KeyboardInterrupt

    engine.between = between
    with pytest.raises(KeyboardInterrupt):
        engine.step(50)
    assert calls == [1, 2, 3]
    engine.between = None
    engine.step(5)
    assert engine._steps == 8
