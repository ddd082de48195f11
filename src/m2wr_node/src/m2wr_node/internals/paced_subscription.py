# SPDX-License-Identifier: BSD-3-Clause
"""Subscribe to a topic and ask its publishers for few messages a second of wall time.

Need: a viewer shows thirty pictures a second. A simulation at full speed publishes thousands of states a second; to
make and to send them costs it time, and to read them costs the viewer time. A ``throttle`` node would cost the
simulation the same.

Uses: of ``rospy.impl.tcpros_pubsub.TCPROSSub`` the method ``get_header_fields``, whose fields go to the publisher, and
the attribute ``resolved_name``. Publishers of :mod:`m2wr_node.internals.subscriber_connections` read the field; all
others ignore it, as the protocol of TCPROS says.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: the subscriber gets all messages.
"""
from __future__ import annotations

from typing import Any, Callable, Dict

import rospy
from rospy.impl import tcpros_pubsub

from m2wr_node.internals.subscriber_link import PERIOD_FIELD

_periods: Dict[str, float] = {}     # by resolved name


def _with_period(original: Callable[[Any], Dict[str, str]]) -> Callable[[Any], Dict[str, str]]:
    def get_header_fields(protocol: Any) -> Dict[str, str]:
        fields = original(protocol)
        period = _periods.get(protocol.resolved_name)
        if period:
            fields[PERIOD_FIELD] = "%g" % period
        return fields
    return get_header_fields


def subscribe_paced(topic: str, period: float, message_class: type, callback: Callable[..., object],
                    *arguments: Any, **options: Any) -> rospy.Subscriber:
    """Return a subscriber of this process that wants at most one message in some wall time from each publisher.

    The newest message comes in any case, later if need be.

    Parameters
    ----------
    topic : str
    period : float
        Least wall time between two messages [s].
    message_class : type
    callback : callable
    *arguments, **options
        Further ones of rospy.Subscriber.

    Returns
    -------
    rospy.Subscriber
    """
    original = getattr(getattr(tcpros_pubsub, "TCPROSSub", None), "get_header_fields", None)
    if original is not None and not _periods:
        tcpros_pubsub.TCPROSSub.get_header_fields = _with_period(original)
    _periods[rospy.resolve_name(topic)] = period
    return rospy.Subscriber(topic, message_class, callback, *arguments, **options)
