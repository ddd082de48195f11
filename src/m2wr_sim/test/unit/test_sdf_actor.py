# SPDX-License-Identifier: BSD-3-Clause
"""``<actor>`` elements: trajectories, stand-in for the skin, what is left out and why."""
import pytest

from m2wr_sim.geometry import compose, rotate
from m2wr_sim.model.types import Cylinder
from sdf_documents import BOX, world

BODY = '<link name="body"><collision name="c">' + BOX + "</collision></link>"
SKIN = "<skin><filename>walk.dae</filename></skin><animation name='walking'><filename>walk.dae</filename></animation>"


def point(time, pose):
    return "<waypoint><time>{}</time><pose>{}</pose></waypoint>".format(time, pose)


def script(*points, attributes='id="0" type="walking"', more=""):
    return "<script>{}<trajectory {}>{}</trajectory></script>".format(more, attributes, "".join(points))


LINE = (point(0, "1 2 0 0 0 0"), point(4, "3 2 0 0 0 0"))


def actor(body, name="a"):
    loaded = world('<actor name="{}">{}</actor>'.format(name, body))
    return loaded.models[0] if loaded.models else None, loaded


def test_script_is_read_with_its_defaults():
    found, loaded = actor(BODY + script(*LINE))
    assert loaded.notes == () and found.static and found.name == "a" and found.pose[0] == (1.0, 2.0, 0.0)
    trajectory, = found.script.trajectories
    assert (trajectory.kind, trajectory.times, trajectory.tension) == ("walking", (0.0, 4.0), 0.0)
    assert trajectory.poses[1][0] == (3.0, 2.0, 0.0)
    assert (found.script.loop, found.script.delay, found.script.auto_start) == (True, 0.0, True)


def test_all_of_a_script_is_read():
    found, loaded = actor("<pose>7 7 0 0 0 0</pose>" + BODY + script(
        *LINE, attributes='id="3" type="w" tension="0.6"',
        more="<loop>false</loop><delay_start>2.5</delay_start><auto_start>0</auto_start>"))
    assert loaded.notes == () and found.script.trajectories[0].tension == 0.6 and found.pose[0] == (7.0, 7.0, 0.0)
    assert (found.script.loop, found.script.delay, found.script.auto_start) == (False, 2.5, False)


def test_trajectories_are_in_the_order_of_their_ids():
    body = "<trajectory id='5' type='late'>{0}</trajectory><trajectory id='1' type='early'>{0}</trajectory>"
    found, _ = actor(BODY + "<script>" + body.format("".join(LINE)) + "</script>")
    assert [trajectory.kind for trajectory in found.script.trajectories] == ["early", "late"]


@pytest.mark.parametrize("first", ["1 2 0 0 0 0", "1 2 1.0 1.5708 0 3.1416"])
def test_skin_becomes_an_upright_cylinder_told_once(first):
    text = "".join("<actor name='{}'>{}{}</actor>".format(name, SKIN, script(point(0, first), LINE[1]))
                   for name in ("a", "b"))
    loaded = world(text)
    note, = loaded.notes
    assert "a.world" in note and "a cylinder, 0.5 m wide and 1.75 m high" in note and "<actor>" in note
    link, = loaded.models[0].links
    assert link.name == "a_pose" and link.collisions[0].geometry == Cylinder(0.25, 1.75)
    place = compose(loaded.models[0].pose, link.pose)
    assert place[0] == pytest.approx((1.0, 2.0, 0.875)) and rotate(place[1], (0, 0, 1)) == pytest.approx((0, 0, 1))


def test_visual_collides_where_nothing_else_of_the_link_does():
    found, loaded = actor("<link name='l'><visual name='v'>" + BOX + "</visual></link>" + script(*LINE))
    assert loaded.notes == () and [part.name for part in found.links[0].collisions] == ["v"]


@pytest.mark.parametrize("points, words", [
    ((point(0, "nan 0 0 0 0 0"),) + LINE[1:], "pose is"), ((point("nan", "0 0 0 0 0 0"),) + LINE[1:], "time is"),
    ((point(-1, "0 0 0 0 0 0"),) + LINE[1:], "time is -1"),
    ((point(1e300, "0 0 0 0 0 0"),) + LINE[:1], "time is 1e+300"),
    ((point(9, "1e300 0 0 0 0 0"),) + LINE[:1], "at most 1e+06 m"), ((point(9, "1 2"),) + LINE[:1], "6 numbers")])
def test_way_point_that_cannot_be_used_is_left_out(points, words):
    found, loaded = actor(BODY + script(*points))
    assert any(words in note and "this way point is left out" in note and "a.world" in note for note in loaded.notes)
    assert len(found.script.trajectories[0].times) == 1


def test_unsorted_repeated_and_single_way_points_are_told():
    found, loaded = actor(BODY + script(LINE[1], LINE[0]))
    assert found.script.trajectories[0].times == (0.0, 4.0) and "not sorted by time" in loaded.notes[0]
    found, loaded = actor(BODY + script(LINE[0], LINE[1], point(4, "9 9 0 0 0 0")))
    assert found.script.trajectories[0].poses[1][0] == (9.0, 9.0, 0.0) and "two way points at 4 s" in loaded.notes[0]
    found, loaded = actor(BODY + script(LINE[0]))
    assert "one way point only: the actor stays there" in loaded.notes[0] and found.pose[0] == (1.0, 2.0, 0.0)


@pytest.mark.parametrize("attributes, words", [('tension="2"', "tension"), ('tension="x"', "tension"),
                                               ('id="first"', "id is")])
def test_bad_attributes_are_told(attributes, words):
    found, loaded = actor(BODY + script(*LINE, attributes=attributes + ' type="walking"'))
    note, = loaded.notes
    assert words in note and found.script.trajectories[0].tension == 0.0


def test_empty_trajectory_joint_and_no_body_are_told():
    found, loaded = actor(BODY + script())
    assert "no usable <waypoint>" in loaded.notes[0] and found.script.trajectories == ()
    _, loaded = actor(script(*LINE))
    assert "has no link" in loaded.notes[0] and loaded.models == ()
    joint = "<joint name='j' type='fixed'><parent>body</parent><child>hat</child></joint>"
    found, loaded = actor(BODY + "<link name='hat'/>" + joint + script(*LINE))
    assert "joints of an <actor> are not simulated" in loaded.notes[0] and found.joints == ()


def test_too_many_way_points_leave_the_actor_out(monkeypatch):
    monkeypatch.setattr("m2wr_sim.model.sdf.actor.MOST_POINTS", 1)
    found, loaded = actor(BODY + script(*LINE))
    assert found is None and "2 way points" in loaded.notes[0] and "this actor is left out" in loaded.notes[0]
