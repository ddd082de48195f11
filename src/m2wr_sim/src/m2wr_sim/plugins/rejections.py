# SPDX-License-Identifier: BSD-3-Clause
"""Warnings about messages that a plugin rejects, limited in rate."""
from __future__ import annotations

from typing import TYPE_CHECKING, Optional

if TYPE_CHECKING:
    from m2wr_sim.plugins.base import PluginContext

_PERIOD_NS = 5000000000         # of simulated time, between two warnings


class Rejections:
    """Logs that a message was rejected, at most once in 5 s of simulated time.

    Parameters
    ----------
    ctx : PluginContext
    """

    def __init__(self, ctx: PluginContext) -> None:
        self._log = ctx.log
        self._warned_ns: Optional[int] = None

    def warn(self, now_ns: int, text: str, *values: object) -> None:
        """Log a warning, unless the last one is less than a period ago.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        text : str
            Format of the message: what was rejected, what was expected, what applies instead.
        *values : object
            Values for the format.
        """
        if self._warned_ns is None or now_ns - self._warned_ns >= _PERIOD_NS:
            self._warned_ns = now_ns
            self._log.warning(text, *values)

    def reset(self) -> None:
        """Log the next rejection at once."""
        self._warned_ns = None
