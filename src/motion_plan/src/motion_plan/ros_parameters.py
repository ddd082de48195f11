# SPDX-License-Identifier: BSD-3-Clause
"""Numbers from the parameter server; an error is one sentence for the user."""
from __future__ import annotations

import math
from typing import Any

import rospy


class NodeError(Exception):
    """A node cannot run; the text is one sentence for the user."""


def required_number(name: str, meaning: str, launch_file: str) -> float:
    """Return a required global parameter as a float.

    Parameters
    ----------
    name : str
        Of the parameter.
    meaning : str
        What the parameter is, for messages.
    launch_file : str
        One that sets it, for messages.

    Raises
    ------
    NodeError
        If it is missing, not a number or not finite; the text says how to set it.
    """
    if not rospy.has_param(name):
        raise NodeError('parameter "%s" (%s) is not set: set it with "rosparam set %s VALUE" or start the node by '
                        '"roslaunch motion_plan %s", which sets it' % (name, meaning, name, launch_file))
    return finite_number(name, rospy.get_param(name), meaning)


def optional_number(name: str, default: float, meaning: str) -> float:
    """Return a global parameter as a finite float.

    Parameters
    ----------
    name : str
        Of the parameter.
    default : float
        Value if it is not set.
    meaning : str
        What the parameter is, for messages.

    Raises
    ------
    NodeError
        If it is not a finite number.
    """
    return finite_number(name, rospy.get_param(name, default), meaning)


def finite_number(name: str, value: Any, meaning: str) -> float:
    """Return the value of a parameter as a float.

    Parameters
    ----------
    name : str
        Of the parameter.
    value : object
        As rospy.get_param returns it.
    meaning : str
        What the parameter is, for messages.

    Raises
    ------
    NodeError
        If it is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise NodeError('parameter "%s" (%s) is %r: expected a finite number' % (name, meaning, value))
    return number
