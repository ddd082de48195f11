# SPDX-License-Identifier: BSD-3-Clause
"""Compiles the kernels of localization, or loads them from their cache."""
from __future__ import annotations

import math

import numpy as np

from m2wr_navigation.localization.amcl_parameters import LASER_MODELS, ODOMETRY_MODELS, PARAMETERS
from m2wr_navigation.localization.beams import Beams, ScanGeometry
from m2wr_navigation.localization.localization_map import LocalizationMap
from m2wr_navigation.localization.localizer import Localizer


def compile_localization_kernels() -> None:
    """Localize in a small room with every model."""
    cells = np.full((40, 40), 0, np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    grid = LocalizationMap.from_message(cells.ravel(), 40, 40, 0.1, (-2.0, -2.0, 0.0))
    angles = np.linspace(-math.pi, math.pi, 16, endpoint=False)
    with np.errstate(divide="ignore"):
        walls = np.minimum(np.abs(1.9 / np.cos(angles)), np.abs(1.9 / np.sin(angles)))
    mount = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    beams = Beams.from_scan(walls, ScanGeometry(-math.pi, math.pi / 8.0, 0.1, 5.0), mount)
    for laser in LASER_MODELS:
        for odometry in ODOMETRY_MODELS[:2]:
            values = {name: parameter.default for name, parameter in PARAMETERS.items()}
            values.update(laser_model_type=laser, odom_model_type=odometry, max_particles=20, min_particles=10,
                          resample_interval=1, do_beamskip=True)
            localizer = Localizer(grid, values, np.random.default_rng(0))
            localizer.start_at(np.zeros(3), np.diag([0.01, 0.01, 0.01]))
            for step in range(2):
                localizer.process("laser", beams, np.array([0.3 * step, 0.0, 0.0]))
            localizer.start_anywhere()
            localizer.process("laser", beams, np.zeros(3))
