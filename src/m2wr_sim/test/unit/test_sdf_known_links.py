# SPDX-License-Identifier: BSD-3-Clause
"""Links that are written alike are read once, and each is still what it would be alone."""
import pytest

from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf import known_links
from sdf_documents import BOX, LINK, static, world

SHELF = '<link name="link"><pose>1 0 0 0 0 0</pose><collision name="c">' + BOX + "</collision></link>"


def links(loaded):
    return [model.links[0] for model in loaded.models]


def test_links_written_alike_are_one_record():
    loaded = world(static("a", pose="<pose>1 2 0 0 0 0</pose>"), static("b", pose="<pose>3 4 0 0 0 0</pose>"),
                   static("c", SHELF))
    first, second, other = links(loaded)
    assert first is second and first is not other and other.pose[0] == (1.0, 0.0, 0.0)
    assert [model.pose[0][:2] for model in loaded.models] == [(1.0, 2.0), (3.0, 4.0), (0.0, 0.0)]
    assert loaded.notes == () and loaded.remarks == ()


def test_a_long_link_is_read_each_time(monkeypatch):
    monkeypatch.setattr(known_links, "LONGEST", len(LINK) - 1)
    first, second = links(world(static("a"), static("b")))
    assert first is not second and first == second


def test_a_pose_in_a_frame_is_that_of_each_model():
    body = ('<frame name="f"><pose>{} 0 0 0 0 0</pose></frame>'
            '<link name="link"><pose relative_to="f">1 0 0 0 0 0</pose></link>')
    first, second = links(world(static("a", body.format(1)), static("b", body.format(5)), version="1.7"))
    assert (first.pose[0][0], second.pose[0][0]) == (2.0, 6.0)


@pytest.mark.parametrize("fault", ["1 nan 3", "1 2"])
def test_each_fault_is_told_with_its_line(fault):
    body = '\n<link name="link"><collision name="c">{}</collision></link>'.format(BOX.replace("1 2 3", fault))
    loaded = world(static("a", body), static("b", body))
    assert len(loaded.notes) == 2 and len({note.split(" ")[0] for note in loaded.notes}) == 2
    assert all(not link.collisions for link in links(loaded))


def test_moving_and_static_models_have_their_own_inertia():
    body = LINK.replace("</link>", "<inertial><mass>0</mass></inertial></link>")
    loaded = world(static("a", body), '<model name="b">{}</model>'.format(body))
    assert [model.name for model in loaded.models] == ["a"]
    assert "mass" in loaded.notes[0] and "b" in loaded.notes[0]


def test_self_collision_is_that_of_the_model():
    loaded = world(static("a"), static("b", "<self_collide>true</self_collide>" + LINK))
    assert [link.self_collide for link in links(loaded)] == [False, True]


def test_plugins_of_sensors_keep_their_lines():
    body = '<link name="link"><sensor name="s" type="imu"><plugin name="p" filename="libx.so"/></sensor></link>'
    first, second = links(world(static("a", body), static("b", body)))
    assert first.sensors[0].plugins[0].where != second.sensors[0].plugins[0].where


def test_files_of_a_folder_are_not_those_of_another(tmp_path):
    link = '<link name="link"><visual name="v"><geometry><mesh><uri>cone.obj</uri></mesh></geometry></visual></link>'
    body = '<sdf version="1.6">' + static("m", link) + "</sdf>"
    for name, height in (("low", 1), ("high", 7)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "model.sdf").write_text(body)
        (tmp_path / name / "model.config").write_text('<model><sdf version="1.6">model.sdf</sdf></model>')
        (tmp_path / name / "cone.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n".format(height))
    finder = ModelFolders([str(tmp_path)])
    include = "<include><name>{0}</name><uri>model://{0}</uri></include>"
    loaded = world(include.format("low"), include.format("high"), resolve_model=finder)
    low, high = [link.visuals[0].geometry for link in links(loaded)]
    assert low != high
