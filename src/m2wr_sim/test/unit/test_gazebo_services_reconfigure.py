# SPDX-License-Identifier: BSD-3-Clause
"""The dynamic parameters: Gazebo's names, types and ranges, and how they change the physics."""
from dataclasses import replace
from types import SimpleNamespace

import pytest

from m2wr_sim.model.types import Physics
from m2wr_sim.ros.gazebo_services import reconfigure as dynamic

UNUSED = {"auto_disable_bodies", "sor_pgs_rms_error_tol"}


def test_names_kinds_and_ranges_are_those_of_gazebo():
    ranges = {name: entry[:3] for name, entry in dynamic.PARAMETERS.items()}
    assert ranges == {
        "time_step": (float, 0.0, 10.0), "max_update_rate": (float, 0.0, 1000.0), "gravity_x": (float, -100.0, 100.0),
        "gravity_y": (float, -100.0, 100.0), "gravity_z": (float, -100.0, 100.0),
        "auto_disable_bodies": (bool, False, True), "sor_pgs_precon_iters": (int, 0, 10000),
        "sor_pgs_iters": (int, 0, 10000), "sor_pgs_w": (float, 0.0, 5.0), "sor_pgs_rms_error_tol": (float, -1, 10000),
        "cfm": (float, 0.0, 10.0), "erp": (float, 0.0, 10.0), "contact_surface_layer": (float, 0.0, 10.0),
        "contact_max_correcting_vel": (float, 0.0, 1e7), "max_contacts": (int, 0, 10000000)}


def test_values_and_physics_convert_to_each_other():
    physics = Physics(0.002, 250.0, (1.0, 2.0, 3.0), 5, iters=70, precon_iters=2, sor=1.1, cfm=0.1, erp=0.3,
                      contact_max_correcting_vel=7.0, contact_surface_layer=0.02)
    values = dynamic.values_of(physics)
    assert set(values) == set(dynamic.PARAMETERS) and all(values[name] == 0 for name in UNUSED)
    assert all(type(values[name]) is entry[0] for name, entry in dynamic.PARAMETERS.items())
    assert replace(Physics(), **dynamic.fields_of(values)) == physics


def test_the_description_is_one_that_the_server_understands():
    encoding = pytest.importorskip("dynamic_reconfigure.encoding")
    values = dynamic.values_of(Physics())
    message = encoding.encode_description(dynamic.description(values))
    decoded = encoding.decode_description(message)
    assert {entry["name"]: entry["default"] for entry in decoded["parameters"]} == values
    assert {entry["name"]: entry["type"] for entry in decoded["parameters"]} == {
        name: {float: "double", int: "int", bool: "bool"}[entry[0]] for name, entry in dynamic.PARAMETERS.items()}


class Told:
    """dynamic_reconfigure's server as far as a change goes: merge, bring into range, ask, keep the answer."""

    def __init__(self, _, callback):
        self.callback, self.config = callback, {"groups": {}}
        self.config = callback(dict(self.config), ~0)

    def update_configuration(self, changes):
        config = dict(self.config, **changes)
        for name, (_, least, most, _, _) in dynamic.PARAMETERS.items():
            config[name] = min(max(config[name], least), most)
        self.config = self.callback(config, 0)


@pytest.fixture
def served(monkeypatch):
    """Return a Reconfigure over a stand-in of the server, with its server, physics and the list of changes made."""
    monkeypatch.setattr(dynamic, "Server", Told)
    simulator, changes = SimpleNamespace(physics=replace(Physics(), real_time_update_rate=5000.0)), []

    def change(fields):
        changes.append(fields)
        simulator.physics = replace(simulator.physics, **fields)

    loop = SimpleNamespace(call=lambda function: function())
    reconfigure = dynamic.Reconfigure(simulator, loop, SimpleNamespace(change=change))
    return SimpleNamespace(reconfigure=reconfigure, server=reconfigure._server, simulator=simulator, loop=loop,
                           changes=changes)


def test_a_value_beyond_its_range_stays_unless_it_is_changed(served):
    """Five times real time at 1 ms is 5000 steps a second, which dynamic_reconfigure brings down to 1000."""
    served.server.update_configuration({})
    assert served.changes == []
    served.server.update_configuration({"gravity_z": -1.0})
    assert served.changes[0]["gravity"] == (0.0, 0.0, -1.0) and served.changes[0]["real_time_update_rate"] == 5000.0
    served.server.update_configuration({"max_update_rate": 200.0})
    assert served.changes[1]["real_time_update_rate"] == 200.0
    assert served.server.config["max_update_rate"] == 200.0 and served.server.config["gravity_z"] == -1.0


def test_notify_sets_nothing_while_a_client_sets_values(served):
    """Two services set the physics one after the other; the first one tells of it only then."""
    served.simulator.physics = replace(served.simulator.physics, max_step_size=0.002)
    call = served.loop.call

    def late(function):
        served.simulator.physics = replace(served.simulator.physics, max_step_size=0.005)
        return call(function)

    served.loop.call = late
    served.reconfigure.notify()
    served.loop.call = call
    served.reconfigure.notify()
    assert served.changes == [] and served.server.config["time_step"] == served.simulator.physics.max_step_size


def test_a_change_keeps_values_that_a_service_has_just_set(served):
    served.simulator.physics = replace(served.simulator.physics, max_step_size=0.002)
    served.server.update_configuration({"gravity_z": -1.0})
    assert served.simulator.physics.max_step_size == 0.002 and served.simulator.physics.gravity[2] == -1.0
    assert served.server.config["time_step"] == 0.002
