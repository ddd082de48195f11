# SPDX-License-Identifier: BSD-3-Clause
"""Velocity commands within limits of speed and acceleration, without ROS."""
from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import Any, Deque, Mapping, NamedTuple, Optional, Tuple

from m2wr_node.numbers import number

NONE, ODOMETRY, COMMANDS = 0, 1, 2      # where the robot's velocity is read
PERIODS = 5                             # commands whose median period is the input's period
FIRST_PERIOD = 0.1                      # s: period that is assumed before there are so many
LATE, LATEST = 3.0, 0.5                 # periods, s: without a command for so long, the input has stopped
MISSING = 5.0                           # periods without a command after which the robot's velocity is trusted more
DEVIATION = 2.0                         # cycles: so much may the robot's velocity differ from the command
BOUNDS = {"speed_lim_v": (0.0, 10.0), "speed_lim_w": (0.0, 10.0), "accel_lim_v": (0.0, 10.0),
          "accel_lim_w": (0.0, 10.0), "decel_factor": (0.0, 10.0), "frequency": (0.1, 1000.0)}


class ConfigurationError(ValueError):
    """Parameters that cannot be used; the message names them and what was expected."""


class Settings(NamedTuple):
    """Limits [m/s, rad/s, m/s^2, rad/s^2], cycles per second, and where the robot's velocity is read."""

    speed_lim_v: float
    speed_lim_w: float
    accel_lim_v: float
    accel_lim_w: float
    decel_factor: float = 1.0
    frequency: float = 20.0
    robot_feedback: int = NONE


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Return the settings in a node's private parameters.

    Parameters
    ----------
    given : mapping
        Name to value, as the parameter server holds them.

    Raises
    ------
    ConfigurationError
        If a limit is missing, is no number or is out of range.
    """
    values = {}
    for name, (least, most) in BOUNDS.items():
        if name not in given:
            if name in Settings._field_defaults:
                continue
            raise ConfigurationError("%s is missing; expected a number from %g to %g" % (name, least, most))
        value = number(given[name])
        if value is None or not least <= value <= most:
            raise ConfigurationError("%s is %.60r; expected a number from %g to %g" % (name, given[name], least, most))
        values[name] = float(value)
    feedback = given.get("robot_feedback", NONE)
    if feedback not in (NONE, ODOMETRY, COMMANDS) or isinstance(feedback, bool):
        raise ConfigurationError("robot_feedback is %.60r; expected 0 (none), 1 (odometry) or 2 (commands)" % (
            feedback,))
    return Settings(robot_feedback=int(feedback), **values)


class Smoother:
    """Approaches the last command as fast as the limits allow, both velocities in the same ratio.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._target = self._sent = self._robot = (0.0, 0.0)
        self._active, self._last = False, -math.inf
        self._periods: Deque[float] = deque(maxlen=PERIODS)
        self.zeroed: Optional[Tuple[float, float]] = None

    def command(self, linear: float, angular: float, now: float) -> None:
        """Note a command.

        Parameters
        ----------
        linear, angular : float
            [m/s, rad/s]
        now : float
            Time [s]. If it is before that of the command before, the periods start again from the first.
        """
        periods = self._periods
        if now < self._last:
            periods.clear()
        elif self._last > -math.inf:
            periods.append(now - self._last)
        self._last, self._active = now, True
        most = self._settings.speed_lim_v, self._settings.speed_lim_w
        self._target = tuple(max(-limit, min(limit, value))         # type: ignore[assignment]
                             for value, limit in zip((linear, angular), most))

    def feedback(self, linear: float, angular: float) -> None:
        """Note the velocity of the robot, from where ``robot_feedback`` says.

        Parameters
        ----------
        linear, angular : float
            [m/s, rad/s]
        """
        self._robot = linear, angular

    def _period(self) -> float:
        return median(self._periods) if len(self._periods) > PERIODS // 2 else FIRST_PERIOD

    def step(self, now: float) -> Optional[Tuple[float, float]]:
        """Return the velocities to command in this cycle [m/s, rad/s]; None while there is nothing to command.

        If the commands have stopped the target becomes zero, and :attr:`zeroed` is the target until then.

        Parameters
        ----------
        now : float
            Time [s].
        """
        period, age, self.zeroed = self._period(), now - self._last, None
        if self._active and period > 0.0 and not 0.0 <= age <= min(LATE * period, LATEST):
            self._active = False
            if self._target != (0.0, 0.0):
                self.zeroed, self._target = self._target, (0.0, 0.0)
        if self._settings.robot_feedback != NONE and self._active and period > 0.0 and (
                age > MISSING * period or self._differs()):
            self._sent = self._robot
        if self._target == self._sent:
            return self._sent if self._active else None
        self._sent = self._nearer()
        return self._sent

    def _limits(self) -> Tuple[Tuple[float, float], Tuple[float, float]]:
        """Return by how much the speeds may rise and fall in a cycle [m/s, rad/s]."""
        settings = self._settings
        rise = settings.accel_lim_v / settings.frequency, settings.accel_lim_w / settings.frequency
        return rise, (rise[0] * settings.decel_factor, rise[1] * settings.decel_factor)

    def _differs(self) -> bool:
        """Return whether the robot's velocity is not that of the last command, within some cycles of acceleration."""
        rise, fall = self._limits()
        return any(not sent - DEVIATION * down <= robot <= sent + DEVIATION * up
                   for sent, robot, up, down in zip(self._sent, self._robot, rise, fall))

    def _nearer(self) -> Tuple[float, float]:
        """Return the velocities nearest to the target within the limits; the straight way to it in (v, w) is kept."""
        rise, fall = self._limits()
        reverses = self._settings.robot_feedback == ODOMETRY
        share, ways = 1.0, []
        for target, sent, robot, up, down in zip(self._target, self._sent, self._robot, rise, fall):
            way = target - sent
            faster = way * target > 0.0 and not (reverses and robot * target < 0.0)
            ways.append(way)
            if way:
                share = min(share, (up if faster else down) / abs(way))
        if share >= 1.0:
            return self._target
        return self._sent[0] + share * ways[0], self._sent[1] + share * ways[1]
