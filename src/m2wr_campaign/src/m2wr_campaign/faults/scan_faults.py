# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the laser."""
from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Deque, Mapping, Optional, Tuple

import numpy as np

from m2wr_campaign.faults.fault import Fault
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray
    from m2wr_sim.api import Scan


class LaserStops(Fault):
    """No new scan for a time: the last one stays, as of a node that waits for the next message."""

    PARAMETERS = {"start": Parameter(10.0, "s", 0.0, 1e5, "simulated time at which it stops"),
                  "duration": Parameter(2.0, "s", 0.0, 1e5, "time without scans")}

    _last: Optional[Scan] = None

    def scan(self, time: float, scan: Optional[Scan]) -> Optional[Scan]:
        if not 0.0 <= time - self.values["start"] < self.values["duration"]:
            self._last = scan
        return self._last


class ScanLoss(Fault):
    """Each scan is lost with the same probability, as over a bad wireless network."""

    PARAMETERS = {"share": Parameter(0.3, "", 0.0, 0.99, "of the scans that are lost")}

    def __init__(self, values: Mapping[str, Any], random: np.random.Generator) -> None:
        super().__init__(values, random)
        self._newest: Optional[Scan] = None
        self._last: Optional[Scan] = None

    def scan(self, time: float, scan: Optional[Scan]) -> Optional[Scan]:
        if scan is not self._newest:
            self._newest = scan
            if self._last is None or self.random.random() >= self.values["share"]:
                self._last = scan
        return self._last


class ScanDelay(Fault):
    """Scans come late."""

    PARAMETERS = {"delay": Parameter(0.2, "s", 0.0, 10.0, "from the scan to the method")}

    def __init__(self, values: Mapping[str, Any], random: np.random.Generator) -> None:
        super().__init__(values, random)
        self._waiting: Deque[Tuple[float, Optional[Scan]]] = deque()

    def scan(self, time: float, scan: Optional[Scan]) -> Optional[Scan]:
        self._waiting.append((time + self.values["delay"], scan))
        while len(self._waiting) > 1 and self._waiting[1][0] <= time + 1e-9:
            self._waiting.popleft()
        return self._waiting[0][1]          # in the first moments the first scan: without one no method begins


class BlindBeams(Fault):
    """Some beams, always the same, see nothing: +inf, as REP 117 says."""

    PARAMETERS = {"share": Parameter(0.1, "", 0.0, 1.0, "of the beams")}

    _blind: BoolArray = np.zeros(0, bool)

    def scan(self, time: float, scan: Optional[Scan]) -> Optional[Scan]:
        if scan is None:
            return None
        if len(self._blind) != len(scan.ranges):
            self._blind = self.random.random(len(scan.ranges)) < self.values["share"]
        return replace(scan, ranges=np.where(self._blind, np.inf, scan.ranges).astype(np.asarray(scan.ranges).dtype))
