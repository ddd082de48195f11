# SPDX-License-Identifier: BSD-3-Clause
"""CPU time of the sensor model of amcl."""
from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.benchmark import grids
from m2wr_navigation.localization.amcl_parameters import PARAMETERS
from m2wr_navigation.localization.beams import Beams, ScanGeometry
from m2wr_navigation.localization.localization_map import LocalizationMap
from m2wr_navigation.localization.sensor_models import weigh

if TYPE_CHECKING:
    from typing import Dict, Tuple

SIDE = 400                  # cells of the map
REACH = 8.0                 # m
REPEATED = 10               # times, of which the best counts
#: CPU time of the C++ likelihood field for particles and beams [ms].
ORIGINAL_MS: Dict[Tuple[int, int], float] = {(500, 60): 4.0, (3000, 60): 14.0, (3000, 180): 51.0, (2000, 720): 216.0}


def field_time(particles: int, beams: int, seed: int) -> float:
    """Return the CPU time of weighing particles by a scan with the likelihood field, best of several [ms].

    Parameters
    ----------
    particles, beams : int
    seed : int
        Of the map, the scan and the poses.

    Raises
    ------
    RuntimeError
        If no particle can be weighed by the scan.
    """
    random = np.random.default_rng(seed)
    cells = np.where(grids.blocks(SIDE, random) > 0, 100, 0).astype(np.int8)
    middle = 0.5 * SIDE * grids.RESOLUTION
    grid = LocalizationMap.from_message(cells.ravel(), SIDE, SIDE, grids.RESOLUTION, (0.0, 0.0, 0.0))
    scan = Beams.from_scan(random.uniform(0.5, 0.9 * REACH, beams).tolist(),
                           ScanGeometry(-math.pi, 2.0 * math.pi / beams, 0.05, REACH),
                           ((0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0)))
    values = {name: parameter.default for name, parameter in PARAMETERS.items()}
    values["laser_max_beams"] = beams
    poses = random.normal([middle, middle, 0.0], [0.5, 0.5, 0.3], (particles, 3))
    weigh(poses, scan, grid, values, True)          # makes the field of distances
    times = []
    for _ in range(REPEATED):
        begun = time.process_time()
        fit = weigh(poses, scan, grid, values, True)
        times.append(1e3 * (time.process_time() - begun))
    if fit is None or len(fit.log_weights) != particles:
        raise RuntimeError("the scan of the benchmark weighs nothing")
    return min(times)
