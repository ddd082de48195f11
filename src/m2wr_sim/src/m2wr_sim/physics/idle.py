# SPDX-License-Identifier: BSD-3-Clause
"""When bodies fall asleep: libode's own rule of auto-disabling, counted by the engine.

libode counts in every solve, but a step may be solved several times, and it does not tell what it has counted.
"""

# Gazebo's defaults: below both speeds for so many steps and so long, a body sleeps once all that it touches does.
LINEAR, ANGULAR = 0.1, 0.1      # m/s, rad/s
STEPS, TIME = 5, 1.0            # steps, s


class Countdown:
    """What a body that may sleep still has to be idle for."""

    __slots__ = ("steps", "time")

    def __init__(self):
        self.restart()

    def restart(self):
        """Begin anew, as when the body is woken from outside."""
        self.steps, self.time = STEPS, TIME


def is_slow(linear, angular):
    """Tell whether a body with that velocity [m/s] and angular velocity [rad/s] is idle."""
    return (linear[0] * linear[0] + linear[1] * linear[1] + linear[2] * linear[2] <= LINEAR * LINEAR
            and angular[0] * angular[0] + angular[1] * angular[1] + angular[2] * angular[2] <= ANGULAR * ANGULAR)


def count_down(links, dt):
    """Count a step of ``dt`` [s] for the links that may sleep, and put those to sleep whose time has come.

    To be called when the contacts of the step are made and before it is solved.  A body that nothing holds, in the
    air, does not count.  libode wakes in the solve what touches something that is awake; its countdown goes on.
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
