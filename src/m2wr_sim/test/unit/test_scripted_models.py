# SPDX-License-Identifier: BSD-3-Clause
"""Models with scripts that move together: the same motion as each script alone, members that come, go and fail."""
import math
from dataclasses import replace

import numpy as np
import pytest

from m2wr_sim.control import track_kernels as kernels
from m2wr_sim.control.pose_track import PoseScript, PoseTrack
from m2wr_sim.geometry import compose, cross, quaternion_from_rpy, rotate
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.scripted_models import PERIOD_NS, ScriptedModels
from m2wr_sim.plugins.way_points import ActorMotion
from m2wr_sim.runtime.schedule import first_step
from test_way_points import LINE, actor, moved, simulation, state

MS = 1000000


def track(rng, count, tension, turning):
    """Return a random track; ``turning``: how far its roll, pitch and yaw vary [rad]."""
    poses = [(tuple(rng.uniform(-5.0, 5.0, 3)), quaternion_from_rpy(*rng.uniform(-turning, turning, 3)))
             for _ in range(count)]
    times = np.cumsum(rng.uniform(0.2, 2.0, count)).tolist()
    return PoseTrack([0.0] + times[1:], poses, tension)


def scripts():
    """Return scripts of all kinds: straight, splines, slerp, squad, one point, closed, several tracks, jumps, waits."""
    rng = np.random.default_rng(4)
    single = [PoseScript([track(rng, 5, tension, turning)], loop, delay) for tension in (None, 0.0, 0.4)
              for turning in (0.0, 0.1, 2.5) for loop, delay in ((True, 0.0), (False, 0.7))]
    still = PoseTrack([0.0], [((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))])
    closed = PoseTrack([0.0, 1.0, 2.0], [((x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for x in (0.0, 1.0, 0.0)], None)
    jump = PoseTrack([0.0, 1e-3, 3.0], [((x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for x in (0.0, 9e5, 9e5)])
    several = [track(rng, 3, 0.0, 1.0) for _ in range(3)]
    return single + [PoseScript([still]), PoseScript([closed]), PoseScript([jump]), PoseScript(several, True, 0.3),
                     PoseScript([closed, closed, several[0]], False)]


class Alone:
    """One script, evaluated as the readable reference does."""

    def __init__(self, script, begin_ns):
        self.script, self.begin_ns, self.due_ns, self.ended = script, begin_ns, begin_ns, False

    def update(self, now_ns, step_ns):
        """Return the motion of an update, None if it is not due or waits."""
        if self.ended or self.due_ns > now_ns:
            return None
        self.due_ns = first_step((now_ns // PERIOD_NS + 1) * PERIOD_NS, now_ns, step_ns)
        time = (now_ns - step_ns - self.begin_ns) * 1e-9
        if time < self.script.delay - step_ns * 1e-9:
            begin_ns = first_step(self.begin_ns + int(self.script.delay * 1e9), now_ns, step_ns)
            self.due_ns = max(self.due_ns, begin_ns)
            return None
        pose, linear, angular = self.script.motion(time, (self.due_ns - now_ns) * 1e-9)
        self.ended = time >= self.script.end
        if self.ended or max(map(abs, linear + angular)) > FASTEST:
            linear = angular = (0.0, 0.0, 0.0)
        return pose[0] + pose[1] + linear + angular


class Context:
    """What the scripted models use of a plugin's context; it keeps what an engine would get."""

    model_name = "a"

    def __init__(self, now_ns, step_ns):
        self.now_ns, self.step_ns, self.physics, self.given = now_ns, step_ns, self, {}

    def link_places(self):
        return []

    def link_mover(self, parts, motions, chosen):
        def move():
            self.given = {row: motions[row].copy() for row in np.flatnonzero(chosen == kernels.MOVES).tolist()}
        return move


@pytest.mark.parametrize("step_ns", [MS, 4 * MS, 7 * MS])
def test_models_move_as_each_script_alone(step_ns):
    """Poses and velocities to 1e-12 relative; where positions are straight and nothing turns, to the last bit."""
    known = scripts()
    begins = [step_ns * (37 * k % 90) for k in range(len(known))]
    together, ctx, alone, updates = ScriptedModels(), Context(0, step_ns), [], 0
    for now_ns in range(step_ns, 9000 * MS, step_ns):
        for script, begin_ns in zip(known, begins):
            if begin_ns == now_ns - step_ns:                # members join in the order of their begins
                ctx.now_ns = begin_ns
                together.join(script, ctx)
                alone.append(Alone(script, begin_ns))
        due_ns = together.next_before(now_ns - step_ns)
        expected = {row: each.update(now_ns, step_ns) for row, each in enumerate(alone)}
        expected = {row: motion for row, motion in expected.items() if motion is not None}
        ctx.given = {}
        if due_ns == now_ns:
            together.before_step(now_ns)
        assert sorted(ctx.given) == sorted(expected)
        for row, motion in expected.items():
            assert ctx.given[row] == pytest.approx(motion, rel=1e-12, abs=1e-12)
            updates += 1
    assert updates > 2000
    live = [each.due_ns for each in alone if not each.ended]
    assert any(each.ended for each in alone) and together.next_before(9000 * MS) == max(min(live), 9000 * MS + step_ns)


def test_straight_script_without_turns_is_equal_to_the_last_bit():
    script = PoseScript([track(np.random.default_rng(2), 9, None, 0.0)])
    together, ctx, alone = ScriptedModels(), Context(0, MS), Alone(script, 0)
    together.join(script, ctx)
    for now_ns in range(MS, 9000 * MS, MS):
        motion, ctx.given = alone.update(now_ns, MS), {}
        if together.next_before(now_ns - MS) == now_ns:
            together.before_step(now_ns)
        assert ctx.given == {} if motion is None else tuple(ctx.given[0]) == motion


SECOND_LINK = ('<link name="arm"><pose>0.6 0.2 0.9 0.3 0.2 0.4</pose><inertial><pose>0.1 0.02 0.03 0 0 0</pose>'
               '</inertial><collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>'
               "</link>")
TURNING = ((0, 1, 2, 0), (1, 3, 2, 1.0), (3, 1, 2, 2.5))


def mixed_world():
    tags = "".join("<waypoint><time>{}</time><pose>{} {} 0.2 0.3 0.1 {}</pose></waypoint>".format(*point)
                   for point in TURNING)
    two_links = moved(tags).replace("</link><plugin", "</link>" + SECOND_LINK + "<plugin")
    return [two_links.replace('name="a"', 'name="d"', 1), actor(LINE), actor(TURNING, name="b"),
            actor(LINE[:2], "<delay_start>1</delay_start><loop>false</loop>", "c")]


@pytest.mark.parametrize("engine", ["native", "pyode"])
def test_links_move_rigidly_with_their_model(engine):
    with simulation(*mixed_world(), engine=engine) as sim:
        for _ in range(40):
            sim.step(None, 0.1)
            simulator, model = sim.simulator, sim.simulator.models["d"]
            whole, links = state(sim, "d"), model.record.links
            assert len(links) == 2
            for link in links:
                found = simulator.engine.link_state(model.handle.links[link.name])
                expected = compose((whole.position, whole.orientation), link.pose)
                assert found.position == pytest.approx(expected[0], abs=1e-3)
                arm = rotate(whole.orientation, link.pose[0])
                root = simulator.engine.link_state(model.root)
                first = rotate(whole.orientation, links[0].pose[0])
                carried = cross(root.angular_velocity, [arm[k] - first[k] for k in range(3)])
                assert found.linear_velocity == pytest.approx(
                    [root.linear_velocity[k] + carried[k] for k in range(3)], abs=2e-2)


def test_engines_give_equal_numbers():
    traces = []
    for engine in ("native", "pyode"):
        with simulation(*mixed_world(), engine=engine) as sim:
            traces.append([(sim.step(None, 0.07).time,) + tuple(state(sim, name) for name in "abcd")
                           for _ in range(60)])
    assert traces[0] == traces[1]


def groups(sim):
    return [plugin for plugin, _, _ in sim.simulator.plugins.entries() if isinstance(plugin, ScriptedModels)]


def spawn(sim, text, name):
    world = load_world('<sdf version="1.6"><world name="w">%s</world></sdf>' % text, "b.world")
    record = world.models[0]
    return sim.simulator.spawn(replace(record, name=name), record.pose)


def test_members_come_and_go_while_others_stay():
    with simulation(actor(LINE), actor(LINE, name="b")) as sim, simulation(actor(LINE)) as other:
        for each in (sim, other):
            each.step(None, 0.5)
        sim.simulator.delete("b")
        late = spawn(sim, actor(LINE), "c")
        for each in (sim, other):
            each.step(None, 1.0)
        assert state(sim) == state(other)
        assert late.state(sim.simulator.engine).position[0] < state(sim).position[0] - 0.2
        sim.simulator.delete("a")
        sim.simulator.delete("c")
        sim.step(None, 0.5)
        assert len(groups(sim)) == 1 and groups(sim)[0].next_before(sim.simulator.now_ns) is None
        spawn(sim, actor(LINE), "e")
        sim.step(None, 2.0)
        assert state(sim, "e").position == pytest.approx((2.0, 2.0, 0.0), abs=1e-2)


def test_ended_and_waiting_members_are_not_moved():
    """What was placed by hand afterwards, or while waiting, stays there."""
    once = actor(LINE[:2], "<loop>false</loop>", "b")
    wait = actor(LINE[:2], "<delay_start>9</delay_start>", "c")
    with simulation(actor(LINE), once, wait) as sim:
        sim.step(None, 5.0)
        for name in "bc":
            sim.simulator.set_model_state(name, ((0.0, 7.0, 0.0), (0.0, 0.0, 0.0, 1.0)), (0, 0, 0), (0, 0, 0))
        sim.step(None, 1.0)
        assert all(state(sim, name).position == (0.0, 7.0, 0.0) for name in "bc")


def test_script_that_is_not_finite_ends_alone(caplog, monkeypatch):
    """The SDF reader refuses such numbers, so the script is changed after it."""
    read = ActorMotion._read

    def broken(self, spec, ctx):
        if ctx.model_name != "b":
            return read(self, spec, ctx)
        return PoseScript([PoseTrack([0.0, 1.0], [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
                                                  ((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))], None)])

    monkeypatch.setattr(ActorMotion, "_read", broken)
    with simulation(actor(LINE), actor(LINE, name="b")) as sim:
        sim.step(None, 2.0)
        assert state(sim).position == pytest.approx((2.0, 2.0, 0.0), abs=1e-2)
        assert all(map(math.isfinite, state(sim, "b").position))
        assert len(sim.simulator.switched_off()) == 1 and "not finite" in caplog.text


def test_moving_makes_no_static_link_look_placed():
    with simulation(actor(LINE)) as sim:
        engine = sim.simulator.engine
        version, placements = engine.version, engine.placements
        sim.step(None, 0.2)
        assert engine.placed_since(version) == [] and engine.version > version and engine.placements > placements
