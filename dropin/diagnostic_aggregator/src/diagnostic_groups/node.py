# SPDX-License-Identifier: BSD-3-Clause
"""The node ``aggregator_node``: ``/diagnostics`` in groups, on ``/diagnostics_agg``."""
from __future__ import annotations

import math
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from diagnostic_groups.analyzers import Aggregator, ConfigurationError, Item
from m2wr_node.ros.starting import start_node


def to_status(item: Item) -> DiagnosticStatus:
    """Return the message of an item."""
    return DiagnosticStatus(level=bytes([item.level]), name=item.name, message=item.message,
                            hardware_id=item.hardware, values=[KeyValue(*pair) for pair in item.values])


def to_item(status: DiagnosticStatus, now: float) -> Item:
    """Return the item of a message; a level that is unknown is an error.

    Parameters
    ----------
    status : DiagnosticStatus
    now : float
        When it came [s].
    """
    level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
    return Item(status.name, level if 0 <= level <= 3 else 2, status.message, status.hardware_id,
                [(pair.key, pair.value) for pair in status.values], now)


class AggregatorNode:
    """Publishes the groups at a fixed rate of wall time.

    Parameters
    ----------
    aggregator : Aggregator
    rate : float
        [Hz].
    """

    def __init__(self, aggregator: Aggregator, rate: float) -> None:
        self._aggregator, self._period = aggregator, 1.0 / rate
        self._port = rospy.Publisher("/diagnostics_agg", DiagnosticArray, queue_size=1)
        self._top = rospy.Publisher("/diagnostics_toplevel_state", DiagnosticStatus, queue_size=1)
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_array, queue_size=1000)

    def _on_array(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            self._aggregator.add(to_item(status, now))

    def run(self) -> None:
        """Publish until ROS ends."""
        while not rospy.is_shutdown():
            report = self._aggregator.report(time.monotonic())
            array = DiagnosticArray(status=[to_status(item) for item in report])
            array.header.stamp = rospy.Time.now()
            self._port.publish(array)
            self._top.publish(DiagnosticStatus(name="toplevel_state", level=bytes([self._aggregator.worst(report)])))
            time.sleep(self._period)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("diagnostic_aggregator")
    given = rospy.get_param("~", {})
    given = given if isinstance(given, dict) else {}
    rate = given.get("pub_rate", 1.0)
    try:
        if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not 0.01 <= rate <= 1000.0 \
                or math.isnan(rate):
            raise ConfigurationError("~pub_rate is %.60r; expected a number from 0.01 to 1000 Hz" % (rate,))
        AggregatorNode(Aggregator(given), rate).run()
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    return 0
