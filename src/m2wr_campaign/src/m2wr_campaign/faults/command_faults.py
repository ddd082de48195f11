# SPDX-License-Identifier: BSD-3-Clause
"""Faults between the method and the wheels."""
from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Deque, Mapping, Tuple

from m2wr_campaign.faults.fault import Fault
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    import numpy as np


class CommandDelay(Fault):
    """Commands reach the drive late; before the first one it stands."""

    PARAMETERS = {"delay": Parameter(0.2, "s", 0.0, 10.0, "from the method to the drive")}

    def __init__(self, values: Mapping[str, Any], random: np.random.Generator) -> None:
        super().__init__(values, random)
        self._waiting: Deque[Tuple[float, float, float]] = deque()
        self._now = (0.0, 0.0)

    def command(self, time: float, linear: float, angular: float) -> Tuple[float, float]:
        self._waiting.append((time + self.values["delay"], linear, angular))
        while self._waiting and self._waiting[0][0] <= time + 1e-9:
            self._now = self._waiting.popleft()[1:]
        return self._now


class PullsAside(Fault):
    """The robot drives an arc where it is told to drive straight, as with one soft tyre."""

    PARAMETERS = {"curvature": Parameter(0.2, "1/m", -5.0, 5.0, "of the arc, positive to the left")}

    def command(self, time: float, linear: float, angular: float) -> Tuple[float, float]:
        return linear, angular + self.values["curvature"] * linear
