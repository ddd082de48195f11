# SPDX-License-Identifier: BSD-3-Clause
"""The node ``joy_node``: a joystick of Linux, published on ``joy``."""
from __future__ import annotations

import math
import os
import select
import time
from typing import Optional

import rospy
from sensor_msgs.msg import Joy

from joystick.events import EVENT_BYTES, Stick
from m2wr_node.ros.starting import start_node

_RETRY = 1.0            # s of wall time between two attempts to open the device
_LOOK = 0.1             # s of wall time after which the node looks whether it shall end
_MOST_EVENTS = 64       # read at once


def number(name: str, default: float, least: float, most: float) -> float:
    """Return a private parameter; a value out of range is replaced by the default, with a warning.

    Parameters
    ----------
    name : str
    default : float
    least, most : float
        The range, both ends included.
    """
    value = rospy.get_param("~" + name, default)
    fits = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if fits and least <= value <= most:
        return float(value)
    rospy.logwarn("~%s is %.60r; expected a number from %g to %g; using %g", name, value, least, most, default)
    return default


class JoyNode:
    """Reads a joystick until ROS ends; without one it waits, and says so once.

    Parameters
    ----------
    device : str
        File of the joystick.
    stick : Stick
    repeat : float
        Messages a second while nothing changes; 0: none.
    coalesce : float
        Time for which changes of axes are gathered into one message [s].
    """

    def __init__(self, device: str, stick: Stick, repeat: float, coalesce: float) -> None:
        self._device, self._stick, self._coalesce = device, stick, coalesce
        self._period: Optional[float] = 1.0 / repeat if repeat > 0.0 else None
        self._told = False
        self._port = rospy.Publisher("joy", Joy, queue_size=1)

    def run(self) -> None:
        """Open the device again and again, and read it, until ROS ends."""
        while not rospy.is_shutdown():
            try:
                file = os.open(self._device, os.O_RDONLY | os.O_NONBLOCK)
            except OSError as error:
                if not self._told:
                    rospy.logwarn("no joystick: %s: %s. Waiting for it; the parameter ~dev names another file.",
                                  self._device, error.strerror)
                    self._told = True
                time.sleep(_RETRY)
                continue
            rospy.loginfo("joystick %s is open", self._device)
            try:
                self._read(file)
            except OSError as error:
                rospy.logwarn("joystick %s: %s; waiting for it", self._device, error.strerror)
            finally:
                os.close(file)
            self._told = True
            self._stick.release()
            self._publish()         # what drives by the last message has to stop
            if not rospy.is_shutdown():
                time.sleep(_RETRY)

    def _read(self, file: int) -> None:
        """Publish what is read from an open device, until it ends or ROS does."""
        due = time.monotonic()
        changed = False
        while not rospy.is_shutdown():
            wait = _LOOK if self._period is None else max(0.0, min(_LOOK, due + self._period - time.monotonic()))
            ready = select.select([file], [], [], self._coalesce if changed else wait)[0]
            if ready:
                data = os.read(file, EVENT_BYTES * _MOST_EVENTS)
                if not data:
                    rospy.logwarn("joystick %s has ended; waiting for it", self._device)
                    return
                buttons = list(self._stick.buttons)
                changed |= self._stick.update(data)
                if buttons == self._stick.buttons and time.monotonic() - due < self._coalesce:
                    continue                # more of the same movement may follow
            elif not changed and (self._period is None or time.monotonic() - due < self._period):
                continue
            if changed or not ready:
                self._publish()
                changed, due = False, time.monotonic()

    def _publish(self) -> None:
        message = Joy(axes=list(self._stick.axes), buttons=list(self._stick.buttons))
        message.header.stamp, message.header.frame_id = rospy.Time.now(), self._device
        self._port.publish(message)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("joy_node")
    device = str(rospy.get_param("~dev", "/dev/input/js0"))
    JoyNode(device, Stick(number("deadzone", 0.05, 0.0, 0.9)), number("autorepeat_rate", 0.0, 0.0, 1000.0),
            number("coalesce_interval", 0.001, 0.0, 1.0)).run()
    return 0
