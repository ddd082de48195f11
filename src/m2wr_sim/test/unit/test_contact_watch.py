# SPDX-License-Identifier: BSD-3-Clause
"""Contact reports of both engines: forces against weights, sides, the newest step, and no trace in the motion."""
import pytest

from conftest import at, box, sphere
from m2wr_sim.physics.contact_watch import ContactReport, ContactWatch
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine as engine_of


def crate(name="crate", x=0.0, z=0.25, mass=10.0):
    return box(name, x, 0.0, z, static=False, mass=mass)


def full(name):
    return name + "::link::collision"


def force_of(pair):
    return tuple(sum(report.force[axis] for report in pair) for axis in range(3))


@pytest.fixture
def stack(make_engine, build):
    """Return an engine with a crate on the ground and a ball on the crate."""
    return make_engine(models=(build.ground(), crate(), sphere("ball", 0.0, 0.0, 0.75, static=False, mass=2.0)))


def test_the_ground_carries_the_weight_of_all_that_stands_on_it(stack):
    watch = stack.watch_contacts([full("crate")])
    stack.step(1000)
    ball, floor = watch.drain()
    assert (ball[0].first, ball[0].second) == (full("crate"), full("ball"))
    assert (floor[0].first, floor[0].second) == (full("crate"), full("ground_plane"))
    assert force_of(floor) == pytest.approx((0.0, 0.0, 12.0 * 9.8), abs=1e-3)
    assert force_of(ball) == pytest.approx((0.0, 0.0, -2.0 * 9.8), abs=1e-3)
    assert len(floor) == 4 and len(ball) == 1


def test_normal_and_torque_refer_to_the_watched_body(stack):
    watch = stack.watch_contacts([full("crate")])
    stack.step(1000)
    ball, floor = watch.drain()
    assert ball[0].normal == pytest.approx((0.0, 0.0, -1.0)) and floor[0].normal == pytest.approx((0.0, 0.0, 1.0))
    for report in floor:
        x, y, _ = report.position
        assert abs(x) == pytest.approx(0.25, abs=1e-3) and 0.0 <= report.depth < 1e-3
        assert report.torque == pytest.approx((y * report.force[2], -x * report.force[2], 0.0), abs=1e-2)


def test_a_watch_on_what_cannot_move_gets_the_reaction(make_engine, build):
    engine = make_engine(models=(box("plate", 0.0, 0.0, -0.05, (1.0, 1.0, 0.1)), crate(x=0.1)))
    watch = engine.watch_contacts([full("plate")])
    engine.step(1000)
    pair, = watch.drain()
    assert (pair[0].first, pair[0].second) == (full("plate"), full("crate"))
    assert force_of(pair) == pytest.approx((0.0, 0.0, -98.0), abs=1e-3)
    # about the plate's own origin: 98 N at x = 0.1 m
    assert sum(report.torque[1] for report in pair) == pytest.approx(9.8, abs=1e-2)


def test_both_sides_of_a_contact_report_opposite_forces(stack):
    on_ball, on_crate = stack.watch_contacts([full("ball")]), stack.watch_contacts([full("crate")])
    stack.step(1000)
    (from_ball,), from_crate = on_ball.drain(), on_crate.drain()[0]
    assert from_ball[0].force == pytest.approx(tuple(-value for value in from_crate[0].force), abs=1e-6)
    assert from_ball[0].position == from_crate[0].position


def test_a_contact_that_ended_is_reported_once(make_engine, build):
    engine = make_engine(models=(build.ground(), crate(z=0.2495)))
    watch = engine.watch_contacts([full("crate")])
    engine.step(10)
    engine.set_link_pose(engine.handles[1].links["link"], at(z=5.0))
    engine.step(10)
    pair, = watch.drain()
    assert {report.step for report in pair} == {10}
    engine.step(10)
    assert watch.drain() == []


def test_ending_a_watch_does_not_change_others(stack):
    first, second = stack.watch_contacts([full("crate")]), stack.watch_contacts([full("crate")])
    stack.end_watch(first)
    stack.step(100)
    assert first.drain() == [] and len(second.drain()) == 2


def test_names_of_nothing_report_nothing(stack):
    watch = stack.watch_contacts(["unknown::link::collision"])
    stack.step(10)
    assert watch.drain() == []


def test_a_model_may_go_while_it_is_watched(stack):
    watch = stack.watch_contacts([full("ball"), full("crate")])
    stack.step(100)
    stack.remove_model(stack.handles[2])
    watch.drain()
    stack.step(100)
    pair, = watch.drain()
    assert pair[0].second == full("ground_plane")


def test_more_contacts_than_the_ring_holds_leave_the_newest(make_engine, build):
    engine = make_engine(models=(build.ground(), crate()))
    watch = engine.watch_contacts([full("crate")])
    engine.step(2000)                       # 8000 contacts in one call
    pair, = watch.drain()
    assert {report.step for report in pair} == {2000} and force_of(pair)[2] == pytest.approx(98.0, abs=1e-3)


def test_both_engines_report_the_same_numbers(build):
    pytest.importorskip("numba", reason="the compiled loop needs numba")
    found = []
    for kind in ("native", "pyode"):
        engine = engine_of(kind, EngineSettings())
        for model in (build.ground(), crate(z=0.4), sphere("ball", 0.05, 0.0, 0.9, static=False, mass=2.0)):
            engine.add_model(model, model.pose)
        watch = engine.watch_contacts([full("crate")])
        reports = []
        for _ in range(40):
            engine.step(10)
            reports.append(watch.drain())
        engine.close()
        found.append(reports)
    assert found[0] == found[1] and any(found[0])


def test_a_watch_keeps_of_each_pair_the_newest_step():
    def report(step, second, depth):
        return ContactReport(step, "a", second, (0, 0, 0), (0, 0, 1), depth, (0, 0, 0), (0, 0, 0))
    watch = ContactWatch(["a"])
    for entry in (report(1, "b", 0.1), report(1, "b", 0.2), report(1, "c", 0.3), report(2, "b", 0.4)):
        watch.add(entry)
    assert watch.drain() == [[report(2, "b", 0.4)], [report(1, "c", 0.3)]] and watch.drain() == []


def test_many_contacts_at_once_hide_none_that_was_short(build):
    pytest.importorskip("numba", reason="the compiled loop needs numba")
    found = []
    for kind in ("native", "pyode"):
        engine = engine_of(kind, EngineSettings())
        engine.add_model(build.ground(), at())
        for index in range(30):                 # 120 contacts in every step: in 100 steps more than are kept in between
            engine.add_model(crate("crate%d" % index), at(2.0 * index, 0.0, 0.2499))
        ball = engine.add_model(sphere("ball", -5.0, 0.0, 0.0999, 0.1, static=False), at(-5.0, 0.0, 0.0999))
        watch = engine.watch_contacts([full("ground_plane")])
        engine.set_link_velocity(ball.links["link"], (0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
        engine.step(100)
        found.append(watch.drain())
        engine.close()
    assert len(found[0]) == 31 and found[0] == found[1]
    assert {pair[0].second: pair[0].step for pair in found[0]}[full("ball")] < 5
