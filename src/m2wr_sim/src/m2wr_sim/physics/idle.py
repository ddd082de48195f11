# SPDX-License-Identifier: BSD-3-Clause
"""Sleeping bodies: libode's rule of auto-disabling, implemented in the engine.

libode counts idle steps in every solution, but a step may be solved several times, and its counters cannot be read.
"""
from __future__ import annotations

from typing import Any, Iterable, Sequence

# Gazebo's defaults: a body below both speeds for this number of steps and this time sleeps, once its island does.
LINEAR, ANGULAR = 0.1, 0.1      # m/s, rad/s
STEPS, TIME = 5, 1.0            # steps, s


class Countdown:
    """Steps and time for which a body still has to be idle before it sleeps."""

    __slots__ = ("steps", "time")

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Start again, for instance when the body is woken."""
        self.steps, self.time = STEPS, TIME


def is_slow(linear: Sequence[float], angular: Sequence[float]) -> bool:
    """Return whether a body is idle.

    Parameters
    ----------
    linear : (3,) sequence of float
        Velocity [m/s].
    angular : (3,) sequence of float
        Angular velocity [rad/s].

    Returns
    -------
    bool
    """
    return (linear[0] * linear[0] + linear[1] * linear[1] + linear[2] * linear[2] <= LINEAR * LINEAR
            and angular[0] * angular[0] + angular[1] * angular[1] + angular[2] * angular[2] <= ANGULAR * ANGULAR)


def count_down(links: Iterable[Any], dt: float) -> None:
    """Count a step for the links that may sleep, and disable those that have been idle long enough.

    To be called after the contacts of the step are made and before it is solved.  A body without joints and contacts
    does not count.  While solving, libode wakes bodies in contact with one that is awake; their countdowns continue.

    Parameters
    ----------
    links : list of LinkBody
    dt : float
        Step size [s].
    """
    for link in links:
        body, countdown = link.body, link.countdown
        if not body.isEnabled() or body.getNumJoints() == 0:
            continue
        if not is_slow(body.getLinearVel(), body.getAngularVel()):
            countdown.restart()
            continue
        countdown.steps -= 1
        countdown.time -= dt
        if countdown.steps <= 0 and countdown.time <= 0.0:
            body.disable()
            body.setLinearVel((0.0, 0.0, 0.0))
            body.setAngularVel((0.0, 0.0, 0.0))
