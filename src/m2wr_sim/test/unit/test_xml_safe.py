# SPDX-License-Identifier: BSD-3-Clause
"""Parsing of untrusted XML: what is refused, and where errors say that it is."""
import time

import pytest

from m2wr_sim.model.xml import safe as safe_xml
from m2wr_sim.model.xml.safe import XmlError, parse_bool, parse_float, parse_int, parse_vector, parse_xml

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE robot [
  <!ENTITY a "ha">
  <!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
]>
<robot name="&b;"/>"""


MANY = " ".join("a%d='1'" % k for k in range(safe_xml.MAX_ATTRIBUTES + 1))


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
def test_entity_declarations_are_rejected_and_reported(text):
    message = message_of(parse_xml, text, "bad.urdf")
    assert message.startswith("bad.urdf:")
    assert "entity" in message and "expected plain XML" in message


def test_outer_document_type_is_not_fetched():
    root = parse_xml('<!DOCTYPE r SYSTEM "file:///nonexistent/never.dtd"><r><x>1</x></r>', "a.sdf")
    assert root.findtext("x") == "1"


@pytest.mark.parametrize("text, line", [("<a>\n<b>\n</a>", 3), ("", None), ("no xml", 1), ("<a/><b/>", 1),
                                        ("<r>\n&unknown;</r>", 2), ("<a b='1' b='2'/>", 1)])
def test_malformed_text_names_file_and_line(text, line):
    message = message_of(parse_xml, text, "some file.world")
    assert message.startswith("some file.world:" + ("" if line is None else "{}:".format(line)))


def test_missing_file_and_folder_are_reported(tmp_path):
    assert str(tmp_path / "no.world") in message_of(safe_xml.read_file, str(tmp_path / "no.world"))
    assert "directory" in message_of(safe_xml.read_file, str(tmp_path))


def test_declared_encodings_are_read():
    latin = '<?xml version="1.0" encoding="iso-8859-1"?><r name="\u00e4"/>'
    assert parse_xml(latin.encode("latin-1"), "a").get("name") == "\u00e4"
    assert parse_xml(latin, "a").get("name") == "\u00e4"
    assert "not well-formed" in message_of(parse_xml, b'<?xml version="1.0" encoding="nonsense-8"?><r/>', "a")


def test_leading_blank_lines_and_default_namespace_are_accepted():
    root = parse_xml('\n  <?xml version="1.0"?><robot xmlns="http://www.ros.org"><link/></robot>', "a")
    assert (root.tag, root[0].tag) == ("robot", "link")


def test_place_names_file_line_and_path_with_names():
    name = "/tmp/my worlds/50%.world"
    root = parse_xml('<sdf>\n<world name="w">\n<model name="m">\n<x/></model></world></sdf>', name)
    assert safe_xml.place(root.find("world/model/x")) == name + ":4: <sdf/world[w]/model[m]/x>"


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999", "one", "1_0", "1 2"])
def test_bad_numbers_are_rejected_with_the_text_found(text):
    mass, = parse_xml("<r>\n<mass>{}</mass></r>".format(text), "a.sdf")
    message = message_of(parse_float, mass, mass.text, "mass")
    assert message == 'a.sdf:2: <r/mass>: mass is "{}"; expected a finite number'.format(text)


def test_values_of_texts():
    root = parse_xml("<r/>", "a")
    assert parse_float(root, " 2.5 ") == 2.5 and parse_float(root, "inf", "x", True) == float("inf")
    assert parse_int(root, "50.0") == 50 and parse_vector(root, "1 2\n3", 3) == (1.0, 2.0, 3.0)
    assert parse_bool(root, "TRUE") is True and parse_bool(root, " 0 ") is False


@pytest.mark.parametrize("call, text, expected", [
    (parse_int, "1.5", "a whole number"),
    (lambda *given: parse_int(*given, "x", 1), "0", "a whole number of at least 1"),
    (parse_bool, "maybe", "true or false"), (lambda *given: parse_vector(*given, 3), "1 2", "3 numbers")])
def test_other_bad_values_name_what_was_expected(call, text, expected):
    message = message_of(call, parse_xml("<r/>", "a"), text)
    assert message.startswith("a:1: <r>: ") and message.endswith("expected " + expected)


def test_deep_nesting_is_rejected_in_small_and_large_documents():
    deep = "<a>" * 5000 + "</a>" * 5000
    assert "a.sdf" in message_of(parse_xml, "<r>" + deep + "</r>", "a.sdf")
    padding = "<!-- {} -->".format("x" * (9 * 2 ** 20))
    assert "nested deeper" in message_of(parse_xml, "<r>" + padding + deep + "</r>", "a.sdf")


def test_fifty_megabytes_load_and_the_limit_is_reported(monkeypatch):
    text = "<sdf>" + "<x>{}</x>".format("y" * 11 * 2 ** 20) + "<z>{}</z>".format(" " * 39 * 2 ** 20) + "</sdf>"
    started = time.perf_counter()
    assert len(parse_xml(text, "big.sdf")) == 2
    assert time.perf_counter() - started < 30.0
    monkeypatch.setattr(safe_xml, "MAX_BYTES", 1000)
    assert "expected at most" in message_of(parse_xml, text, "big.sdf")


# ---- attributes of one element: libxml2 compares each with every other

@pytest.mark.parametrize("text", [
    "<r>\n<a %s/></r>" % MANY, "<r>\n<a b='>' %s/></r>" % MANY, ("<r>\n<a %s/></r>" % MANY).encode("utf-16")],
    ids=["plain", "sign in a value", "utf-16"])
def test_too_many_attributes_are_rejected_with_the_line(text):
    message = message_of(parse_xml, text, "m.urdf")
    assert message.startswith("m.urdf:2: an element has 100") and "attributes; expected at most 1000" in message


@pytest.mark.parametrize("text", [
    "<r><!-- <a %s/> --><a/></r>" % MANY, "<r><![CDATA[%s]]></r>" % MANY, "<r>it's a %s</r>" % MANY,
    "<r a=\"%s\"/>" % MANY, "<r>" + "<a b='1'/>" * 5000 + "</r>"],
    ids=["comment", "cdata", "text", "value", "many elements"])
def test_equal_signs_elsewhere_are_no_attributes(text):
    assert parse_xml(text, "m.urdf").tag == "r"
