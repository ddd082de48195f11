# SPDX-License-Identifier: BSD-3-Clause
"""Scan matcher of the original gmapping, for comparison."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping.frontend import hill_climb_kernels as hk
from m2wr_gmapping.frontend import match_kernels as mk

if TYPE_CHECKING:
    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.filter.tile_maps import TileMaps
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray
    from m2wr_node.thread_team import ThreadTeam


class HillClimbMatcher:
    """Hill climb with halving steps on the score of gmapping."""

    def __init__(self, config: GmappingConfig, workers: ThreadTeam) -> None:
        self._workers = workers
        self._settings = np.array([config[name] for name in (
            "lstep", "astep", "iterations", "sigma", "lsigma", "kernelSize", "minimumScore")], float)

    def match(self, maps: TileMaps, reading: ScanReading, starts: FloatArray, predictions: FloatArray,
              prior: FloatArray, minimum_score: float) -> FloatArray:
        """Match one scan in the map of every particle.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        reading : ScanReading
            The scan.
        starts : (N, 3) float64
            Start poses in ``map``.
        predictions : (N, 3) float64
            Not used.
        prior : (3,) float64
            Not used.
        minimum_score : float
            Not used; the parameter ``minimumScore`` is.

        Returns
        -------
        (N, 13) float64
            Result rows of ``match_kernels``.
        """
        results = np.zeros((len(starts), mk.RESULT_SIZE))

        def work(first: int, last: int) -> None:
            hk.climb_poses(starts, first, last, reading.beams, maps.table, *maps.layout, self._settings, results)

        self._workers.run(work, len(starts))
        return results
