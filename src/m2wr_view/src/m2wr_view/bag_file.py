# SPDX-License-Identifier: BSD-3-Clause
"""Opens recorded bags; each error is reported in one sentence that says what helps."""
from __future__ import annotations

import os
from contextlib import contextmanager
from typing import Any, Dict, Iterator, List, Tuple

import rosbag
import roslib.message

from m2wr_view.errors import ViewError


@contextmanager
def open_bag(path: str) -> Iterator[Any]:
    """Yield an open ``rosbag.Bag``; all errors inside the ``with`` become a ViewError."""
    if path.endswith(".active"):
        raise ViewError("bag %s: the recorder is still writing it, or was killed before it could finish; expected a "
                        "finished bag (stop the recorder with Ctrl-C, or run `rosbag reindex` on the file)" % path)
    if not os.path.exists(path) and os.path.exists(path + ".active"):
        raise ViewError("bag %s: there is only %s.active; the recorder has not finished, expected a finished bag "
                        "(`rosbag reindex` makes one of a file whose recorder was killed)" % (path, path))
    try:
        with rosbag.Bag(path) as bag:
            yield bag
    except OSError as error:
        raise ViewError("bag %s: %s; expected a readable bag file" % (path, error.strerror or error)) from error
    except rosbag.ROSBagUnindexedException:
        raise ViewError("bag %s: it has no index, so it was not finished; expected a finished bag (try "
                        "`rosbag reindex`)" % path) from None
    except (ViewError, GeneratorExit):
        raise
    except Exception as error:      # damaged bytes cause errors of any kind
        raise ViewError("bag %s: it cannot be read (%s: %s); expected a bag of format 2.0 that is whole"
                        % (path, type(error).__name__, error)) from error


def topic_types(bag: Any) -> Dict[str, str]:
    """Return {topic: message type} of an open bag."""
    return {topic: info.msg_type for topic, info in bag.get_type_and_topic_info().topics.items()}


def check_types(bag: Any, path: str, expected: Dict[str, str]) -> None:
    """Check the types of topics.

    Parameters
    ----------
    bag : rosbag.Bag
    path : str
        Its path, for messages.
    expected : dict
        {topic: message type}; topics may be missing in the bag.

    Raises
    ------
    ViewError
        If a topic has another type.
    """
    for topic, kind in topic_types(bag).items():
        if topic in expected and kind != expected[topic]:
            raise ViewError("bag %s: topic %s has the type %s; expected %s" % (path, topic, kind, expected[topic]))


def messages_of(bag: Any, path: str, topics: List[str]) -> Iterator[Tuple[str, Any, Any]]:
    """Yield (topic, message, recorder's time) of topics, in the order of recording.

    Parameters
    ----------
    bag : rosbag.Bag
    path : str
        Its path, for messages.
    topics : list of str

    Raises
    ------
    ViewError
        If the bag defines a type in another way than this installation: its messages have other fields.
    """
    found = bag.get_type_and_topic_info()
    wanted = {info.msg_type for topic, info in found.topics.items() if topic in topics}
    for kind in sorted(wanted):
        installed = roslib.message.get_message_class(kind)
        if installed is None or found.msg_types.get(kind) != installed._md5sum:
            raise ViewError("bag %s: %s has the md5 sum %s there; expected %s, as in this installation" % (
                path, kind, found.msg_types.get(kind), installed and installed._md5sum))
        # else rosbag would make a class of the definition in the bag: its fields, and its code, are the bag's
        getattr(rosbag.bag, "_message_types", {})[installed._md5sum] = installed
    for topic, message, recorded in bag.read_messages(topics):
        if message._md5sum != roslib.message.get_message_class(message._type)._md5sum:
            raise ViewError("bag %s: topic %s has more than one definition of %s" % (path, topic, message._type))
        yield topic, message, recorded


def read_messages(path: str, expected: Dict[str, str]) -> Iterator[Tuple[str, Any, Any]]:
    """Yield (topic, message, recorder's time) of topics, in the order of recording.

    Parameters
    ----------
    path : str
        A finished bag.
    expected : dict
        {topic: message type}; topics may be missing in the bag.

    Raises
    ------
    ViewError
        If the bag cannot be read or a topic has another type.
    """
    with open_bag(path) as bag:
        check_types(bag, path, expected)
        for entry in messages_of(bag, path, list(expected)):
            yield entry
