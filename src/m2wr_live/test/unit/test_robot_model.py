# SPDX-License-Identifier: BSD-3-Clause
"""Meshes as pages show them: the size and colours of the file."""
import io
import re

import numpy as np
import pytest
import trimesh

from m2wr_live.scene.robot_model import load_mesh, read_robot_model
from m2wr_sim.model.mesh.files import read_mesh_file

URDF = """<robot name="r"><material name="m"><color rgba="0 0 1 1"/></material><link name="l"><visual><geometry>
<mesh filename="file://%s"/></geometry></visual><visual><geometry><mesh filename="file://%s"/></geometry>
<material name="m"/></visual></link></robot>"""


@pytest.fixture
def collada(tmp_path):
    """Return a function that writes a box of 1 x 2 x 3 units as COLLADA; returns its path."""
    def write(unit="", colour="0 0 0 1"):
        box = trimesh.creation.box((1.0, 2.0, 3.0))
        box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)))
        text = trimesh.exchange.dae.export_collada(box).decode()
        text = re.sub(r"(<diffuse>\s*<color>)[^<]*", r"\g<1>" + colour, text)
        text = re.sub("<unit[^>]*>", "", text).replace("<up_axis>", unit + "<up_axis>")
        path = tmp_path / "box.dae"
        path.write_text(text)
        return str(path)
    return write


@pytest.mark.parametrize("unit, size", [("", 1.0), ('<unit name="inch" meter="0.0254"/>', 0.0254),
                                        ("<unit meter='10'/>", 10.0), ('<unit meter="0"/>', 1.0)])
def test_a_collada_file_has_the_size_that_its_unit_says(collada, unit, size):
    path = collada(unit)
    assert np.ptp(load_mesh(path).vertices, axis=0) == pytest.approx(np.array((1.0, 2.0, 3.0)) * size)
    simulated = np.concatenate([part.vertices for part in read_mesh_file(path)])
    assert np.ptp(simulated, axis=0) == pytest.approx(np.array((1.0, 2.0, 3.0)) * size)


def test_a_mesh_keeps_its_colours_unless_the_description_has_one(collada):
    path = collada(colour="1 0 0 1")
    model = read_robot_model(URDF % (path, path), lambda uri: uri[len("file://"):])
    own, plain = [model.geometries[shape.geometry] for shape in model.shapes]
    assert own.coloured[:4] == b"glTF" and plain.coloured == b"" and model.shapes[1].colour == (0, 0, 1, 1)
    assert load_mesh(path).coloured == b""
    drawn, = trimesh.load(io.BytesIO(own.coloured), file_type="glb").geometry.values()
    material = drawn.visual.material
    assert (material.metallicFactor, tuple(material.baseColorFactor)) == (0.0, (255, 0, 0, 255))
