# SPDX-License-Identifier: BSD-3-Clause
"""The spawn_model command: its command line, and reading a description from wherever that points."""
import io

import pytest

from m2wr_sim.ros import spawn_client
from m2wr_sim.ros.spawn_client import SpawnError, normalise, parse, read_description

ROBOT = '<robot name="r"><link name="l"/></robot>'
MINIMAL = ["-urdf", "-param", "robot_description", "-model", "m2wr"]


# -- the command line ---------------------------------------------------------------------------------------------

def test_the_usual_line():
    arguments = parse(MINIMAL + ["-x", "1", "-y", "-2.5", "-z", "0.5", "-R", "0.1", "-P", "-0.2", "-Y", "3"])
    assert arguments.urdf and not arguments.sdf and arguments.param == "robot_description" and arguments.model == "m2wr"
    assert [getattr(arguments, name) for name in "xyzRPY"] == [1.0, -2.5, 0.5, 0.1, -0.2, 3.0]


@pytest.mark.parametrize("word, number", [
    ("-1e-05", -1e-05), ("-2.5E+1", -25.0), ("-.5e1", -5.0), ("-3.e0", -3.0), ("1e-3", 1e-3), ("-7", -7.0)])
def test_numbers_with_exponents_are_no_options(word, number):
    """A launch file's $(eval) prints small numbers so."""
    arguments = parse(MINIMAL + ["-x", word, "-J", "wheel", word])
    assert arguments.x == pytest.approx(number, rel=1e-15) and arguments.joints == [("wheel", number)]


def test_a_model_named_like_a_number_is_left_alone():
    assert parse(["-urdf", "-param", "p", "-model", "1e5"]).model == "1e5"


def test_the_defaults_are_upstreams():
    arguments = parse(MINIMAL)
    assert [getattr(arguments, name) for name in "xyzRPY"] == [0.0] * 6
    assert (arguments.reference_frame, arguments.gazebo_namespace, arguments.robot_namespace) == ("", "/gazebo", None)
    assert arguments.joints == [] and not arguments.wait
    assert not (arguments.unpause or arguments.bond or arguments.package_to_model)


def test_all_the_rest():
    arguments = parse(["-sdf", "-database", "can", "-model", "c", "-J", "a", "1", "-J", "b", "-0.5", "-unpause", "-b",
                       "-wait", "m2wr", "-package_to_model", "-reference_frame", "m2wr::link",
                       "-gazebo_namespace", "/sim", "-robot_namespace", "r1"])
    assert arguments.joints == [("a", 1.0), ("b", -0.5)] and arguments.database == "can" and arguments.wait == "m2wr"
    assert arguments.unpause and arguments.bond and arguments.package_to_model
    assert (arguments.reference_frame, arguments.gazebo_namespace) == ("m2wr::link", "/sim")
    assert arguments.robot_namespace == "r1"


@pytest.mark.parametrize("line, words", [
    ([], "required"), (["-urdf", "-param", "p"], "-model"), (["-urdf", "-model", "m"], "-file"),
    (["-param", "p", "-model", "m"], "-urdf"), (["-urdf", "-sdf", "-param", "p", "-model", "m"], "not allowed"),
    (["-urdf", "-param", "p", "-file", "f", "-model", "m"], "not allowed"), (MINIMAL + ["-x", "far"], "invalid float"),
    (MINIMAL + ["-x"], "expected one argument"), (MINIMAL + ["-J", "joint"], "expected 2 arguments"),
    (MINIMAL + ["-J", "joint", "up"], "-J takes a joint and a number"),
    (MINIMAL + ["-z", "nan"], "-z takes a finite number"),
    (MINIMAL + ["-Y", "inf"], "-Y takes a finite number"), (MINIMAL + ["--colour", "red"], "unrecognized"),
    (["-urdf", "-database", "can", "-model", "m"], "-database goes with -sdf")])
def test_misuse_ends_with_code_2_and_says_why(line, words, capsys):
    with pytest.raises(SystemExit) as caught:
        parse(line)
    assert caught.value.code == 2 and words in capsys.readouterr().err


def test_misuse_ends_before_ros_is_asked_for(monkeypatch, capsys):
    monkeypatch.setattr(spawn_client.rospy, "init_node", lambda *_, **__: pytest.fail("ROS was started"))
    with pytest.raises(SystemExit) as caught:
        spawn_client.main(["spawn_model", "-urdf"])
    assert caught.value.code == 2


def test_help_ends_well(capsys):
    with pytest.raises(SystemExit) as caught:
        parse(["-h"])
    assert caught.value.code == 0 and "-reference_frame" in capsys.readouterr().out


# -- reading ------------------------------------------------------------------------------------------------------

def refusal(arguments):
    with pytest.raises(SpawnError) as caught:
        read_description(arguments)
    return str(caught.value)


def from_file(path):
    return parse(["-urdf", "-file", str(path), "-model", "m"])


def test_a_file_is_read(tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text('<?xml version="1.0"?>\n<!-- a robot -->' + ROBOT)
    assert read_description(from_file(path)) == ROBOT


def test_a_missing_file_is_reported(tmp_path):
    message = refusal(from_file(tmp_path / "gone.urdf"))
    assert "gone.urdf" in message and "No such file" in message


def test_a_folder_is_no_file(tmp_path):
    assert str(tmp_path) in refusal(from_file(tmp_path))


@pytest.mark.parametrize("content", [b"", b"  \n\t"])
def test_an_empty_file_is_named(tmp_path, content):
    path = tmp_path / "empty.urdf"
    path.write_bytes(content)
    assert refusal(from_file(path)) == "Error: file %s is empty" % path


def test_a_file_that_is_no_text_is_named(tmp_path):
    path = tmp_path / "binary.urdf"
    path.write_bytes(b"\xff\xfe\x00<robot/>")
    assert "binary.urdf" in refusal(from_file(path))


@pytest.mark.parametrize("value, words", [(None, "is not set"), ("", "is empty"), ("  ", "is empty"), (5, "is empty")])
def test_a_parameter_without_a_description_is_named(monkeypatch, value, words):
    monkeypatch.setattr(spawn_client.rospy, "get_param", lambda name, default=None: value)
    message = refusal(parse(MINIMAL))
    assert "robot_description" in message and words in message


def test_a_parameter_is_read(monkeypatch):
    monkeypatch.setattr(spawn_client.rospy, "get_param", {"robot_description": ROBOT}.get)
    assert read_description(parse(MINIMAL)) == ROBOT


def test_standard_input_is_read(monkeypatch):
    arguments = parse(["-urdf", "-stdin", "-model", "m"])
    monkeypatch.setattr("sys.stdin", io.StringIO(ROBOT))
    assert read_description(arguments) == ROBOT
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert "standard input" in refusal(arguments)


def test_the_database_means_an_include():
    text = read_description(parse(["-sdf", "-database", "construction_barrel", "-model", "m"]))
    assert "<include><uri>model://construction_barrel</uri></include>" in text and text.startswith("<sdf")


def test_the_name_of_a_database_model_is_escaped():
    text = read_description(parse(["-sdf", "-database", "a</uri><static>1</static>&", "-model", "m"]))
    assert "<uri>model://a&lt;/uri&gt;" in text and "<static>" not in text


# -- normalising --------------------------------------------------------------------------------------------------

def test_declaration_and_comments_go_text_becomes_ascii():
    text = ('<?xml version="1.0" encoding="UTF-8"?><!-- first -->'
            '<robot name="r\u00e9"><!-- inner --><link name="l"/></robot>')
    assert normalise(text) == '<robot name="r&#233;"><link name="l"/></robot>'


def test_meshes_are_renamed_only_if_asked_for():
    text = ('<robot><mesh filename="package://p/a.stl"/><mesh filename="file:///package://b"/>'
            '<x filename="package://c"/></robot>')
    assert normalise(text) == text
    assert normalise(text, package_to_model=True) == text.replace("package://p/a", "model://p/a")


@pytest.mark.parametrize("text", ["<robot>", "robot", "<robot></link>", "<a/><b/>", "<robot name=r/>"])
def test_text_that_is_no_xml_is_refused(text):
    with pytest.raises(SpawnError) as caught:
        normalise(text)
    assert str(caught.value).startswith("Invalid XML: ")


@pytest.mark.parametrize("declaration", [
    '<!DOCTYPE robot [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>', '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/x.dtd">',
    '<!DOCTYPE robot [<!ENTITY f SYSTEM "file:///etc/hostname">]>'])
def test_document_types_are_refused(declaration):
    with pytest.raises(SpawnError) as caught:
        normalise(declaration + '<robot name="r"/>')
    assert "Invalid XML" in str(caught.value) and "document type" in str(caught.value)
