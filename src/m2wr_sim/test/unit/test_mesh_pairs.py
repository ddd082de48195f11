# SPDX-License-Identifier: BSD-3-Clause
"""Two meshes with more contacts than there is room for: they sank into each other, or the process ended."""
import math

import numpy as np
import pytest

from m2wr_sim.model.types import Box, Collision, Inertial, Link, Mesh, Model, Surface
from m2wr_sim.physics import mesh_pairs, native_ode
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.pyode_engine import PyodeEngine
from m2wr_sim.physics.step_layout import MAX_FOUND

pytest.importorskip("numba", reason="the compiled loop needs numba")
native_ode.publish_symbols()
native = pytest.importorskip("m2wr_sim.physics.native_engine")
ENGINES = [PyodeEngine, native.NativeEngine]
NO_TURN = (0.0, 0.0, 0.0, 1.0)


def plate(cells, size=1.0, thickness=0.2, wave=0.0):
    """Return a closed plate whose upper and lower side are grids of cells; a wave along x gives it a profile."""
    steps = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    x, y = (each.ravel() for each in np.meshgrid(steps, steps))
    profile = wave * np.sin(40.0 * x)
    vertices = np.concatenate([np.column_stack([x, y, sign * 0.5 * thickness + profile]) for sign in (1.0, -1.0)])
    row = cells + 1
    corner = (np.arange(cells)[:, None] * row + np.arange(cells)).ravel()
    up = np.concatenate([np.column_stack([corner, corner + 1, corner + row + 1]),
                         np.column_stack([corner, corner + row + 1, corner + row])])
    down = up[:, ::-1] + row * row
    rim = np.concatenate([np.arange(cells), row * np.arange(1, row) - 1, row * row - 1 - np.arange(cells),
                          row * np.arange(cells, 0, -1)])
    following, below = np.roll(rim, -1), row * row
    sides = np.concatenate([np.column_stack([rim, rim + below, following + below]),
                            np.column_stack([rim, following + below, following])])
    return Mesh(vertices, np.concatenate([up, down, sides]).astype(np.int32), "plate of %d cells" % cells)


def model(geometry, static):
    inertial = Inertial(1.0, inertia=(0.1, 0.0, 0.0, 0.1, 0.0, 0.1))
    link = Link("link", inertial=inertial, collisions=(Collision("shape", geometry, surface=Surface()),))
    return Model("plate", (link,), static=static)


def fall(engine_class, lower, upper, steps=60):
    """Drop a body by 1 cm on another one; return its states after each of so many steps of 5 ms."""
    engine = engine_class(EngineSettings(step_ns=5000000))
    engine.reseed(7)
    engine.add_model(model(lower, True), ((0.0, 0.0, 0.0), NO_TURN), "lower")
    handle = engine.add_model(model(upper, False), ((0.02, 0.01, 0.21), (0.0, 0.0, math.sin(0.1), math.cos(0.1))),
                              "upper")
    states = []
    for _ in range(steps):
        engine.step(1)
        states.append(engine.link_state(handle.links["link"]))
    engine.close()
    return states


@pytest.fixture
def counts(monkeypatch):
    """Return the list of the numbers of contacts that the engine in Python finds between two meshes."""
    found, before = [], mesh_pairs.deepest
    monkeypatch.setattr(mesh_pairs, "deepest", lambda rows: found.append(len(rows)) or before(rows))
    return found


def test_plates_of_many_triangles_come_to_rest_on_each_other(counts):
    slow, fast = (fall(engine_class, plate(40), plate(40)) for engine_class in ENGINES)
    assert fast == slow and max(counts) > MAX_FOUND
    assert slow[-1].position[2] == pytest.approx(0.2, abs=0.01)


def test_of_too_many_contacts_the_deepest_are_used(counts):
    slow, fast = (fall(engine_class, plate(60, wave=0.004), plate(60, wave=-0.004)) for engine_class in ENGINES)
    assert fast == slow and max(counts) > MAX_FOUND and all(np.isfinite(state.position).all() for state in slow)
    assert 0.19 < slow[-1].position[2] < 0.22


def test_a_mesh_and_a_box_are_left_to_the_usual_way():
    slow, fast = (fall(engine_class, plate(10), Box((0.4, 0.4, 0.2))) for engine_class in ENGINES)
    assert fast == slow and slow[-1].position[2] == pytest.approx(0.2, abs=0.01)
