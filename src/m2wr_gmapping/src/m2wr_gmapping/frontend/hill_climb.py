# SPDX-License-Identifier: BSD-3-Clause
"""Matching scans with particles' maps: the plain original method, for comparison."""
import numpy as np

from m2wr_gmapping.frontend import hill_climb_kernels as hk
from m2wr_gmapping.frontend import match_kernels as mk


class HillClimbMatcher:
    """Score every pose by the nearest mean hit point around each beam's end, and climb with halving steps."""

    def __init__(self, config, workers):
        self._workers = workers
        self._settings = np.array([config[name] for name in (
            "lstep", "astep", "iterations", "sigma", "lsigma", "kernelSize", "minimumScore")], float)

    def match(self, maps, reading, starts, predictions, prior, minimum_score):
        """Match one scan in the map of every particle; arguments as for ``FastMatcher.match``, ``prior`` unused."""
        results = np.zeros((len(starts), mk.RESULT_SIZE))

        def work(first, last):
            hk.climb_poses(starts, first, last, reading.beams, maps.table, maps.mean, maps.hits, maps.frame,
                           self._settings, results)

        self._workers.run(work, len(starts))
        return results
