# SPDX-License-Identifier: BSD-3-Clause
"""Tensors of inertia that no solver can use give way to one that it can; the robot stays."""
import math

import numpy as np
import pytest

from m2wr_sim.model.inertials import mass_fault, usable
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Mesh, Plane, Sphere
from m2wr_sim.model.urdf.loader import load_urdf

TURN = (0.0, 0.0, 0.0, 1.0)
FLAT = Inertial(2.0, ((0.0, 0.0, 0.1), TURN), (0.0,) * 6)
CORNERS = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [1.0, 0.0, 0.0]])


def part(shape, *position):
    return Collision("c", shape, (tuple(position) or (0.0, 0.0, 0.1), TURN))


@pytest.mark.parametrize("collisions, radius", [
    ([], 0.1), ([part(Plane((0.0, 0.0, 1.0), (1.0, 1.0)))], 0.1), ([part(Sphere(0.2))], 0.2),
    ([part(Box((2.0, 3.0, 6.0)))], 3.5), ([part(Cylinder(3.0, 8.0))], 5.0),
    ([part(Sphere(0.2), 0.0, 0.3, 0.5), part(Sphere(0.3))], 0.7),
    ([part(Mesh(CORNERS, np.array([[0, 1, 2]])))], 5.0)])
def test_the_ball_holds_the_shapes(collisions, radius):
    taken, told = usable(FLAT, collisions)
    assert (taken.mass, taken.pose) == (FLAT.mass, FLAT.pose)
    np.testing.assert_allclose(taken.inertia, np.array([1, 0, 0, 1, 0, 1]) * 0.8 * radius ** 2, rtol=1e-12)
    assert "not positive definite" in told and " kg and %.3g m" % radius in told


def test_what_is_usable_stays_as_it_is():
    sound = Inertial(2.0, FLAT.pose, (0.1, 0.01, 0.0, 0.1, 0.0, 0.1))
    assert usable(sound, []) == (sound, None) and mass_fault(sound) is None
    assert mass_fault(Inertial(0.0, FLAT.pose, FLAT.inertia))[0] == "mass is 0"


@pytest.mark.parametrize("tensor", [
    'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"', 'ixx="-0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"',
    'ixx="0.1" ixy="0.2" ixz="0" iyy="0.1" iyz="0" izz="0.1"'])
def test_a_robot_keeps_its_link_and_the_line_is_reported(tensor):
    model = load_urdf('<robot name="r">\n<link name="a"><inertial>\n<mass value="0.5"/><inertia %s/></inertial>'
                      '<collision><geometry><sphere radius="0.04"/></geometry></collision></link></robot>' % tensor,
                      source="r.urdf")
    assert math.isclose(model.links[0].inertial.inertia[0], 0.4 * 0.5 * 0.04 ** 2)
    note, = model.notes
    assert note.startswith("r.urdf:2: <robot[r]/link[a]/inertial>: ") and "0.5 kg and 0.04 m" in note


def test_tensor_made_valid_by_merging_is_not_reported():
    link = ('<link name="%s"><inertial><mass value="1"/><inertia ixx="%s" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
            '</inertial></link>')
    model = load_urdf('<robot name="r">' + link % ("a", "0.1") + link % ("b", "0") + '<joint name="j" type="fixed">'
                      '<parent link="a"/><child link="b"/></joint></robot>')
    assert model.links[0].inertial.mass == 2.0 and not model.notes


def test_a_model_of_sdf_keeps_its_link_unless_it_is_static():
    text = ('<sdf version="1.6"><model name="m">%s<link name="l"><inertial><mass>3</mass><inertia><ixx>0</ixx>'
            '</inertia></inertial><collision name="c"><geometry><sphere><radius>2</radius></sphere></geometry>'
            '</collision></link></model></sdf>')
    moving, = load_sdf_models(text % "")
    assert math.isclose(moving.links[0].inertial.inertia[5], 0.4 * 3.0 * 4.0)
    assert "link[l]/inertial" in moving.notes[0] and "a ball of 3 kg and 2 m" in moving.notes[0]
    assert not load_sdf_models(text % "<static>1</static>")[0].notes


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_a_tensor_that_is_not_finite_gives_way_too(value):
    taken, told = usable(Inertial(2.0, FLAT.pose, (1.0, 0.0, value, 1.0, 0.0, 1.0)), [part(Sphere(0.2))])
    assert taken.inertia == usable(FLAT, [part(Sphere(0.2))])[0].inertia
    assert "not positive definite" in told
