# SPDX-License-Identifier: BSD-3-Clause
"""Ids of channels and services: told once, never used again."""
from m2wr_bridge.foxglove.catalogue import Catalogue

TEXT, NUMBER = ("std_msgs/String", "string data\n"), ("std_msgs/Int32", "int32 data\n")
EMPTY = ("std_srvs/Empty", "", "")


def test_only_changes_are_told():
    catalogue = Catalogue()
    first = catalogue.update({"/a": TEXT}, {"/s": EMPTY})
    assert [one["topic"] for one in first.channels] == ["/a"] and [one["name"] for one in first.services] == ["/s"]
    assert catalogue.update({"/a": TEXT}, {"/s": EMPTY}) == ([], [], [], [])
    second = catalogue.update({"/a": TEXT, "/b": TEXT}, {})
    assert [one["topic"] for one in second.channels] == ["/b"] and second.lost_services == [first.services[0]["id"]]
    assert [one["topic"] for one in catalogue.everything().channels] == ["/a", "/b"]


def test_a_topic_with_another_type_gets_another_id():
    catalogue = Catalogue()
    first = catalogue.update({"/a": TEXT}, {}).channels[0]["id"]
    changes = catalogue.update({"/a": NUMBER}, {})
    assert changes.lost_channels == [first] and changes.channels[0]["id"] != first
    catalogue.update({}, {})
    assert catalogue.update({"/a": TEXT}, {}).channels[0]["id"] not in (first, changes.channels[0]["id"])
