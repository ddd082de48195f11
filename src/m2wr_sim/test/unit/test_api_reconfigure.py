"""The dynamic parameters: Gazebo's names, kinds and ranges, and the way to the physics and back."""
from dataclasses import replace
from types import SimpleNamespace

import pytest

from m2wr_sim.model.types import Physics
from m2wr_sim.ros import api_reconfigure as dynamic

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


def test_values_are_the_physics_and_lead_back_to_it():
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


def test_what_is_beyond_its_range_stays_as_it_is_unless_it_is_touched():
    """Five times real time at 1 ms is 5000 steps a second, which dynamic_reconfigure brings down to 1000."""
    changes, physics = [], replace(Physics(), max_step_size=0.001, real_time_update_rate=5000.0)
    server = dynamic.Reconfigure.__new__(dynamic.Reconfigure)
    server._simulator = SimpleNamespace(physics=physics)
    server._physics_api = SimpleNamespace(change=changes.append)
    config = dict(dynamic.values_of(physics), max_update_rate=1000.0)
    server._take(config)
    assert changes == []
    server._take(dict(config, gravity_z=-1.0))
    assert changes[0]["gravity"] == (0.0, 0.0, -1.0) and changes[0]["real_time_update_rate"] == 5000.0
    server._take(dict(config, max_update_rate=200.0))
    assert changes[1]["real_time_update_rate"] == 200.0
