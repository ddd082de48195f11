# SPDX-License-Identifier: BSD-3-Clause
"""Colours and textures of mesh files and material scripts."""
import numpy as np
import pytest

from m2wr_sim.model.mesh.surfaces import read_surface_file
from m2wr_sim.model.mesh.textures import Script, find_script, read_texture
from m2wr_sim.model.types import MeshFile
from m2wr_sim.model.xml.safe import XmlError

OBJ = """mtllib look.mtl
o one
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl skin
f 1/1 2/2 3/3 4/4
o two
usemtl paint
f 1 3 2
"""
MTL = "newmtl skin\nKd 1 1 1\nmap_Kd skin.png\nnewmtl paint\nKd 0.1 0.2 0.3\n"
DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit meter="0.1"/>
</asset>
<library_images><image id="i"><init_from>%s</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON><newparam sid="s"><surface type="2D"><init_from>i</init_from></surface>
</newparam><newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam><technique sid="c"><lambert><diffuse>
%s</diffuse></lambert></technique></profile_COMMON></effect></library_effects><library_materials><material id="m">
<instance_effect url="#e"/></material></library_materials><library_geometries><geometry id="g" name="part"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 10 0 0 0 10 0</float_array><technique_common><accessor source="#pa"
 count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source><source id="u">
<float_array id="ua" count="6">0 0 1 0 0 1</float_array><technique_common>
<accessor source="#ua" count="3" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1"
 material="sym"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="TEXCOORD" source="#u" offset="1"
 set="0"/><p>0 0 1 1 2 2</p></triangles></mesh></geometry></library_geometries><library_visual_scenes>
<visual_scene id="s"><node
 id="n" name="node"><instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="sym"
 target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
TEXTURED, PAINTED = '<texture texture="t" texcoord="x"/>', "<color>0.2 0.4 0.6 1</color>"


@pytest.fixture
def folder(tmp_path):
    from PIL import Image
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0], pixels[1, 1] = (255, 0, 0), (0, 0, 255)
    for where in ("meshes", "materials/textures", "materials/scripts"):
        (tmp_path / where).mkdir(parents=True)
    Image.fromarray(pixels).save(tmp_path / "meshes" / "skin.png")
    Image.fromarray(pixels).save(tmp_path / "materials" / "textures" / "floor.png")
    (tmp_path / "meshes" / "look.mtl").write_text(MTL)
    (tmp_path / "meshes" / "a.obj").write_text(OBJ)
    return tmp_path


def test_obj_has_the_colours_and_textures_of_its_materials(folder):
    surface, problems = read_surface_file(MeshFile(str(folder / "meshes" / "a.obj")))
    assert problems == () and list(surface.uses) == [0, 0, -1]
    np.testing.assert_allclose(surface.colours, [(1, 1, 1), (1, 1, 1), (0.1, 0.2, 0.3)])
    np.testing.assert_allclose(surface.uv[0], [(0, 1), (1, 1), (1, 0)])
    assert tuple(surface.textures[0].pixels[0, 0]) == (255, 0, 0)


def test_part_scale_and_mirror_of_a_mesh(folder):
    path = str(folder / "meshes" / "a.obj")
    surface, _ = read_surface_file(MeshFile(path, scale=(-2.0, 1.0, 1.0), submesh="two"))
    (triangle,) = surface.corners
    assert triangle[:, 0].min() == -2.0
    assert np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])[2] < 0       # as before the mirror
    centred, _ = read_surface_file(MeshFile(path, submesh="one", centred=True))
    np.testing.assert_allclose(centred.corners.mean(axis=(0, 1))[2], 0.0)
    assert centred.corners.min() == -0.5
    with pytest.raises(XmlError, match='no submesh "three"; expected one of one, two'):
        read_surface_file(MeshFile(path, submesh="three"))


@pytest.mark.parametrize("picture", ["skin.png", "../materials/textures/floor.png", "C:\\gone\\floor.png"])
def test_collada_has_the_texture_of_its_folders(folder, picture):
    (folder / "meshes" / "a.dae").write_text(DAE % (picture, TEXTURED))
    surface, problems = read_surface_file(MeshFile(str(folder / "meshes" / "a.dae")))
    assert problems == () and list(surface.uses) == [0] and surface.textures[0].pixels.shape == (2, 2, 3)
    np.testing.assert_allclose(surface.corners[0], [(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    np.testing.assert_allclose(surface.uv[0], [(0, 1), (1, 1), (0, 0)])


def test_collada_colour_and_missing_picture(folder):
    path = folder / "meshes" / "b.dae"
    path.write_text(DAE % ("gone.png", PAINTED))
    surface, problems = read_surface_file(MeshFile(str(path)))
    np.testing.assert_allclose(surface.colours[0], (0.2, 0.4, 0.6))
    assert problems == () and list(surface.uses) == [-1]
    path.write_text(DAE % ("gone.png", TEXTURED) + " ")
    surface, problems = read_surface_file(MeshFile(str(path)))
    assert "gone.png" in problems[0] and list(surface.uses) == [-1]


def test_missing_or_broken_files_are_reported(folder):
    with pytest.raises(XmlError, match="mesh model://x/y.dae: there is no such file"):
        read_surface_file(MeshFile("", "model://x/y.dae"))
    broken = folder / "meshes" / "broken.obj"
    broken.write_text("v 0 0\nf 1 2 3\n")
    with pytest.raises(XmlError):
        read_surface_file(MeshFile(str(broken)))
    for name, content in (("text.png", b"no picture"), ("script.ps", b"%!PS-Adobe\n")):
        (folder / name).write_bytes(content)
        with pytest.raises(XmlError, match="expected a picture such as a PNG|expected one of"):
            read_texture(str(folder / name))


def test_material_scripts_give_colour_picture_and_repeats(folder):
    (folder / "materials" / "scripts" / "x.material").write_text("""// material Wrong { }
material Floor/Lines : Base
{
  technique { pass {
    ambient 0.1 0.1 0.1 1
    diffuse 0.5 0.6 0.7 1.0
    texture_unit { texture floor.png
      scale 0.5 0.25 }
  } }
}
material "With Space" { technique { pass { diffuse 1 0 0 1 } } }
material Bare { }
""")
    places = (str(folder / "materials" / "scripts"), str(folder / "materials" / "textures"))
    found = find_script("Floor/Lines", places)
    assert found.colour == (0.5, 0.6, 0.7) and found.repeat == (2.0, 4.0) and found.picture.endswith("floor.png")
    assert read_texture(found.picture).pixels.shape == (2, 2, 3)
    assert find_script("Floor/Lines", places[:1]).picture.endswith("floor.png")         # from ../textures
    assert find_script("With Space", places).colour == (1.0, 0.0, 0.0)
    assert find_script("Bare", places) == Script() and find_script("Wrong", places) is None
