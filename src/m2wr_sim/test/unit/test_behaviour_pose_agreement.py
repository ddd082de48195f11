# SPDX-License-Identifier: BSD-3-Clause
"""After any kind of motion, physics, lasers, published states, pictures and map comparison agree on all poses.

Everything is compared with the poses that libode stores.
"""
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Twist

from conftest import UPRIGHT, at, ground
from gazebo_msgs.msg import LinkState, LinkStates, ModelStates
from gazebo_msgs.srv import GetLinkStateRequest, SetLinkStateRequest
from m2wr_sim.api.sim import Sim
from m2wr_sim.api.vector import VectorSim
from m2wr_sim.geometry import compose, quaternion_from_rpy
from m2wr_sim.model.outlines import obstacle_outlines, outlines_of
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import (
    Axis,
    Box,
    Collision,
    Cylinder,
    Inertial,
    Joint,
    Link,
    Model,
    ModelStateEntry,
    Plane,
    PluginSpec,
    RayScan,
    Sphere,
    World,
    WorldState,
)
from m2wr_sim.plugins.world_states import WorldStates
from m2wr_sim.ros.gazebo_services.links import LinkApi
from m2wr_sim.ros.world_markers import WorldMarkers
from m2wr_sim.runtime.forces import Forces
from m2wr_sim.runtime.ports import LocalPort
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_scene import RayScene
from m2wr_view.solids import Solids

REST = (0.0, 0.0, 0.0)
LIGHT = Inertial(1.0, inertia=(0.05, 0.0, 0.0, 0.05, 0.0, 0.05))
TILTED = quaternion_from_rpy(0.1, -0.2, 0.7)
HEIGHTS = (0.1, 0.3, 0.55)          # m, at which scans are compared


def link(name, pose, geometry, offset=((0.1, 0.0, 0.0), UPRIGHT), **values):
    """Return a link whose shape stands beside its frame."""
    return Link(name, pose, LIGHT, (Collision("c", geometry, offset),), gravity=False, **values)


def shelf(name, pose, static=True):
    """Return a model of two own links and one of a nested model, off its own origin and turned."""
    links = (link("foot", at(0.2, 0.1, 0.3, 0.4), Box((0.4, 0.3, 0.6))),
             link("board", at(0.2, 1.1, 0.3), Cylinder(0.2, 0.5), ((0.0, 0.0, 0.0), TILTED)),
             link("drawer::front", at(-0.8, 0.1, 0.3, -0.3), Sphere(0.25)))
    joints = () if static else (
        Joint("swing", "revolute", "foot", "board", axis=Axis(xyz=(0.0, 0.0, 1.0), lower=-2.0, upper=2.0)),
        Joint("drawer::pull", "prismatic", "foot", "drawer::front", axis=Axis(xyz=(1.0, 0.0, 0.0), lower=-1, upper=1)))
    return Model(name, links, joints, pose, static, nested=("drawer",))


def puck():
    """Return what planar_move drives, with a p3d that tells where it is."""
    move = PluginSpec("move", "libgazebo_ros_planar_move.so", (), where="puck")
    tell = PluginSpec("p3d", "libgazebo_ros_p3d.so", (("bodyName", "body"), ("topicName", "truth"),
                                                      ("updateRate", "0")), where="puck")
    return Model("puck", (link("body", at(), Box((0.3, 0.3, 0.3))),), (), at(-4.0, -4.0, 0.3), plugins=(move, tell))


def things():
    return (shelf("fixed", at(3.0, 0.0)), shelf("loose", at(0.0, 3.0, 0.05), static=False),
            Model("post", (link("body", at(z=0.3), Cylinder(0.15, 0.6)),), (), at(-3.0, 0.0), True), puck())


class Agreement:
    """A rig with everything that tells where things are."""

    def __init__(self, rig):
        self.rig, self.simulator, self.engine = rig, rig.simulator, rig.engine
        self.states = LocalPort("models"), LocalPort("links")
        for port, kind in zip(self.states, (ModelStates, LinkStates)):
            port.publish = lambda table, port=port, kind=kind: port.messages.append(table.message(kind))
        self.states_of = WorldStates(self.simulator, *self.states, rate=0)
        self.pictures = LocalPort("markers")
        self.markers = WorldMarkers(self.simulator, self.pictures, "odom", 10.0)
        self.solids = Solids()
        self.laser = LaserSensor(RayScan(samples=181, min_angle=-3.1, max_angle=3.1, range_max=30.0),
                                 np.random.default_rng(0))
        self.links = LinkApi(self.simulator, Forces(self.simulator), as_gazebo=False)

    def truth(self):
        """Return ``{(model, link): (collision, pose of its geom in libode)}`` of all that is no plane."""
        found = {}
        for geom, shape in self.engine._shapes.items():
            if not isinstance(shape.collision.geometry, Plane):
                w, x, y, z = geom.getQuaternion()
                name = shape.name.split("::", 1)[1].rsplit("::", 1)[0]
                found[shape.model, name] = shape.collision, (tuple(geom.getPosition()), (x, y, z, w))
        return found

    def check(self):
        truth = self.truth()
        assert {model for model, _ in truth} == set(self.simulator.models) - {"ground_plane"}
        self._check_states(truth)
        self._check_rays(truth)
        self._check_pictures(truth)
        return truth

    def _check_states(self, truth):
        for (model, name), (collision, pose) in truth.items():
            answer = self.links.get_link_state(GetLinkStateRequest("%s::%s" % (model, name), "")).link_state.pose
            same(compose(read(answer), collision.pose), pose)
            state = self.simulator.model_state(model)
            live = self.simulator.models[model]
            first = live.record.links[0]
            if name == first.name:
                same(compose(compose((state.position, state.orientation), first.pose), collision.pose), pose)
        self.states_of._schedule.restart(self.simulator.now_ns - 10 ** 9)
        self.states_of.before_step(self.simulator.now_ns)
        told = self.states[1].messages[-1]
        for scoped, where in zip(told.name, told.pose):
            model, name = scoped.split("::")
            if (model, name) in truth:
                collision, pose = truth[model, name]
                same(compose(read(where), collision.pose), pose)
        told = dict(zip(self.states[0].messages[-1].name, self.states[0].messages[-1].pose))
        for model in self.simulator.models:
            state = self.simulator.model_state(model)
            same(read(told[model]), (state.position, state.orientation))

    def _check_rays(self, truth):
        expected = RayScene()
        expected.add(Plane(), at(), "ground")
        for collision, pose in truth.values():
            expected.add(collision.geometry, pose, "thing")
        self.simulator.refresh_scene()
        met = 0
        for height in HEIGHTS:
            for place in ((1.3, 1.2), (-1.5, -2.0)):
                eye = (place + (height,), UPRIGHT)
                ranges = [self.laser.cast(scene, eye)[0].copy() for scene in (self.simulator.scene, expected)]
                met += np.isfinite(ranges[1]).sum()
                assert ranges[0] == pytest.approx(ranges[1], abs=1e-6)
        assert met > 50, "the lasers look past everything"

    def _check_pictures(self, truth):
        self.markers.look(self.simulator.now_ns)
        markers = self.pictures.messages[-1].markers
        shown = {}
        for marker in markers[1:]:
            shown.setdefault(marker.ns, []).append(marker.pose)
        for model, live in self.simulator.models.items():
            if model in ("ground_plane", "puck"):           # neither ground nor robots are shown by markers
                continue
            for record, pose in zip(live.record.links, shown[model]):
                same(read(pose), truth[model, record.name][1], 1e-3)       # what moves less is not sent again
        self.solids.update(markers)
        outlines = [outline for (model, _), (collision, pose) in truth.items() if model != "puck"
                    for outline in outlines_of(collision.geometry, pose)]
        assert middles(self.solids.blocking) == pytest.approx(middles(outlines), abs=2e-3)


def middles(outlines):
    """Return where outlines are, in an order of their own; (n, 2) [m]."""
    found = [np.mean(outline.vertices, axis=0) for outline in outlines]
    return np.array(sorted(found, key=lambda middle: tuple(np.round(middle, 1))))


def read(pose):
    where, turn = pose.position, pose.orientation
    return (where.x, where.y, where.z), (turn.x, turn.y, turn.z, turn.w)


def same(one, two, tolerance=1e-9):
    assert one[0] == pytest.approx(two[0], abs=tolerance)
    assert abs(float(np.dot(one[1], two[1]))) == pytest.approx(1.0, abs=tolerance)


@pytest.fixture
def scenery(make_rig):
    """Return an :class:`Agreement` over models of all kinds, all of them looked at once before anything moves."""
    agreement = Agreement(make_rig(*things(), joint_states=False))
    agreement.before = agreement.check()
    return agreement


def run(scenery, seconds=0.05):
    scenery.rig.run(seconds)


def set_models(scenery):
    for name in ("fixed", "loose", "post", "puck"):
        (x, y, z), _ = scenery.simulator.model_state(name)[:2]
        scenery.simulator.set_model_state(name, ((x + 0.7, y - 0.4, z + 0.1), quaternion_from_rpy(0.0, 0.0, 0.6)),
                                          REST, REST)


def set_model_relative_to_another(scenery):
    scenery.simulator.set_model_state("post", at(0.0, 1.5), REST, REST, "loose")
    scenery.simulator.set_model_state("loose", at(1.0, 0.5, 0.1), REST, REST, "fixed::board")


def set_links(scenery):
    for name in ("fixed::foot", "fixed::board", "fixed::drawer::front", "loose::board", "post::body"):
        pose = Pose(Point(1.0 + 0.3 * len(name), -1.5, 0.3), Quaternion(0.0, 0.0, 0.6, 0.8))
        answer = scenery.links.set_link_state(SetLinkStateRequest(LinkState(name, pose, Twist(), "")))
        assert answer.success, answer.status_message


def set_link_then_its_model(scenery):
    set_links(scenery)
    set_models(scenery)


def bend(scenery):
    scenery.simulator.set_joint_positions("loose", {"swing": 0.9, "drawer::pull": -0.4})


def push(scenery):
    scenery.simulator.set_model_state("loose", at(0.0, 3.0, 0.05), (1.0, 0.5, 0.0), (0.0, 0.0, 0.8))
    run(scenery, 0.3)


def motors(scenery):
    joints = scenery.simulator.models["loose"].handle.joints
    scenery.engine.set_joint_motor(joints["swing"], 2.0, 5.0)
    scenery.engine.set_joint_motor(joints["drawer::pull"], 0.5, 20.0)
    run(scenery, 0.4)


def planar_move(scenery):
    command = Twist()
    command.linear.x, command.angular.z = 0.8, 1.0
    scenery.rig.ports.send("/cmd_vel", command)
    run(scenery, 0.5)
    (x, y, z), _ = scenery.simulator.model_state("puck")[:2]
    scenery.simulator.advance(scenery.simulator.now_ns + scenery.simulator.step_ns)
    told = scenery.rig.messages("/truth")[-1].pose.pose.position
    assert (told.x, told.y, told.z) == pytest.approx((x, y, z), abs=2e-3)      # within what it moves in a step


def reset_world(scenery):
    set_link_then_its_model(scenery)
    run(scenery)
    scenery.simulator.reset_world()


def reset_simulation(scenery):
    set_link_then_its_model(scenery)
    bend(scenery)
    run(scenery)
    scenery.simulator.reset_simulation()
    for part, (_, pose) in scenery.before.items():
        same(scenery.truth()[part][1], pose, 1e-6)


def stored_state(scenery):
    """Apply a state as a world file or a snapshot holds it: models, links, nested links, static and not."""
    scenery.simulator.apply_state(state())


def state():
    return WorldState(2 * 10 ** 9, (
        ModelStateEntry("post", at(-2.0, 1.0, 0.05, 0.5)), ModelStateEntry("loose", at(0.5, 2.5, 0.1, -0.5)),
        ModelStateEntry("fixed", at(2.5, -1.0, 0.0, 0.8), (
            ("board", ((2.0, -2.0, 0.4), TILTED), None), ("drawer::front", at(4.0, -2.0, 0.4), (REST, REST))))))


def half_of_a_stored_state(scenery):
    """Refuse what is out of range; earlier changes stay applied in all places."""
    scenery.simulator.apply_state(WorldState(0, (ModelStateEntry("fixed", at(2.0, -1.5), (
        ("board", at(1e300), None), ("drawer::front", at(4.0, -2.0, 0.4), None))),)))


def respawn(scenery):
    for name in ("fixed", "loose", "post"):
        record = scenery.simulator.models[name].record
        scenery.simulator.delete(name)
        scenery.simulator.spawn(record, at(-2.0 if record.static else 2.5, 2.0, 0.1, 1.0), name)
        run(scenery, 0.01)


def spawn_more_after_moving(scenery):
    set_models(scenery)
    scenery.simulator.spawn(shelf("second", at()), at(-1.0, -4.0, 0.0, 2.0))
    set_links(scenery)


def drag(scenery):
    """Put an obstacle somewhere again and again between steps, as a mouse does."""
    for step in range(20):
        scenery.simulator.set_model_state("post", at(-3.0 + 0.1 * step, 0.05 * step), REST, REST)
        run(scenery, 0.02)


def drag_while_paused(scenery):
    scenery.simulator.paused = True
    set_models(scenery)


def inertial(scenery):
    live = scenery.simulator.models["loose"]
    for record in live.record.links:
        scenery.engine.set_link_inertial(live.handle.links[record.name],
                                         replace(record.inertial, pose=((0.05, 0.02, 0.1), UPRIGHT)))


def behind_everybodys_back(scenery):
    """Move links by the engine alone, as a plugin may."""
    for name, live in scenery.simulator.models.items():
        if name != "ground_plane":
            for number in live.handle.links.values():
                scenery.engine.set_link_pose(number, compose(at(0.5, 0.3, 0.0, 0.2), scenery.engine.link_pose(number)))


WAYS = (run, set_models, set_model_relative_to_another, set_links, set_link_then_its_model, bend, push, motors,
        planar_move, reset_world, reset_simulation, stored_state, half_of_a_stored_state, respawn,
        spawn_more_after_moving, drag, drag_while_paused, inertial, behind_everybodys_back)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_all_agree_however_things_are_moved(scenery, way):
    way(scenery)
    scenery.check()
    scenery.simulator.paused = False
    run(scenery, 0.02)
    scenery.check()


def test_a_world_is_compared_where_its_state_puts_it(make_rig):
    world = World(models=things(), state=state())
    agreement = Agreement(make_rig(world=replace(world, models=(ground(),) + world.models), joint_states=False))
    truth = agreement.check()
    placed = [(model.name, collision, pose) for model, collision, pose in placed_collisions(world)]
    assert len(placed) == len(truth)
    assert obstacle_outlines(world)
    for (_, collision, pose), (known, there) in zip(placed, truth.values()):
        assert collision is known
        same(pose, there)


@pytest.mark.parametrize("what", ["fixed", "loose"])
def test_the_interface_for_python_agrees(engine_kind, what):
    with Sim(World(models=things(), state=state()), engine=engine_kind) as sim:
        agreement = Agreement(type("Rig", (), {"simulator": sim.simulator, "engine": sim.simulator.engine}))
        start = agreement.check()
        sim.set_pose((1.0, -3.0, 0.0), what)
        agreement.check()
        sim.step(duration=0.05)
        agreement.check()
        sim.reset()
        for part, (_, pose) in agreement.check().items():
            same(pose, start[part][1], 1e-6)


def test_the_worlds_of_a_vector_agree(engine_kind, m2wr):
    with VectorSim(2, World(models=things(), state=state()), m2wr, (5.0, 5.0, 0.0), engine=engine_kind) as vector:
        vector.step((0.3, 0.2))
        vector.reset(poses=(-5.0, 5.0, 1.0), where=[False, True])
        for sim in vector.sims:
            sim.delete("m2wr")              # its wheels are set straight in physics by less than a thousandth
            Agreement(type("Rig", (), {"simulator": sim.simulator, "engine": sim.simulator.engine})).check()
