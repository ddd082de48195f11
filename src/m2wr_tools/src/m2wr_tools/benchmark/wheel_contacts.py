# SPDX-License-Identifier: BSD-3-Clause
"""Wheels on planes, steps, ramps and slopes, beside closed forms: ``benchmark --contacts``.

The ground is of boxes, meshes and heightmaps, the steps of the simulation are 1, 2, 5 and 10 ms.
"""
from __future__ import annotations

import contextlib
import math
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple, Union
from unittest import mock

import numpy as np

from m2wr_sim.api.loading import read_robot
from m2wr_sim.geometry import Pose, quaternion_from_rpy, rpy_from_quaternion
from m2wr_sim.model.types import (
    Axis,
    Box,
    Collision,
    Cylinder,
    Heightmap,
    Inertial,
    Joint,
    Link,
    Mesh,
    Model,
    Plane,
    Surface,
)
from m2wr_sim.physics import contacts, height_contacts
from m2wr_sim.physics.engine import Engine, EngineSettings, LinkState, ModelHandle
from m2wr_sim.physics.factory import make_engine

STEPS = (1, 2, 5, 10)                                           # ms
RADIUS, WIDTH, TRACK, STEP_HEIGHT = 0.1, 0.04, 0.4, 0.02        # m, of the axle's wheels and of a step
BODY, WHEEL, SPIN = 5.0, 0.2, 0.002     # kg of the axle and of a wheel; kg m^2 of both wheels about their axis
GRAVITY = 9.8                                                   # m/s^2
SHARE = SPIN / ((BODY + 2.0 * WHEEL) * RADIUS ** 2)             # of the energy of a rolling axle that turns its wheels
RAMP, SLOPE = math.radians(10.0), math.radians(20.0)
TURNS = ((0.0, 0.3), (0.0, 0.7), (0.2, -0.3), (0.5, 0.5))       # m/s, rad/s
BY_LIBODE = "heightmap, by libode"
_LOWEST, _HIGHEST, _FINE = 0.2, 1.0, 0.01                       # m/s: of the search for a speed, and its resolution
_CLIMB, _ROLL, _SETTLE, _CREEP, _DRIVE = 2.2, 1.5, 1.5, 1.0, 4.0        # s
_FORCE, _BRAKE = 5.0, 50.0                                      # N m of m2wr's motors
_SPEED = 0.5                                                    # m/s of its wheels, up a slope
_START = 0.003                                                  # m: second start, for contacts depend on the place
_ROUGH = Surface(mu=100.0, mu2=100.0)
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)
_LEVEL: Pose = ((0.0, 0.0, 0.0), _UPRIGHT)
_Shape = Union[Box, Heightmap, Mesh, Plane]


def _axle() -> Model:
    """Return two free wheels on one axle."""
    links = [Link("body", inertial=Inertial(BODY, inertia=(0.05, 0, 0, 5.0, 0, 0.05)))]
    across, joints = quaternion_from_rpy(-0.5 * math.pi, 0.0, 0.0), []
    for name, y in (("left", 0.5 * TRACK), ("right", -0.5 * TRACK)):
        links.append(Link(
            name, pose=((0.0, y, 0.0), _UPRIGHT),
            inertial=Inertial(WHEEL, ((0.0,) * 3, across), (5e-4, 0, 0, 5e-4, 0, 0.5 * SPIN)),
            collisions=(Collision("c", Cylinder(RADIUS, WIDTH), ((0.0,) * 3, across), surface=_ROUGH),)))
        joints.append(Joint("to_" + name, "revolute", "body", name, axis=Axis((0.0, 1.0, 0.0))))
    return Model("axle", tuple(links), tuple(joints))


def _ground(shape: _Shape, pose: Pose = _LEVEL, name: str = "ground") -> Model:
    return Model(name, (Link("link", collisions=(Collision("c", shape, surface=_ROUGH),)),), pose=pose, static=True)


def _field(height: Callable[[Any, Any], Any], size: Tuple[float, float], cell: float) -> Heightmap:
    across, up = (np.linspace(-0.5 * side, 0.5 * side, int(round(side / cell)) + 1) for side in size)
    x, y = np.meshgrid(across, up[::-1])
    return Heightmap(height(x, y), size)


def _strip(profile: Sequence[Tuple[float, float]], half: float = 1.0) -> Mesh:
    """Return a mesh with a profile of points x, z, so wide to either side."""
    places = [(x, y, z) for x, z in profile for y in (-half, half)]
    return Mesh(np.array(places), np.array([part for k in range(0, len(places) - 2, 2)
                                            for part in ((k, k + 2, k + 3), (k, k + 3, k + 1))]))


def _mesh(slope: float, cells: Tuple[int, int]) -> Mesh:
    """Return a mesh of 12 m x 2 m that rises along x, of so many cells along x and y, of two triangles each."""
    across, up = np.linspace(-6.0, 6.0, cells[0] + 1), np.linspace(-1.0, 1.0, cells[1] + 1)
    places = np.array([(x, y, slope * x) for x in across for y in up])
    firsts = [row * len(up) + column for row in range(cells[0]) for column in range(cells[1])]
    return Mesh(places, np.array([part for k in firsts for part in (
        (k, k + len(up), k + len(up) + 1), (k, k + len(up) + 1, k + 1))]))


def _inclined(angle: float) -> Dict[str, Model]:
    """Return ground that rises along x by an angle [rad], of each kind."""
    slope = math.tan(angle)
    lying = ((0.5 * math.sin(angle), 0.0, -0.5 * math.cos(angle)), quaternion_from_rpy(0.0, -angle, 0.0))
    return {"box": _ground(Box((12.0, 2.0, 1.0)), lying),
            "heightmap, cells of 20 cm": _ground(_field(lambda x, y: slope * x + 0.0 * y, (12.0, 2.0), 0.2)),
            "heightmap, cells of 2 cm": _ground(_field(lambda x, y: slope * x + 0.0 * y, (12.0, 2.0), 0.02)),
            "mesh, one cell": _ground(_mesh(slope, (1, 1))),
            "mesh, cells of 10 cm": _ground(_mesh(slope, (120, 20)))}


def _kerbs() -> Dict[str, List[Model]]:
    """Return a step up along x, at x = 0.5 m, of each kind."""
    field = _ground(_field(lambda x, y: np.where(x > 0.495, STEP_HEIGHT, 0.0), (6.0, 2.0), 0.01))
    profile = ((-3.0, 0.0), (0.5, 0.0), (0.5, STEP_HEIGHT), (3.0, STEP_HEIGHT))
    box = _ground(Box((2.0, 2.0, STEP_HEIGHT)), ((1.5, 0.0, 0.5 * STEP_HEIGHT), _UPRIGHT), "kerb")
    return {"box": [_ground(Plane(size=(100.0, 100.0))), box], "heightmap": [field],
            "mesh": [_ground(_strip(profile))], BY_LIBODE: [field]}


@contextlib.contextmanager
def _engine(step_ms: int, models: Sequence[Model], kind: str = "") -> Iterator[Engine]:
    """Return an engine with static models; for BY_LIBODE libode itself finds the contacts of heightmaps."""
    with contextlib.ExitStack() as stack:
        if kind == BY_LIBODE:
            stack.enter_context(mock.patch.object(height_contacts, "find", return_value=None))
        engine = make_engine("pyode" if kind == BY_LIBODE else "auto", EngineSettings(step_ns=step_ms * 1000000))
        stack.callback(engine.close)
        for model in models:
            engine.add_model(model, model.pose)
        yield engine


def _rolled(step_ms: int, models: Sequence[Model], kind: str, speed: float, start: float, duration: float) -> LinkState:
    """Let the axle roll along x on level ground; return the state of its body at the end."""
    with _engine(step_ms, models, kind) as engine:
        handle = engine.add_model(_axle(), ((start, 0.0, RADIUS - 1e-4), _UPRIGHT))
        for name, link in handle.links.items():
            engine.set_link_velocity(link, (speed, 0.0, 0.0), (0.0, speed / RADIUS if name != "body" else 0.0, 0.0))
        engine.step(int(round(1000.0 * duration)) // step_ms)
        return engine.link_state(handle.links["body"])


def least_speed(step_ms: int, models: Sequence[Model], kind: str = "") -> float:
    """Return the least speed with which the axle climbs the step, from two starts, to 0.01 m/s [m/s].

    Parameters
    ----------
    step_ms : int
        Of the simulation.
    models : sequence of Model
        The ground, with the step.
    kind : str
        BY_LIBODE, or another.
    """
    low, high = int(round(_LOWEST / _FINE)), int(round(_HIGHEST / _FINE))
    while low < high:
        middle = (low + high) // 2
        climbs = all(_rolled(step_ms, models, kind, middle * _FINE, start, _CLIMB).position[2]
                     > RADIUS + 0.9 * STEP_HEIGHT for start in (0.0, _START))
        low, high = (low, middle) if climbs else (middle + 1, high)
    return low * _FINE


def due_speeds() -> Tuple[float, float]:
    """Return the least speed to climb the step, and what is left of 1 m/s [m/s].

    At the edge the angular momentum about it stays; then energy lifts the axle.
    """
    lever = (RADIUS - STEP_HEIGHT + SHARE * RADIUS) / ((1.0 + SHARE) * RADIUS)
    lift = 2.0 * GRAVITY * STEP_HEIGHT / (1.0 + SHARE)
    return math.sqrt(lift) / lever, math.sqrt(lever ** 2 - lift)


def down(step_ms: int, ground: Model) -> Tuple[float, float]:
    """Let the axle roll down a ramp that falls along x.

    Parameters
    ----------
    step_ms : int
        Of the simulation.
    ground : Model
        Of RAMP.

    Returns
    -------
    (float, float)
        Share of the energy that is lost, and drift aside [m].
    """
    with _engine(step_ms, [ground]) as engine:
        pose = ((-3.0 + RADIUS * math.sin(RAMP), 0.0, 3.0 * math.tan(RAMP) + RADIUS * math.cos(RAMP)),
                quaternion_from_rpy(0.0, RAMP, 0.0))
        body = engine.add_model(_axle(), pose).links["body"]
        top = engine.link_state(body).position[2]
        engine.step(int(1000.0 * _ROLL) // step_ms)
        state = engine.link_state(body)
    due = 2.0 * GRAVITY * (top - state.position[2]) / (1.0 + SHARE)
    return 1.0 - sum(value * value for value in state.linear_velocity) / due, abs(state.position[1])


def _robot_on(engine: Engine, angle: float) -> ModelHandle:
    """Add m2wr, which faces up a slope of an angle [rad]."""
    return engine.add_model(read_robot("m2wr"), ((-0.1 * math.sin(angle), 0.0, 0.1 * math.cos(angle)),
                                                 quaternion_from_rpy(0.0, -angle, 0.0)))


def rest(step_ms: int, ground: Model) -> Tuple[float, float]:
    """Put m2wr with braked wheels on a slope.

    Parameters
    ----------
    step_ms : int
        Of the simulation.
    ground : Model
        Of SLOPE.

    Returns
    -------
    (float, float)
        How far it slides until it rests [m], and how fast it creeps then [m/s].
    """
    with _engine(step_ms, [ground]) as engine:
        handle = _robot_on(engine, SLOPE)
        for joint in handle.joints.values():
            engine.set_joint_motor(joint, 0.0, _BRAKE)
        places = [engine.link_state(handle.links["link_chassis"]).position]
        for duration in (_SETTLE, _CREEP):
            engine.step(int(1000.0 * duration) // step_ms)
            places.append(engine.link_state(handle.links["link_chassis"]).position)
    return math.dist(places[0], places[1]), math.dist(places[1], places[2]) / _CREEP


def turn(linear: float, rate: float, merged: bool = True) -> float:
    """Return the yaw rate that m2wr reaches on a plane at steps of 1 ms, divided by the commanded one.

    Parameters
    ----------
    linear, rate : float
        The command [m/s, rad/s].
    merged : bool
        Whether the contacts of a wheel are one, as always in this simulator; False: those at its two edges stay.
    """
    with contextlib.ExitStack() as stack:
        if not merged:
            stack.enter_context(mock.patch.object(contacts, "MERGE_ALL", 0))
        engine = stack.enter_context(_engine(1, [_ground(Plane(size=(100.0, 100.0)))]))
        handle = _robot_on(engine, 0.0)
        # the wheel named left stands at y = -0.2, on the right
        for name, sign in (("joint_left_wheel", 1.0), ("joint_right_wheel", -1.0)):
            engine.set_joint_motor(handle.joints[name], (linear + sign * 0.5 * TRACK * rate) / RADIUS, _FORCE)
        engine.step(1000)
        chassis = handle.links["link_chassis"]
        before, turned = rpy_from_quaternion(engine.link_state(chassis).orientation)[2], 0.0
        for _ in range(int(_DRIVE / 0.1)):
            engine.step(100)
            yaw = rpy_from_quaternion(engine.link_state(chassis).orientation)[2]
            turned, before = turned + math.remainder(yaw - before, 2.0 * math.pi), yaw
    return turned / _DRIVE / rate


def climb(angle: float, ground: Model) -> float:
    """Let m2wr drive up a slope from rest for 1.5 s, at steps of 1 ms.

    Parameters
    ----------
    angle : float
        Of the slope [rad].
    ground : Model

    Returns
    -------
    float
        Its path, divided by that of its wheels.
    """
    with _engine(1, [ground]) as engine:
        handle = _robot_on(engine, angle)
        chassis = handle.links["link_chassis"]
        for brake in (True, False):
            for joint in handle.joints.values():
                engine.set_joint_motor(joint, 0.0 if brake else _SPEED / RADIUS, _BRAKE if brake else _FORCE)
            place = engine.link_state(chassis).position
            turned = [engine.joint_angle(joint) for joint in handle.joints.values()]
            engine.step(int(1000.0 * _ROLL))
        way = RADIUS * float(np.mean([engine.joint_angle(joint) - before
                                      for joint, before in zip(handle.joints.values(), turned)]))
        return math.dist(place, engine.link_state(chassis).position) / abs(way)


def _rows(title: str, heads: Sequence[str], rows: Sequence[Tuple[str, Sequence[str]]]) -> List[str]:
    return (["| {} | {} |".format(title, " | ".join(heads)), "| --- |" + " --- |" * len(heads)]
            + ["| {} | {} |".format(name, " | ".join(cells)) for name, cells in rows] + [""])


def report(steps: Optional[Sequence[int]] = None) -> str:
    """Return the tables.

    Parameters
    ----------
    steps : sequence of int, optional
        Of the simulation [ms]; default: STEPS.
    """
    steps = STEPS if steps is None else steps
    heads, least, left = ["{} ms".format(step) for step in steps], *due_speeds()
    lines = _rows("contacts of a wheel; yaw rate / command", ["{:g} m/s, {:g} rad/s".format(*each) for each in TURNS], [
        (name, ["{:.3f}".format(turn(*each, merged=merged)) for each in TURNS])
        for name, merged in (("one, merged", True), ("two", False))])
    kerbs = _kerbs()
    lines += _rows("least speed to climb 2 cm, due {:.2f} m/s".format(least), heads, [
        (kind, [_speed(least_speed(step, models, kind)) for step in steps]) for kind, models in kerbs.items()])
    lines += _rows("left of 1 m/s, due {:.2f} m/s".format(left), heads, [
        (kind, ["{:.2f}".format(_rolled(step, models, kind, 1.0, 0.0, 1.7).linear_velocity[0]) for step in steps])
        for kind, models in kerbs.items()])
    rolls = {kind: [down(step, ground) for step in steps] for kind, ground in _inclined(-RAMP).items()}
    lines += _rows("energy lost on 10 degrees", heads, [
        (kind, ["{:.1f} %".format(100.0 * lost) for lost, _ in found]) for kind, found in rolls.items()])
    lines += _rows("drift aside [mm]", heads, [
        (kind, ["{:.1f}".format(1e3 * aside) for _, aside in found]) for kind, found in rolls.items()])
    gentle, steep = _inclined(RAMP), _inclined(SLOPE)
    rests = {kind: [rest(step, ground) for step in steps] for kind, ground in steep.items()}
    lines += _rows("braked m2wr on 20 degrees: creep [mm/s]", heads, [
        (kind, ["{:.4f}".format(1e3 * creep) for _, creep in found]) for kind, found in rests.items()])
    lines += _rows("the same, slid before [mm]", heads, [
        (kind, ["{:.1f}".format(1e3 * slid) for slid, _ in found]) for kind, found in rests.items()])
    lines += _rows("m2wr drives up for 1.5 s: path / that of its wheels", ["10 degrees", "20 degrees"], [
        (kind, ["{:.2f}".format(climb(RAMP, gentle[kind])), "{:.2f}".format(climb(SLOPE, steep[kind]))])
        for kind in gentle])
    return "\n".join(lines)


def _speed(value: float) -> str:
    return "< {:.2f}".format(_LOWEST + _FINE) if value < _LOWEST + 0.5 * _FINE else "{:.2f}".format(value)
