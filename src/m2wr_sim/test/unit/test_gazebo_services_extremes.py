# SPDX-License-Identifier: BSD-3-Clause
"""Extreme numbers in every field of every service: an answer, and a simulation that stays finite and continues."""
import math
from types import SimpleNamespace

import pytest
import rospy

from conftest import at
from m2wr_sim.ros.gazebo_services.gazebo_api import GazeboApi
from m2wr_sim.ros.gazebo_services.joints import JointApi
from m2wr_sim.ros.gazebo_services.lights import LightApi
from m2wr_sim.ros.gazebo_services.links import LinkApi
from m2wr_sim.ros.gazebo_services.physics import PhysicsApi
from m2wr_sim.ros.gazebo_services.table import SERVICES
from m2wr_sim.runtime.forces import Forces

FLOATS = (1.7976931348623157e308, -1.7976931348623157e308, 5e-324, 1e16, -1e16, 1e9, -1e9, math.nan, math.inf)
ENDS = {"float64": FLOATS, "float32": (3.4e38, -3.4e38, math.nan), "uint8": (0, 255), "int8": (-128, 127),
        "uint32": (0, 4294967295), "int32": (-2147483648, 2147483647),
        "time": (rospy.Time(0), rospy.Time(4294967295, 999999999)),
        "duration": (rospy.Duration(-2147483648), rospy.Duration(2147483647, 999999999), rospy.Duration(0, 1))}
NAMES = {"model_name": "m2wr", "link_name": "m2wr::link_chassis", "body_name": "m2wr::link_left_wheel",
         "joint_name": "joint_left_wheel", "light_name": "lamp"}
SAFE = {"mass": 5.0, "ixx": 0.1, "iyy": 0.1, "izz": 0.1, "time_step": 0.001, "max_update_rate": 1000.0, "w": 1.0,
        "gravity_mode": True}
MUTATING = [name for name in SERVICES if name.startswith(("set_", "apply_"))]


def leaves(message, path=()):
    """Yield ``(path, type)`` of all numbers in a message, those of lists as their first entry."""
    for name, kind in zip(message.__slots__, message._slot_types):
        value = getattr(message, name)
        if hasattr(value, "__slots__") and hasattr(value, "_slot_types"):
            yield from leaves(value, path + (name,))
        elif kind.rstrip("[]") in ENDS:
            yield path + (name,), kind


def fill(message):
    """Give a request names that exist and numbers that do no harm."""
    for name, kind in zip(message.__slots__, message._slot_types):
        value = getattr(message, name)
        if hasattr(value, "_slot_types"):
            fill(value)
        elif name in NAMES:
            setattr(message, name, NAMES[name])
        elif name in SAFE:
            setattr(message, name, SAFE[name])
        elif kind == "string[]":
            setattr(message, name, ["joint_left_wheel"])
        elif kind == "float64[]" and name == "joint_positions":
            setattr(message, name, [0.0])
    return message


def put(message, path, kind, value):
    for name in path[:-1]:
        message = getattr(message, name)
    setattr(message, path[-1], [value] if kind.endswith("[]") else value)


def requests():
    for name in MUTATING:
        made = SERVICES[name]._request_class()
        for path, kind in leaves(made):
            for value in ENDS[kind.rstrip("[]")]:
                yield name, path, kind, value


@pytest.fixture(params=[True, False], ids=["as_gazebo", "right"])
def apis(request, m2wr_rig, build):
    rig = m2wr_rig(build.box("crate", 3.0, 0.0, 0.25, static=False))
    forces = Forces(rig.simulator)
    rig.simulator.add_observer(forces, "forces")
    api = GazeboApi.__new__(GazeboApi)          # the services themselves, without a network
    api._simulator, api._sequence = rig.simulator, {}
    parts = (api, LinkApi(rig.simulator, forces, request.param), PhysicsApi(rig.simulator, lambda factor: None),
             JointApi(rig.simulator, forces), LightApi(rig.simulator))
    return SimpleNamespace(rig=rig, forces=forces,
                           handler=lambda name: next(getattr(part, name) for part in parts if hasattr(part, name)))


def test_every_number_of_every_service_at_its_ends(apis, m2wr):
    rig, cases = apis.rig, 0
    for name, path, kind, value in requests():
        request = fill(SERVICES[name]._request_class())
        put(request, path, kind, value)
        where = "%s %s = %r" % (name, ".".join(path), value)
        try:
            answer = apis.handler(name)(request)
        except Exception as error:
            raise AssertionError("%s: %s: %s" % (where, type(error).__name__, error)) from error
        assert isinstance(answer, SERVICES[name]._response_class), where
        for _ in range(3):
            rig.simulator.advance(rig.simulator.now_ns + rig.simulator.step_ns)
        rig.simulator.settle()
        for model in rig.simulator.models.values():
            for link in model.handle.links.values():
                assert all(math.isfinite(number) for part in rig.engine.link_state(link) for number in part), where
        apis.handler("get_physics_properties")(None)
        cases += 1
        if "m2wr" not in rig.simulator.models:      # thrown out of the world, removed and named: put back for the next
            rig.simulator.spawn(m2wr, at(z=0.1), namespace="/")
        apis.forces._links, apis.forces._joints = [], []
    assert cases > 500
