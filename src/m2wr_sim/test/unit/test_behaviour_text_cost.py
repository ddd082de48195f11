# SPDX-License-Identifier: BSD-3-Clause
"""The cost of reading a text grows linearly with its length: no short text can block the simulation.

Cost is the least CPU time of several runs.
"""
import struct
import time

import pytest

from m2wr_sim.errors import SimError
from m2wr_sim.model.mesh import files as mesh_files
from m2wr_sim.model.sdf.loader import load_sdf, load_world
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.xml.lenient import root_tag, tidy, without_comments

LEAST = 0.02            # CPU time below which a ratio of two says nothing [s]
MOST = 5.0              # CPU time that a text of LONG characters may take [s]
LONG = 250000
GROWTH = 3.0            # of the cost when the length doubles: 2 for what is linear, 4 for what is quadratic
ATTEMPTS = 4            # another program that takes the cache away disturbs one, growth all of them
READERS = {
    "root_tag": root_tag, "without_comments": without_comments, "tidy": lambda text: tidy(text.encode()),
    "urdf": lambda text: load_urdf(text, "a.urdf"), "sdf": lambda text: load_sdf(text, "a.sdf")}
PIECES = [
    "<?xml ", "<?xml ?>", "<?a?>", "<?", "<!--", "<!---->", "<!-- - --", "<!DOCTYPE ", "<!DOCTYPE a []>",
    "<!DOCTYPE a [", " ", "\n", "\ufeff", "&", "&a", "&#1", "<", "<a", "<a>", "<a/>", "<a:b", "<a:b ", "a:", ":", "a",
    " a:b=''",
    "xmlns:a=''", "<robot>", "<link name='a'/>", "<![CDATA[", "]]>", "package://", "<?xml -- ><!--", "</a>",
    "<gazebo/>",
    "'", "\"", "\0"]
HEADS = {"urdf": ["<robot name='r'>"], "sdf": ["<sdf version='1.6'><model name='m'>"]}
ANY_HEADS = ["", "<?xml version='1.0'?>", "<!-- ", "<?xml "]


def cost(read, text, tries=3):
    """Return the least CPU time of some tries [s]."""
    best = float("inf")
    for _ in range(tries):
        begin = time.thread_time()
        try:
            read(text)
        except SimError:
            pass
        best = min(best, time.thread_time() - begin)
        if best < LEAST:
            break
    return best


def check_doubled(cost_of, least, most):
    """Double an input of ``least`` until it costs something, then hold its growth and what the largest would take."""
    length = least
    while length < most:
        one = cost_of(length)
        if one > LEAST:
            for _ in range(ATTEMPTS):
                two = cost_of(2 * length)
                if two < GROWTH * one:
                    break
                one = cost_of(length)
            assert two < GROWTH * one, "{} characters {:.3f} s, twice as many {:.3f} s".format(length, one, two)
            assert one * most / length < MOST, "{:.3f} s for {} characters".format(one, length)
            return
        length *= 4


def check_growth(read, make, least=2000, most=LONG):
    """Hold what reading a text costs that ``make`` makes of a length."""
    check_doubled(lambda length: cost(read, make(length)), least, most)


@pytest.mark.parametrize("name", sorted(READERS))
def test_cost_grows_with_length_for_every_piece_repeated(name):
    for head in HEADS.get(name, ANY_HEADS):
        for piece in PIECES:
            try:
                check_growth(READERS[name], lambda length: head + piece * (length // len(piece)))
            except AssertionError as error:
                raise AssertionError("{!r} + {!r} ...: {}".format(head, piece, error)) from error


def test_cost_of_many_prefixes_is_linear():
    check_growth(READERS["tidy"], lambda length: "".join("<p%d:a " % k for k in range(length // 8)))


@pytest.mark.parametrize("name, root", [("urdf", "robot"), ("sdf", "sdf")])
@pytest.mark.parametrize("inside", ["<{0} {1}/>", "<{0}><a {1}/></{0}>"])
def test_cost_of_many_attributes_is_linear(name, root, inside):
    check_growth(READERS[name], lambda length: inside.format(root, "".join(" a%d='1'" % k for k in range(length // 9))))


@pytest.mark.parametrize("name, head, tail", [("urdf", "<robot name='r' a='", "'/>"), ("urdf", "<robot name='r'>", ""),
                                              ("sdf", "<sdf version='1.6'><model name='m'>", "</model></sdf>")])
@pytest.mark.parametrize("piece", ["x", "&", "1 ", "a:b "])
def test_cost_of_long_values_is_linear(name, head, tail, piece):
    check_growth(READERS[name], lambda length: head + piece * (length // len(piece)) + tail)


def _chain(length, kind, block="", parent=lambda k: k):
    """Return a robot of boxes, each on the one before, with a block of tags for each."""
    count = length // 100
    body = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>" \
        "<collision><geometry><box size='1 1 1'/></geometry></collision>"
    return "<robot name='r'>%s%s%s</robot>" % (
        "".join("<link name='l%d'>%s</link>" % (k, body) for k in range(count)),
        "".join("<joint name='j%d' type='%s'><parent link='l%d'/><child link='l%d'/></joint>" % (
            k, kind, parent(k), k + 1) for k in range(count - 1)),
        "".join(block.format(k) for k in range(count)))


@pytest.mark.parametrize("kind", ["fixed", "continuous"])
@pytest.mark.parametrize("parent", [lambda k: k, lambda k: 0], ids=["chain", "star"])
@pytest.mark.parametrize("block", [
    "", "<gazebo reference='l{0}'><mu1>1</mu1></gazebo>", "<gazebo reference='j{0}'><stopCfm>1</stopCfm></gazebo>",
    "<gazebo reference='x{0}'><mu1>1</mu1></gazebo>"], ids=["plain", "links", "joints", "nothing"])
def test_cost_of_many_links_and_tags_is_linear(kind, parent, block):
    check_growth(READERS["urdf"], lambda length: _chain(length, kind, block, parent), 50000, 400000)


def _world(length):
    models = "".join("<model name='m%d'><static>1</static><link name='l'/></model>" % k for k in range(length // 100))
    states = "".join("<model name='m%d'><pose>1 0 0 0 0 0</pose></model>" % k for k in range(length // 100))
    return "<sdf version='1.6'><world name='w'>%s<state world_name='w'>%s</state></world></sdf>" % (models, states)


def test_cost_of_many_models_and_states_is_linear():
    check_growth(lambda text: load_world(text, "w.world"), _world)


def _obj(count):
    return "".join("v %d 0 0\nv %d 1 0\nv %d 0 1\n" % (k, k, k) for k in range(count)) + "".join(
        "f %d %d %d\n" % (3 * k + 1, 3 * k + 2, 3 * k + 3) for k in range(count))


def _text_stl(count):
    return "solid a\n" + ("facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
                          "endfacet\n") * count + "endsolid a\n"


def _binary_stl(count):
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    return b"\0" * 80 + struct.pack("<I", count) + triangle * count


def _dae(count):
    return ("<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'><asset/><library_geometries>"
            "<geometry id='g'><mesh><source id='s'><float_array id='f' count='{0}'>{1}</float_array><technique_common>"
            "<accessor source='#f' count='{2}' stride='3'><param name='X' type='float'/><param name='Y' type='float'/>"
            "<param name='Z' type='float'/></accessor></technique_common></source><vertices id='v'><input "
            "semantic='POSITION' source='#s'/></vertices><triangles count='{3}'><input semantic='VERTEX' source='#v' "
            "offset='0'/><p>{4}</p></triangles></mesh></geometry></library_geometries></COLLADA>").format(
                9 * count, "0 0 0 1 0 0 0 1 0 " * count, 3 * count, count,
                " ".join(str(k) for k in range(3 * count)))


@pytest.mark.parametrize("kind, make", [("obj", _obj), ("stl", _text_stl), ("stl", _binary_stl), ("dae", _dae)])
def test_cost_of_meshes_is_linear(tmp_path, kind, make):
    def read(count):
        content = make(count)
        path = tmp_path / ("%d.%s" % (count, kind))
        path.write_bytes(content if isinstance(content, bytes) else content.encode())

        def again():
            mesh_files._files.clear()
            assert mesh_files.read_mesh_file(str(path))
        again()             # imports are no part of the cost
        return cost(lambda text: again(), "")

    check_doubled(read, 1000, 50000)


def test_the_texts_that_stopped_the_clock():
    for text in ("<?" + "<?>?><!---->" * 15, "<!---->" * 3 + "<?a?>" * 20 + "<!--" + "--><!--" * 20,
                 "<?" + "?><?" * 30, "<?xml " * 40000, "\n<?xml " + "<?xml" * 48000,
                 "<!DOCTYPE" + "[]" * 1000 + "<!DOCTYPE []>" * 30):
        for read in READERS.values():
            assert cost(read, text, 1) < 1.0


def test_at_most_a_thousand_warnings_are_reported():
    notes = load_sdf("<sdf version='1.6'><model name='m'><link name='l'>%s</link></model></sdf>" % "".join(
        "<a%d/>" % k for k in range(1500)), "a.sdf")[0][0].notes
    assert len(notes) == 1001 and notes[-1] == "500 more warnings are not shown."
