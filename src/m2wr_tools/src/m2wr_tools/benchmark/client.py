# SPDX-License-Identifier: BSD-3-Clause
"""A process that subscribes to topics and counts their messages, as the subscriber of a measured node.

``python3 -m m2wr_tools.benchmark.client TOPIC ...`` prints ``first TOPIC SECONDS`` when the first message of a topic is
received (by the monotonic clock), and ``counts JSON`` for each line of its input. It ends with its input.
"""
from __future__ import annotations

import json
import sys
import time
from typing import Any, Callable, List

import rospy


class Counter:
    """Counts the messages of one topic without deserialising them."""

    def __init__(self, topic: str, tell: Callable[[str], None]) -> None:
        self.topic, self.count, self.bytes, self._tell = topic, 0, 0, tell
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._take, queue_size=None, tcp_nodelay=True)

    def _take(self, message: Any) -> None:
        if not self.count:
            self._tell("first %s %.6f" % (self.topic, time.monotonic()))
        self.count += 1
        self.bytes += len(message._buff)


def _tell(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(topics: List[str]) -> int:
    """Count until standard input ends."""
    rospy.init_node("benchmark_client", anonymous=True, disable_rostime=True, disable_signals=True)
    counters = [Counter(topic, _tell) for topic in topics]
    _tell("ready")
    for _ in sys.stdin:
        _tell("counts " + json.dumps({counter.topic: (counter.count, counter.bytes) for counter in counters}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
