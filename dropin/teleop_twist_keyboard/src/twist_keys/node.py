# SPDX-License-Identifier: BSD-3-Clause
"""The node: parameters, the loop between keyboard and topic, and stopping the robot at the end."""
from __future__ import annotations

import math
import os
import signal
import stat
import sys
import time
from typing import Any, Dict, List, Optional

import rospy
from geometry_msgs.msg import Twist, TwistStamped

from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from twist_keys.keys import HELP, QUIT, KeyDriver
from twist_keys.terminal import Keys

_TURN = 0.1             # s; the longest delay until a signal or a shutdown is noticed
_DELIVERY = 0.1         # s for the last command to leave this process
_REMIND_EVERY = 2.0     # s between two lines about a missing subscriber

_DEFAULTS = {'speed': 0.5, 'turn': 1.0, 'speed_limit': 1000.0, 'turn_limit': 1000.0, 'repeat_rate': 0.0,
             'key_timeout': 0.0}


_NO_KEYBOARD = (
    'teleop_twist_keyboard: there is no keyboard: standard input is neither a terminal nor a pipe with keys. Start it '
    'in a terminal with rosrun teleop_twist_keyboard teleop_twist_keyboard.py, or in a launch file with '
    'launch-prefix="xterm -e".\n')


class ParameterError(Exception):
    """A parameter has a value that cannot be used."""


def read_numbers() -> Dict[str, float]:
    """Return the numeric parameters as a dictionary.

    Raises
    ------
    ParameterError
        If one is not a finite number of at least 0.
    """
    found = {}
    for name, default in _DEFAULTS.items():
        value = rospy.get_param('~' + name, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < math.inf:
            raise ParameterError('parameter ~%s is %r; expected a number of at least 0' % (name, value))
        found[name] = float(value)
    return found


class Teleop:
    """Converts keys to velocity commands on ``cmd_vel``.

    Parameters
    ----------
    keys : twist_keys.terminal.Keys
    driver : twist_keys.keys.KeyDriver
    repeat_rate : float
        Rate at which the last command is repeated [Hz]; 0: one command for each key.
    key_timeout : float
        The robot is stopped this time after the last key [s]; 0: never.
    frame : str or None
        ``frame_id`` of TwistStamped; None: plain Twist.
    """

    def __init__(self, keys: Keys, driver: KeyDriver, repeat_rate: float = 0.0, key_timeout: float = 0.0,
                 frame: Optional[str] = None) -> None:
        self._keys, self._driver, self._frame = keys, driver, frame
        self._period = 1.0 / repeat_rate if repeat_rate else math.inf
        self._key_timeout = key_timeout or math.inf
        self._publisher = rospy.Publisher('cmd_vel', Twist if frame is None else TwistStamped, queue_size=1)
        self._signals: List[int] = []
        self._stopped = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda received, _: self._signals.append(received))
        at_shutdown(self.stop)              # for rosnode kill

    def _ending(self) -> bool:
        return bool(self._signals) or rospy.is_shutdown()

    def _publish(self, linear_x: float, linear_y: float, linear_z: float, angular_z: float) -> None:
        message = self._publisher.data_class()
        twist = message
        if self._frame is not None:
            message.header.stamp, message.header.frame_id = rospy.Time.now(), self._frame
            twist = message.twist
        twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z = linear_x, linear_y, linear_z, angular_z
        self._publisher.publish(message)

    def stop(self) -> None:
        """Send one command of zeros, once."""
        if not self._stopped:
            self._stopped = True
            self._publish(0.0, 0.0, 0.0, 0.0)
            time.sleep(_DELIVERY)

    def wait_for_robot(self) -> None:
        """Wait for a subscriber, with a message from time to time."""
        told = time.monotonic()
        while self._publisher.get_num_connections() == 0 and not self._ending():
            if time.monotonic() - told >= _REMIND_EVERY:
                told = time.monotonic()
                print('Waiting for a subscriber of %s' % self._publisher.resolved_name, flush=True)
            time.sleep(_TURN)

    def run(self) -> int:
        """Run until Ctrl-C, the end of the input or a shutdown; returns the number of keys."""
        count = 0
        now = time.monotonic()
        last_key, next_repeat = now, now + self._period
        while not self._ending():
            keys = self._keys.read(max(0.0, min(_TURN, next_repeat - time.monotonic())))
            now = time.monotonic()
            for key in keys:
                if key == QUIT:
                    return count
                count, last_key = count + 1, now
                said = self._driver.press(key)
                if said:
                    print(said, flush=True)
            if keys or (now - last_key > self._key_timeout and self._driver.release()) or now >= next_repeat:
                self._publish(*self._driver.command())
                next_repeat = now + self._period
            if self._keys.ended:
                break
        return count


def has_keyboard(stream: Any) -> bool:
    """Return whether a stream is a terminal or another source of keys; not /dev/null, not a closed stream."""
    try:
        descriptor = stream.fileno()
        return os.isatty(descriptor) or not stat.S_ISCHR(os.fstat(descriptor).st_mode)
    except (AttributeError, ValueError, OSError):
        return False


def main() -> int:
    """Entry point; returns the exit code."""
    if not has_keyboard(sys.stdin):
        sys.stderr.write(_NO_KEYBOARD)
        return 1
    start_node('teleop_twist_keyboard')
    try:
        numbers = read_numbers()
    except ParameterError as error:
        rospy.logfatal('%s', error)
        return 1
    driver = KeyDriver(*(numbers[name] for name in ('speed', 'turn', 'speed_limit', 'turn_limit')))
    frame = str(rospy.get_param('~frame_id', '')) if rospy.get_param('~stamped', False) else None
    with Keys(sys.stdin.fileno()) as keys:
        teleop = Teleop(keys, driver, numbers['repeat_rate'], numbers['key_timeout'], frame)
        try:
            teleop.wait_for_robot()
            if keys.is_terminal:
                print(HELP)
            print(driver.speeds(), flush=True)
            count = teleop.run()
        finally:
            teleop.stop()
    rospy.signal_shutdown('done')
    if keys.ended and not keys.is_terminal and not count:
        sys.stderr.write(_NO_KEYBOARD)
        return 1
    return 0
