# SPDX-License-Identifier: BSD-3-Clause
"""Documents that break rules of XML but that Gazebo's parser accepts."""
import logging

import pytest

from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.xml.lenient import tidy
from m2wr_sim.model.xml.safe import XmlError, parse_xml

BODY = '<sdf version="1.6">\n<world name="w"><x>1</x></world>\n</sdf>'


@pytest.mark.parametrize("data, slip", [
    (b'\n\n<?xml version="1.0"?>\n' + BODY.encode(), "in front of the XML declaration"),
    (b'<!-- licence -->\n<?xml version="1.0"?>\n' + BODY.encode(), "in front of the XML declaration"),
    (BODY.replace("<x>", "<!-- -- walls\n-- --><x>").encode(), '"--" inside a comment'),
    (BODY.replace("<x>", "<!---- walls ----><x>").encode(), '"--" inside a comment'),
    (BODY.replace("<x>", "<!-- caf\u00e9 --><x>").encode("latin-1"), "Latin-1"),
    (BODY.replace("<x>", "<n>this & that &amp; &lt; &#38;</n><x>").encode(), '"&amp;"'),
    (BODY.replace("<x>", "<sensor:camera sensor:a='1'/><x>").encode(), "prefix sensor"),
])
def test_errors_are_corrected_and_reported_once(data, slip, caplog):
    with caplog.at_level(logging.WARNING):
        root = parse_xml(data, "a.world")
    assert root.find("world").findtext("x") == "1"
    assert [record.getMessage().startswith("a.world:") and slip in record.getMessage() for record in caplog.records] \
        == [True]
    with pytest.raises(XmlError):
        parse_xml(data, "a.world", strict=True)


def test_texts_names_and_lines_come_out_as_written():
    text = '<!-- one\n-- two\n--><sdf name="a &amp; b">\n<m name="M&M"/>\n<n>caf\u00e9 &lt;</n></sdf>'
    root = parse_xml(text, "a")
    assert (root.get("name"), root[0].get("name"), root[1].text) == ("a & b", "M&M", "caf\u00e9 <")
    assert (root[0].sourceline, root[1].sourceline) == (4, 5)
    declared = '<?xml version="1.0" encoding="iso-8859-1"?>' + text
    assert parse_xml(declared, "a")[1].text == parse_xml(declared.encode("latin-1"), "a")[1].text == "caf\u00e9 <"


def test_what_is_broken_otherwise_is_rejected_in_the_first_words():
    for text in ("<sdf><!-- -- --><world></sdf>", "<sdf>&nothing; <!-- -- --></sdf>", "<sdf><!-- never closed </sdf>",
                 '<!DOCTYPE r [<!ENTITY x "y">]><sdf><!-- -- -->&x;</sdf>'):
        with pytest.raises(XmlError) as caught:
            parse_xml(text, "a.world")
        assert str(caught.value).startswith("a.world:1")


def test_a_sound_document_is_left_alone():
    assert tidy(BODY.encode()) == (BODY.encode(), [])


def test_unclosed_comments_stay_as_they_are():
    """What this costs is measured in test_behaviour_text_cost."""
    text = "<sdf>" + "<!-- " * 1000
    assert tidy(text.encode()) == (text.encode(), [])


def test_world_with_corrected_errors_loads():
    box = ('<model name="b&b"><static>1</static><link name="l"><collision name="c"><geometry><box><size>1 1 1</size>'
           '</box></geometry></collision></link></model>')
    world = load_world(' <?xml version="1.0"?><sdf version="1.6"><world name="w"><!-- --x-- -->%s</world></sdf>' % box)
    assert [model.name for model in world.models] == ["b&b"] and not world.notes
