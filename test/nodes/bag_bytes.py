# SPDX-License-Identifier: BSD-3-Clause
"""The messages of a bag as bytes, in the order in which the recorder received them."""
import rosbag


def messages_of(path):
    """Return ``{topic: [(name of the publisher, bytes), ...]}``.

    Recorded times are left out: they depend on the load of the machine.
    """
    topics = {}
    with rosbag.Bag(path) as bag:
        entries = []
        # in file order; rosbag's own iterator sorts by recorded time, which several messages may share
        for number, index in bag._connection_indexes.items():
            connection = bag._connections[number]
            sender = connection.header["callerid"]
            entries += [(entry.chunk_pos, entry.offset, connection.topic, sender) for entry in index]
        for place, offset, topic, sender in sorted(entries, key=lambda entry: entry[:2]):
            _, raw, _ = bag._read_message((place, offset), raw=True)
            topics.setdefault(topic, []).append((sender.decode() if isinstance(sender, bytes) else sender, raw[1]))
    return topics


def read_order(path):
    """Return ``{topic: [bytes, ...]}`` as rosbag's reader gives them, sorted by recorded time."""
    topics = {}
    with rosbag.Bag(path) as bag:
        for topic, raw, _ in bag.read_messages(raw=True):
            topics.setdefault(topic, []).append(raw[1])
    return topics


def first_difference(first, second):
    """Return a sentence on where two lists of :func:`messages_of` differ, or None."""
    for number, (one, other) in enumerate(zip(first, second)):
        if one != other:
            return "message %d is %s in one and %s in the other" % (number, one, other)
    if len(first) != len(second):
        return "%d messages in one, %d in the other" % (len(first), len(second))
    return None
