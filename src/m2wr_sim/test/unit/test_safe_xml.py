"""Parsing of foreign XML: what is refused, and how errors name the place."""
import time

import pytest

from m2wr_sim.geometry import IDENTITY
from m2wr_sim.model import safe_xml
from m2wr_sim.model.safe_xml import XmlError, child_bool, child_float, child_int, child_vector, parse_pose, parse_xml

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE robot [
  <!ENTITY a "ha">
  <!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
]>
<robot name="&b;"/>"""


def message_of(call, *arguments):
    with pytest.raises(XmlError) as caught:
        call(*arguments)
    return str(caught.value)


@pytest.mark.parametrize("text", [
    LAUGHS,
    LAUGHS.encode(),
    LAUGHS.replace('<?xml version="1.0"?>', '<?xml version="1.0" encoding="utf-16"?>').encode("utf-16"),
    '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><r>&x;</r>',
    '<!DOCTYPE r [<!ENTITY % p SYSTEM "http://127.0.0.1/p.dtd"> %p;]><r/>',
])
def test_entity_declarations_are_refused_and_named(text):
    message = message_of(parse_xml, text, "bad.urdf")
    assert message.startswith("bad.urdf:")
    assert "entity" in message and "expected plain XML" in message


def test_outer_document_type_is_not_fetched():
    root = parse_xml('<!DOCTYPE r SYSTEM "file:///nonexistent/never.dtd"><r><x>1</x></r>', "a.sdf")
    assert child_float(root, "x", 0.0) == 1.0


@pytest.mark.parametrize("text, line", [("<a>\n<b>\n</a>", 3), ("", None), ("no xml", 1), ("<a/><b/>", 1),
                                        ("<r>\n&unknown;</r>", 2), ("<a:b/>", 1)])
def test_malformed_text_names_file_and_line(text, line):
    message = message_of(parse_xml, text, "some file.world")
    assert message.startswith("some file.world:" + ("" if line is None else "{}:".format(line)))


def test_missing_file_and_folder_are_named(tmp_path):
    assert str(tmp_path / "no.world") in message_of(safe_xml.read_file, str(tmp_path / "no.world"))
    assert "directory" in message_of(safe_xml.read_file, str(tmp_path))


def test_declared_encodings_are_read():
    latin = '<?xml version="1.0" encoding="iso-8859-1"?><r name="\u00e4"/>'
    assert parse_xml(latin.encode("latin-1"), "a").get("name") == "\u00e4"
    assert parse_xml(latin, "a").get("name") == "\u00e4"
    assert "not well-formed" in message_of(parse_xml, b'<?xml version="1.0" encoding="nonsense-8"?><r/>', "a")


def test_leading_blank_lines_of_text_are_forgiven_and_default_namespace_is_dropped():
    root = parse_xml('\n  <?xml version="1.0"?><robot xmlns="http://www.ros.org"><link/></robot>', "a")
    assert (root.tag, root[0].tag) == ("robot", "link")


def test_place_names_file_line_and_path_with_names():
    name = "/tmp/my worlds/50%.world"
    root = parse_xml('<sdf>\n<world name="w">\n<model name="m">\n<x/></model></world></sdf>', name)
    assert safe_xml.place(root.find("world/model/x")) == name + ":4: <sdf/world[w]/model[m]/x>"


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999", "one", "1_0", "1 2"])
def test_bad_numbers_are_refused_with_the_text_found(text):
    root = parse_xml("<r>\n<mass>{}</mass></r>".format(text), "a.sdf")
    message = message_of(child_float, root, "mass", 0.0)
    assert message == 'a.sdf:2: <r/mass>: mass is "{}"; expected a finite number'.format(text)


def test_values_of_children():
    root = parse_xml("<r><f> 2.5 </f><i>50.0</i><t>TRUE</t><n>0</n><v>1 2\n3</v><empty/></r>", "a")
    assert child_float(root, "f", 0.0) == 2.5
    assert child_int(root, "i", 0) == 50
    assert child_bool(root, "t", False) is True and child_bool(root, "n", True) is False
    assert child_vector(root, "v", 3, None) == (1.0, 2.0, 3.0)
    assert child_float(root, "empty", 7.0) == 7.0 and child_float(root, "missing", 8.0) == 8.0
    assert child_float(None, "f", 9.0) == 9.0


@pytest.mark.parametrize("call, text, expected", [
    (lambda r: child_int(r, "x", 0), "1.5", "a whole number"),
    (lambda r: child_int(r, "x", 0, 1), "0", "a whole number of at least 1"),
    (lambda r: child_bool(r, "x", True), "maybe", "true or false"),
    (lambda r: child_vector(r, "x", 3, None), "1 2", "3 numbers"),
    (lambda r: safe_xml.child_positive(r, "x"), "-1", "a positive number"),
])
def test_other_bad_values_name_what_was_expected(call, text, expected):
    message = message_of(call, parse_xml("<r><x>{}</x></r>".format(text), "a"))
    assert message.startswith("a:1: <r/x>: ") and message.endswith("expected " + expected)


def test_pose_text():
    root = parse_xml("<pose/>", "a")
    assert parse_pose(root, "  ") == IDENTITY
    position, (x, y, z, w) = parse_pose(root, "1 2 3 0 0 3.141592653589793")
    assert position == (1.0, 2.0, 3.0)
    assert abs(z) == pytest.approx(1.0) and (x, y, w) == pytest.approx((0.0, 0.0, 0.0))
    assert "six numbers" in message_of(parse_pose, root, "1 2 3")


def test_deep_nesting_is_refused_in_small_and_large_documents():
    deep = "<a>" * 5000 + "</a>" * 5000
    assert "a.sdf" in message_of(parse_xml, "<r>" + deep + "</r>", "a.sdf")
    padding = "<!-- {} -->".format("x" * (9 * 2 ** 20))
    assert "nested deeper" in message_of(parse_xml, "<r>" + padding + deep + "</r>", "a.sdf")


def test_fifty_megabytes_load_and_the_limit_is_named(monkeypatch):
    text = "<sdf>" + "<x>{}</x>".format("y" * 11 * 2 ** 20) + "<z>{}</z>".format(" " * 39 * 2 ** 20) + "</sdf>"
    started = time.perf_counter()
    assert len(parse_xml(text, "big.sdf")) == 2
    assert time.perf_counter() - started < 30.0
    monkeypatch.setattr(safe_xml, "MAX_BYTES", 1000)
    assert "expected at most" in message_of(parse_xml, text, "big.sdf")
