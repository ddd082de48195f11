# SPDX-License-Identifier: BSD-3-Clause
"""Mesh files: what comes out of them, and what is said of those that cannot be used."""
import os
import struct

import numpy as np
import pytest

from m2wr_sim.model.mesh import files as mesh_files
from m2wr_sim.model.mesh.files import has_area, read_mesh_file
from m2wr_sim.model.xml.safe import XmlError, read_file

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
PYRAMID = CORNERS[FACES]


def text_stl(corners):
    facets = "".join("facet normal 0 0 0\nouter loop\n%s\nendloop\nendfacet\n" % "\n".join(
        "vertex %r %r %r" % tuple(float(value) for value in corner) for corner in facet) for facet in corners)
    return ("solid part\n%sendsolid part\n" % facets).encode()


def binary_stl(corners, stated=None):
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(facet), 0) for facet in corners)
    return b"\0" * 80 + struct.pack("<I", len(corners) if stated is None else stated) + facets


def obj(corners, faces, name="part", first=1):
    lines = ["o " + name] + ["v %r %r %r" % tuple(float(value) for value in corner) for corner in corners]
    return "\n".join(lines + ["f %d %d %d" % tuple(index + first for index in face) for face in faces]) + "\n"


def dae(nodes, corners=CORNERS, faces=FACES, unit=1.0, up="Z_UP"):
    return """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
      <asset><unit meter="{unit}"/><up_axis>{up}</up_axis></asset>
      <library_geometries><geometry id="g" name="shape"><mesh>
      <source id="p"><float_array id="a" count="{count}">{numbers}</float_array><technique_common>
      <accessor source="#a" count="{vertices}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
      <param name="Z" type="float"/></accessor></technique_common></source>
      <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
      <triangles count="{faces}"><input semantic="VERTEX" source="#v" offset="0"/><p>{index}</p></triangles>
      </mesh></geometry></library_geometries>
      <library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
      <scene><instance_visual_scene url="#s"/></scene></COLLADA>""".format(
        unit=unit, up=up, count=3 * len(corners), vertices=len(corners), faces=len(faces), nodes=nodes,
        numbers=" ".join("%r" % float(value) for value in np.ravel(corners)),
        index=" ".join("%d" % index for index in np.ravel(faces))).encode()


NODE = '<node name="here" id="n1">{}<instance_geometry url="#g"/></node>'


@pytest.fixture
def saved(tmp_path):
    def save(name, content):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return str(path)
    return save


def soup(parts):
    """Return the triangles' corners of all parts, in a order of their own."""
    corners = np.concatenate([part.vertices[part.triangles] for part in parts])
    return corners[np.lexsort(corners.reshape(-1, 9).T)]


def same(parts, corners):
    """Whether the parts are these triangles, up to their order and the corner each begins with."""
    def key(triangles):
        return sorted(min(tuple(np.roll(triangle, -turn, axis=0).ravel().round(9) + 0.0) for turn in range(3))
                      for triangle in np.asarray(triangles, dtype=float))
    return key(soup(parts)) == key(corners)


@pytest.mark.parametrize("name, content", [
    ("a.stl", text_stl(PYRAMID)), ("a.STL", binary_stl(PYRAMID)), ("a.obj", obj(CORNERS, FACES)),
    ("a.dae", dae(NODE.format("")))])
def test_each_format_gives_its_triangles_in_metres(saved, name, content):
    parts = read_mesh_file(saved(name, content))
    assert same(parts, PYRAMID)
    assert all(part.vertices.dtype == np.float64 and part.triangles.dtype == np.int32 for part in parts)


BROKEN_ENDS = NODE.format("").replace("/></node>", "><bind_material><technique_common><instance_material symbol='m' "
                                      "target='#none'/></technique_common></bind_material></instance_geometry>"
                                      "<instance_camera url='#none'/><instance_light url='#none'/></node>")
AUTHOR = b"<asset><contributor><author>Ren\xe9 -- x</author></contributor>"


@pytest.mark.parametrize("name, content", [
    ("a.stl", binary_stl(PYRAMID).replace(b"\0" * 80, b"solid exported by hand".ljust(80))),
    ("a.stl", binary_stl(PYRAMID) + b"\0" * 7), ("a.stl", text_stl(PYRAMID).replace(b"part", b"caf\xe9")),
    ("a.stl", text_stl(PYRAMID).replace(b"\n", b"\r\n")), ("a.stl", text_stl(PYRAMID).upper()),
    ("a.obj", b"# caf\xe9\nmtllib none.mtl\n" + obj(CORNERS, FACES).encode()),
    ("a.dae", dae(BROKEN_ENDS)), ("a.dae", dae(NODE.format("")).replace(b"<asset>", AUTHOR)),
    ("a.dae", dae(NODE.format("")).replace(b"2005/11", b"2008/03").replace(b"1.4.1", b"1.5.0"))])
def test_other_elements_of_mesh_files_are_ignored(saved, name, content):
    assert same(read_mesh_file(saved(name, content)), PYRAMID)


def test_parts_of_an_obj_have_names(saved):
    parts = read_mesh_file(saved("a.obj", obj(CORNERS, FACES, "one") + obj(CORNERS + 5.0, FACES, "two", 5)))
    assert [part.names for part in parts] == [("one",), ("two",)]
    assert same(parts[1:], PYRAMID + 5.0)


def test_faces_of_an_obj_with_more_corners_are_cut(saved):
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1/1 2/1/1 3/1/1 4/1/1\nvn 0 0 1\nvt 0 0\n"
    parts = read_mesh_file(saved("a.obj", square))
    corners = soup(parts)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert len(corners) == 2 and area == pytest.approx(1.0)


@pytest.mark.parametrize("up", ["Z_UP", "Y_UP", "X_UP"])
def test_collada_unit_is_applied_but_up_axis_is_not(saved, up):
    assert same(read_mesh_file(saved("a.dae", dae(NODE.format(""), unit=0.01, up=up))), 0.01 * PYRAMID)


def test_collada_transforms_are_applied_inner_first(saved):
    outer = '<node><translate>0 0 10</translate><rotate>0 0 1 90</rotate>%s</node>' % NODE.format(
        "<scale>2 2 2</scale>")
    moved = 2.0 * PYRAMID
    moved = np.stack((-moved[..., 1], moved[..., 0], moved[..., 2] + 10.0), axis=-1)
    assert same(read_mesh_file(saved("a.dae", dae(outer))), moved)


def test_a_mirrored_node_keeps_faces_outwards(saved):
    parts = read_mesh_file(saved("a.dae", dae(NODE.format("<scale>-1 1 1</scale>"))))
    corners = soup(parts)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(1.0)


def test_collada_part_has_names_of_node_and_geometry(saved):
    part, = read_mesh_file(saved("a.dae", dae(NODE.format(""))))
    assert set(part.names) == {"here", "n1", "shape", "g"}


def test_triangles_without_area_are_dropped(saved):
    flat = np.array([[[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[5, 5, 5]] * 3], dtype=float)
    assert same(read_mesh_file(saved("a.stl", text_stl(np.concatenate((flat, PYRAMID))))), PYRAMID)
    assert has_area(np.concatenate((flat, PYRAMID * 1e-6, PYRAMID * 1e5))).tolist() == [False] * 2 + [True] * 8


def test_a_changed_file_is_read_again(saved):
    path = saved("a.stl", text_stl(PYRAMID))
    first = read_mesh_file(path)
    assert read_mesh_file(path) is first
    saved("a.stl", text_stl(PYRAMID[:2]))
    assert len(read_mesh_file(path)[0].triangles) == 2


BOMB = b'<?xml version="1.0"?><!DOCTYPE c [<!ENTITY a "aaaa">]><COLLADA>&a;</COLLADA>'


@pytest.mark.parametrize("name, content, said", [
    ("a.step", b"x", "expected one of .stl, .obj, .dae"),
    ("a.stl", b"", "a.stl"),
    ("a.stl", binary_stl(PYRAMID, stated=5000), "states 5000 triangles"),
    ("a.stl", binary_stl(PYRAMID, stated=0), "states 0 triangles"),
    ("a.stl", binary_stl(PYRAMID)[:60], "a.stl"),
    ("a.stl", b"solid nothing\nendsolid nothing\n", "a.stl"),
    ("a.stl", text_stl([[[0, 0, 0], [1, 0, 0], [0, float("nan"), 0]]]), "expected finite numbers"),
    ("a.stl", text_stl([[[0, 0, 0], [1e9, 0, 0], [0, 1, 0]]]), "at most 1e+06 m"),
    ("a.stl", text_stl([[[0, 0, 0]] * 3]), "no triangle"),
    ("a.obj", b"nothing of use\n", "a.obj"),
    ("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 9\n", "a.obj"),
    ("a.dae", b"<COLLADA><asset>", "not well-formed XML"),
    ("a.dae", BOMB, "entity"),
    ("a.dae", b"<robot/>", "expected <COLLADA>"),
    ("a.dae", dae(""), "no triangle"),
])
def test_a_file_that_cannot_be_used_is_reported(saved, name, content, said):
    with pytest.raises(XmlError) as caught:
        read_mesh_file(saved(name, content))
    assert name in str(caught.value) and said in str(caught.value)


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(XmlError, match="nowhere.stl: cannot be read: No such file"):
        read_mesh_file(str(tmp_path / "nowhere.stl"))


def test_too_many_triangles_are_rejected_with_the_limit(saved, monkeypatch):
    monkeypatch.setattr(mesh_files, "MAX_TRIANGLES", 3)
    with pytest.raises(XmlError, match="has 4 triangles; expected at most 3"):
        read_mesh_file(saved("many.stl", text_stl(PYRAMID)))


def test_a_large_file_is_announced(saved, monkeypatch, caplog):
    monkeypatch.setattr(mesh_files, "_SLOW_BYTES", 100)
    with caplog.at_level("INFO", logger="m2wr_sim.model.mesh.files"):
        read_mesh_file(saved("large.stl", text_stl(PYRAMID)))
    assert "large.stl" in caplog.text


@pytest.mark.parametrize("text", ["v 0 0\nv 1 0\nv 0 1\nv 2 2\nf 1 2 3\n", "v 0\nv 1\nv 2\nv 3\nf 1 2 3\n"])
def test_vertices_with_other_than_three_coordinates_are_rejected(tmp_path, text):
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(XmlError, match=r"a\.obj: .*three coordinates"):
        read_mesh_file(str(tmp_path / "a.obj"))


def test_pipes_and_devices_are_rejected_at_once(tmp_path):
    os.mkfifo(str(tmp_path / "pipe.stl"))
    (tmp_path / "zero.obj").symlink_to("/dev/zero")
    for name in ("pipe.stl", "zero.obj"):
        with pytest.raises(XmlError, match="no regular file"):
            read_mesh_file(str(tmp_path / name))
    for name in ("pipe.stl", "zero.obj"):
        with pytest.raises(XmlError, match="no regular file"):
            read_file(str(tmp_path / name))
