# SPDX-License-Identifier: BSD-3-Clause
"""Meshes, heightmaps and polylines in SDF and URDF: where files are looked for, what they become, what is told."""
import math
import re
import struct
import zlib

import numpy as np
import pytest

from m2wr_sim.model.mesh import shapes as mesh_shapes
from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.model.types import Heightmap, Mesh, MeshFile
from m2wr_sim.model.urdf.loader import load_urdf
from test_mesh_files import CORNERS, FACES, NODE, PYRAMID, dae, obj, same, text_stl

Image = pytest.importorskip("PIL.Image")
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'


@pytest.fixture
def folder(tmp_path):
    """Return a folder of models with one that holds meshes; a world file may stand beside."""
    meshes = tmp_path / "models" / "part" / "meshes"
    meshes.mkdir(parents=True)
    (meshes / "a.stl").write_bytes(text_stl(PYRAMID))
    (meshes / "a.dae").write_bytes(dae(NODE.format("") + NODE.replace("here", "there").format(
        "<translate>0 0 7</translate>")))
    (meshes / "a.obj").write_text(obj(CORNERS, FACES))
    (tmp_path / "beside.stl").write_bytes(text_stl(PYRAMID))
    return tmp_path


def load(folder, geometry, tag="collision"):
    """Return the geometries of a world with one static model, and the notes."""
    text = """<sdf version="1.6"><world name="w"><model name="m"><static>true</static><link name="l">
<{0} name="c"><geometry>{1}</geometry></{0}><collision name="box"><geometry><box><size>1 1 1</size></box></geometry>
</collision></link></model></world></sdf>""".format(tag, geometry)
    path = folder / "my.world"
    path.write_text(text)
    world = load_world(str(path), resolve_model=ModelFolders([str(folder / "models")]))
    link = world.models[0].links[0]
    if tag == "visual":
        return [part.geometry for part in link.visuals], world.notes
    return [part.geometry for part in link.collisions][:-1], world.notes


def mesh(uri, more=""):
    return "<mesh><uri>{}</uri>{}</mesh>".format(uri, more)


def corners(shape):
    return shape.vertices[shape.triangles]


@pytest.mark.parametrize("uri", [
    "model://part/meshes/a.stl", "model://part/meshes/a.obj", "beside.stl", "file://beside.stl", "{0}/beside.stl",
    "file://{0}/beside.stl", "models/part/meshes/a.stl", "model://part//meshes//a.stl",
    "model://part/meshes/../meshes/./a.stl"])
def test_files_are_found(folder, uri):
    (shape,), notes = load(folder, mesh(uri.format(folder)))
    assert isinstance(shape, Mesh) and notes == ()
    assert same([shape], PYRAMID)


@pytest.mark.parametrize("uri, said", [
    ("model://part/meshes/none.stl", "no such file"), ("model://missing/a.stl", "no such file"),
    ("gone.stl", "no such file"), ("model://../../etc/passwd", '".."'), ("model://part/../../beside.stl", '".."'),
    ("../secret.stl", '".."'), ("file:///tmp/../etc/x.stl", '".."'),
    ("http://example.org/a.stl", "nothing is downloaded"),
    ("package://part/meshes/a.stl/../../../x.stl", '".."'), ("beside.world", "no such file"),
    ("my.world", "expected one of .stl, .obj, .dae")])
def test_missing_mesh_file_is_reported_and_skipped(folder, uri, said):
    shapes, (note,) = load(folder, mesh(uri))
    assert shapes == []
    assert uri in note and said in note and "my.world:2" in note and "collision[c]" in note and "left out" in note


def test_media_folders_are_searched_after_the_files_own(folder):
    media = folder / "share"
    (media / "media").mkdir(parents=True)
    (media / "media" / "b.stl").write_bytes(text_stl(2.0 * PYRAMID))
    (media / "beside.stl").write_bytes(text_stl(2.0 * PYRAMID))
    text = ('<sdf version="1.6"><model name="m"><static>true</static><link name="l"><collision name="c"><geometry>%s'
            '</geometry></collision></link></model></sdf>')
    for uri, scale in (("file://media/b.stl", 2.0), ("media/b.stl", 2.0), ("beside.stl", 1.0)):
        model, = load_sdf_models(text % mesh(uri), str(folder / "m.sdf"), ModelFolders((), [str(media)]))
        assert same([model.links[0].collisions[0].geometry], scale * PYRAMID) and model.notes == ()


def test_a_broken_file_is_reported_and_the_rest_loads(folder):
    (folder / "beside.stl").write_bytes(b"solid x\nfacet")
    shapes, (note,) = load(folder, mesh("beside.stl"))
    assert shapes == [] and "beside.stl" in note and "collision[c]" in note


def test_too_many_triangles_are_reported_with_the_limit(folder, monkeypatch):
    monkeypatch.setattr("m2wr_sim.model.mesh.files.MAX_TRIANGLES", 3)
    (folder / "fresh.stl").write_bytes(text_stl(PYRAMID))
    shapes, (note,) = load(folder, mesh("fresh.stl"))
    assert shapes == [] and "has 4 triangles; expected at most 3" in note


def test_the_same_missing_file_is_reported_once_for_each_element(folder):
    text = mesh("gone.stl")
    _, notes = load(folder, text + '</geometry></collision><collision name="d"><geometry>' + text)
    assert len(notes) == 2 and "collision[d]" in notes[1]


def test_a_missing_library_is_reported(folder, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    (folder / "other.stl").write_bytes(text_stl(PYRAMID))
    shapes, (note,) = load(folder, mesh("other.stl"))
    assert shapes == [] and "expected the Python package trimesh" in note


def test_scale_is_applied_and_a_mirror_keeps_faces_outwards(folder):
    (shape,), _ = load(folder, mesh("beside.stl", "<scale>2 1 -0.5</scale>"))
    assert same([shape], (PYRAMID * (2.0, 1.0, -0.5))[:, ::-1])


def test_a_submesh_is_chosen_by_name_and_centred(folder):
    (whole,), _ = load(folder, mesh("model://part/meshes/a.dae"))
    assert len(whole.triangles) == 8
    (shape,), _ = load(folder, mesh("model://part/meshes/a.dae", "<submesh><name>there</name></submesh>"))
    assert same([shape], PYRAMID + (0.0, 0.0, 7.0))
    (shape,), _ = load(folder, mesh("model://part/meshes/a.dae",
                                    "<submesh><name>there</name><center>true</center></submesh>"))
    assert same([shape], PYRAMID - (0.5, 1.0, 1.5))
    shapes, (note,) = load(folder, mesh("model://part/meshes/a.dae", "<submesh><name>other</name></submesh>"))
    assert shapes == [] and 'no submesh "other"' in note and "there" in note


def test_a_mesh_without_a_file_or_with_no_extent_is_skipped(folder):
    for geometry, said in (("<mesh/>", "<uri> is missing"), (mesh("beside.stl", "<scale>1 0 1</scale>"), "scale is"),
                           (mesh("beside.stl", "<scale>1 1</scale>"), "3 numbers"),
                           (mesh("beside.stl", "<scale>1 1 1e300</scale>"), "beyond 1e+06 m")):
        shapes, (note,) = load(folder, geometry)
        assert shapes == [] and said in note and "collision[c]" in note and "this collision is left out" in note


def test_visuals_are_not_opened(folder):
    assert load(folder, "<heightmap><uri>gone.png</uri></heightmap>", "visual") == ([], ())
    (shape,), notes = load(folder, mesh("gone.stl", "<scale>1 2 3</scale>"), "visual")
    assert shape == MeshFile("", "gone.stl", (1.0, 2.0, 3.0)) and notes == ()
    (shape,), notes = load(folder, mesh("beside.stl"), "visual")
    assert shape == MeshFile(str(folder / "beside.stl"), "beside.stl") and notes == ()


def test_shapes_of_equal_files_are_equal(folder):
    one, two = (load(folder, mesh("beside.stl"))[0][0] for _ in range(2))
    other = load(folder, mesh("beside.stl", "<scale>2 2 2</scale>"))[0][0]
    assert one == two and hash(one) == hash(two) and one != other


# -- URDF ---------------------------------------------------------------------------------------------------------

def urdf(folder, filename, scale="", **options):
    text = ('<robot name="r"><link name="a">%s<visual><geometry><mesh filename="package://none/x.dae"/></geometry>'
            '</visual><collision><geometry><mesh filename="%s"%s/></geometry></collision></link></robot>' % (
                INERTIAL, filename, scale))
    return load_urdf(text, str(folder / "r.urdf"), **options)


def packages(folder):
    def resolve(name):
        if name != "part":
            raise KeyError(name)
        return str(folder / "models" / "part")
    return resolve


@pytest.mark.parametrize("filename", ["package://part/meshes/a.stl", "model://part/meshes/a.stl", "beside.stl",
                                      "file://{0}/beside.stl", "{0}/beside.stl"])
def test_a_urdf_mesh_collides(folder, filename):
    model = urdf(folder, filename.format(folder), ' scale="1 2 1"', resolve_package=packages(folder))
    (part,), notes = model.links[0].collisions, model.notes
    assert same([part.geometry], PYRAMID * (1.0, 2.0, 1.0)) and notes == ()


@pytest.mark.parametrize("inside", ["//meshes/a.stl", "/urdf/../meshes/a.stl", "/./meshes//a.stl"])
def test_a_path_inside_a_package_may_take_detours(folder, inside):
    model = urdf(folder, "package://part" + inside, resolve_package=packages(folder))
    assert len(model.links[0].collisions) == 1 and model.notes == ()


def test_meshes_of_an_sdf_are_found_by_package_too(folder):
    (folder / "models" / "part" / "package.xml").write_text("<package/>")
    text = """<sdf version="1.6"><model name="m"><link name="l"><collision name="c"><geometry>%s</geometry></collision>
</link></model></sdf>"""
    folders = ModelFolders(packages=lambda: [str(folder / "models" / "part")])
    for uri, count in (("package://part/meshes/a.stl", 1), ("package://other/meshes/a.stl", 0),
                       ("package://part/../../beside.stl", 0)):
        model, = load_sdf_models(text % mesh(uri), resolve_model=folders)
        assert (len(model.links[0].collisions), len(model.notes)) == (count, 1 - count)


def test_a_urdf_mesh_by_model_name_is_found_in_the_model_folders(folder):
    model = urdf(folder, "model://part/meshes/a.stl", resolve_model=ModelFolders([str(folder / "models")]))
    assert len(model.links[0].collisions) == 1


@pytest.mark.parametrize("filename, said", [
    ("package://part//etc/passwd", "part/etc"), ("package://../part/meshes/a.stl", '".."'),
    ("package://missing/a.stl", 'no package "missing"'), ("package://part/../../x.stl", '".."'),
    ("package://part/meshes/gone.stl", "no such file")])
def test_a_urdf_mesh_that_cannot_be_had_is_reported(folder, filename, said):
    model = urdf(folder, filename, resolve_package=packages(folder))
    note, = model.notes
    assert model.links[0].collisions == () and filename in note and said in note and "r.urdf:1" in note


# -- heightmaps ---------------------------------------------------------------------------------------------------

def picture(folder, levels, name="h.png", mode=None):
    Image.fromarray(np.asarray(levels), mode).save(str(folder / name))


def heightmap(more="", name="h.png"):
    return "<heightmap><uri>{}</uri>{}</heightmap>".format(name, more)


def test_the_brightest_pixel_is_as_high_as_the_size_says(folder):
    picture(folder, np.array([[0, 50], [100, 200]], np.uint8))
    (shape,), notes = load(folder, heightmap("<size>4 6 2</size><pos>1 2 3</pos><sampling>1</sampling>"))
    assert isinstance(shape, Heightmap) and notes == ()
    assert (shape.size, shape.position) == ((4.0, 6.0), (1.0, 2.0, 3.0))
    assert shape.heights == pytest.approx(np.array([[0.0, 0.5], [1.0, 2.0]]))


def test_two_samples_a_pixel_are_the_default(folder):
    picture(folder, np.array([[0, 100], [100, 200], [200, 200]], np.uint8))
    (shape,), _ = load(folder, heightmap("<size>1 1 2</size>"))
    assert shape.heights == pytest.approx(np.array(
        [[0.0, 0.5, 1.0], [0.5, 1.0, 1.5], [1.0, 1.5, 2.0], [1.5, 1.75, 2.0], [2.0, 2.0, 2.0]]))


def test_a_negative_height_turns_black_into_the_top(folder):
    picture(folder, np.array([[0, 255], [255, 255]], np.uint8))
    (shape,), _ = load(folder, heightmap("<size>1 1 -2</size><sampling>1</sampling>"))
    assert shape.heights.tolist() == [[2.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize("name, levels", [
    ("h.png", np.full((3, 3, 3), 77, np.uint8)), ("h.jpg", np.full((3, 3), 77, np.uint8)),
    ("h.png", np.full((3, 3), 7777, np.uint16)), ("h.png", np.zeros((3, 3), np.uint8))])
def test_pictures_of_many_kinds_are_read(folder, name, levels):
    picture(folder, levels, name)
    (shape,), _ = load(folder, heightmap("<size>1 1 2</size>", name))
    assert shape.heights.shape == (5, 5) and set(np.unique(shape.heights)) == {2.0 if levels.any() else 0.0}


def test_large_heightmap_is_sampled_less_or_rejected(folder, monkeypatch):
    picture(folder, np.zeros((9, 9), np.uint8))
    monkeypatch.setattr(mesh_shapes, "_MOST_CELLS", 256)
    (shape,), (note,) = load(folder, heightmap("<sampling>4</sampling>"))
    assert shape.heights.shape == (17, 17) and "<sampling> 4" in note and "using 2" in note
    monkeypatch.setattr(mesh_shapes, "_MOST_CELLS", 50)
    shapes, (note,) = load(folder, heightmap())
    assert shapes == [] and "9 x 9 pixels; expected at most 50 cells" in note


@pytest.mark.parametrize("side", [1025, 4097])
def test_the_usual_sizes_of_gazebo_are_read(folder, side):
    picture(folder, np.zeros((side, side), np.uint8))
    (shape,), notes = load(folder, heightmap("<size>1 1 2</size><sampling>1</sampling>"))
    assert shape.heights.shape == (side, side) and notes == ()


@pytest.mark.parametrize("content, said", [(None, "no such file"), (b"no picture", "expected a picture"),
                                           (b"\x89PNG\r\n\x1a\n", "expected a picture")])
def test_a_picture_that_cannot_be_had_is_reported(folder, content, said):
    if content is not None:
        (folder / "h.png").write_bytes(content)
    shapes, (note,) = load(folder, heightmap())
    assert shapes == [] and said in note and "heightmap h.png" in note and "collision[c]" in note


def png_header(width, height):
    """Return the beginning of a PNG of 16 bit grey, without pixels."""
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in ((b"IHDR", header), (b"IDAT", b""), (b"IEND", b"")))


@pytest.mark.parametrize("size", [(20000, 20000), (10000, 10000), (65500, 2000)])
def test_a_picture_beyond_all_bounds_is_not_read(folder, size):
    (folder / "h.png").write_bytes(png_header(*size))
    shapes, (note,) = load(folder, heightmap())
    assert shapes == [] and "this collision is left out" in note
    assert re.search(r"h\.png: the picture has more than \d+ pixels; expected at most 16785409 in all", note)


@pytest.mark.parametrize("levels, said", [
    (np.array([[0.0, math.nan], [1.0, 1.0]], np.float32), "all finite"),
    (np.full((1, 1), 0.5, np.float32), "1 x 1 pixels"),
    (np.array([[0.0, math.inf], [1.0, 1.0]], np.float32), "all finite")])
def test_heights_without_a_surface_are_refused(folder, levels, said):
    Image.fromarray(levels).save(str(folder / "h.tif"))
    shapes, (note,) = load(folder, heightmap(name="h.tif"))
    assert shapes == [] and (said in note or "TIFF picture; expected one of" in note)


@pytest.mark.parametrize("levels", [np.zeros((1, 1), np.uint8), np.zeros((1, 9), np.uint16),
                                    np.zeros((9, 1), np.uint8)])
def test_one_row_or_column_is_no_ground(folder, levels):
    picture(folder, levels)
    shapes, (note,) = load(folder, heightmap())
    assert shapes == [] and "expected at least 2 x 2" in note


def test_ground_that_is_not_square_keeps_its_sides(folder):
    picture(folder, np.arange(15, dtype=np.uint16).reshape(3, 5) * 1000)
    (shape,), _ = load(folder, heightmap("<size>8 2 1.4</size><sampling>1</sampling>"))
    assert shape.heights == pytest.approx(0.1 * np.arange(15).reshape(3, 5)) and shape.size == (8.0, 2.0)


def test_a_heightmap_without_extent_is_skipped(folder):
    picture(folder, np.zeros((3, 3), np.uint8))
    shapes, (note,) = load(folder, heightmap("<size>0 1 1</size>"))
    assert shapes == [] and "positive extent" in note and "this collision is left out" in note


def test_a_heightmap_in_a_moving_model_is_reported(folder):
    picture(folder, np.zeros((3, 3), np.uint8))
    text = ('<sdf version="1.6"><model name="m"><link name="l"><collision name="c"><geometry>%s</geometry></collision>'
            '</link></model></sdf>' % heightmap(name=str(folder / "h.png")))
    model, = load_sdf_models(text)
    assert "stays where the model is loaded" in model.notes[0]


# -- polylines ----------------------------------------------------------------------------------------------------

def polyline(points, height="<height>1</height>"):
    return "<polyline>%s%s</polyline>" % ("".join("<point>%g %g</point>" % point for point in points), height)


def test_polylines_are_drawn_up_and_one_inside_another_is_a_hole(folder):
    square = polyline([(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)])
    hole = polyline([(0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5)])
    (shape,), notes = load(folder, square + hole)
    a, b, c = np.moveaxis(corners(shape), 1, 0)
    assert notes == () and np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(3.0)


@pytest.mark.parametrize("text, said", [
    (polyline([(0, 0), (1, 0), (0, 0)]), "at least three"), (polyline([(0, 0), (1, 0), (1, 1)], ""), "<height>"),
    (polyline([(0, 0), (1, 0), (1, 1)], "<height>-1</height>"), "height"),
    (polyline([(0, 0), (1e300, 0), (1, 1)]), "beyond 1e+06 m"),
    ("<polyline><point>1</point><point>1 2</point><point>2 2</point><height>1</height></polyline>", "point")])
def test_a_polyline_without_a_body_is_skipped(folder, text, said):
    shapes, (note,) = load(folder, text)
    assert shapes == [] and said in note and "this collision is left out" in note
