# SPDX-License-Identifier: BSD-3-Clause
"""PID controller with the clamping and anti-windup of ros_control's control_toolbox."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Mapping, Optional

from m2wr_sim.errors import PluginError


@dataclass(frozen=True)
class Gains:
    """Gains of a PID controller.

    ``i_min`` and ``i_max`` bound the integral term; both are 0 by default, so that ``i`` alone has no effect.  With
    ``antiwindup`` the integral of the error itself is bounded.
    """

    p: float = 0.0
    i: float = 0.0
    d: float = 0.0
    i_min: float = 0.0
    i_max: float = 0.0
    antiwindup: bool = False


def read_gains(values: Any, where: str) -> Gains:
    """Return the gains that a parameter holds.

    Parameters
    ----------
    values : object
        Value of the parameter: a mapping with ``p``, ``i``, ``d``, ``i_clamp``, ``i_clamp_min``, ``i_clamp_max`` and
        ``antiwindup``; all but ``p`` may be missing.
    where : str
        Name of the parameter, for messages.

    Raises
    ------
    PluginError
        If ``p`` is missing, a value is no finite number, or the limits of the integral term are exchanged.
    """
    if not isinstance(values, Mapping) or "p" not in values:
        raise PluginError("%s: read %r; expected gains with at least p" % (where, values))

    def number(name: str, default: float = 0.0) -> float:
        value = values.get(name, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise PluginError("%s/%s: read %r; expected a finite number" % (where, name, value))
        return float(value)

    clamp = abs(number("i_clamp"))
    low, high = number("i_clamp_min", -clamp), number("i_clamp_max", clamp)
    if low > 0.0 or high < 0.0:
        raise PluginError("%s: read i_clamp_min %g and i_clamp_max %g; expected a minimum of at most 0 and a maximum "
                          "of at least 0" % (where, low, high))
    return Gains(number("p"), number("i"), number("d"), low, high, bool(values.get("antiwindup", False)))


class Pid:
    """A PID controller; its derivative is of the error.

    Parameters
    ----------
    gains : Gains
    """

    def __init__(self, gains: Gains) -> None:
        self.gains = gains
        self.reset()

    def reset(self) -> None:
        """Discard the integral and the last error."""
        self.integral = 0.0
        self._last: Optional[float] = None

    def update(self, error: float, dt: float, error_rate: Optional[float] = None) -> float:
        """Return the command.

        Parameters
        ----------
        error : float
            Desired minus measured value.
        dt : float
            Time since the last call [s].
        error_rate : float, optional
            Derivative of the error [1/s]; None: from the last error, 0 at the first call.

        Returns
        -------
        float
            0 if ``dt`` is not positive or the error not finite.
        """
        if not dt > 0.0 or not math.isfinite(error):
            return 0.0
        gains = self.gains
        if error_rate is None:
            error_rate = 0.0 if self._last is None else (error - self._last) / dt
        self._last = error
        self.integral += dt * error
        if gains.antiwindup and gains.i != 0.0:
            bounds = sorted((gains.i_min / gains.i, gains.i_max / gains.i))
            self.integral = min(bounds[1], max(bounds[0], self.integral))
        term = gains.i * self.integral
        if not gains.antiwindup:
            term = min(gains.i_max, max(gains.i_min, term))
        command = gains.p * error + term + gains.d * error_rate
        return command if math.isfinite(command) else 0.0
