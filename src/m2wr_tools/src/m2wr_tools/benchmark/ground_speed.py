# SPDX-License-Identifier: BSD-3-Clause
"""Processor time of a physics step on uneven ground: the same drive on a plane and on heightmaps, without scans."""
from __future__ import annotations

import os
import statistics
import tempfile
import time
from typing import List, Optional, Tuple

import numpy as np
from PIL import Image

from m2wr_sim.api import Sim

SAMPLES = 1025                  # a side of the map
CELLS = (0.05, 0.02, 0.01, 0.005)       # m
_WAVES = (0.02, 1.0, 1.3)       # m: amplitude, wave lengths along x and y
_NOISE = 0.002                  # m: standard deviation of each sample
_SPEED, _TURN = 0.3, 0.3        # m/s, rad/s: a circle of 2 m, which fits on the smallest map
_SETTLING = 1.0                 # s
_PARTS = 5                      # parts of a drive, of which the median counts
_WORLD = """<sdf version="1.6"><world name="ground"><physics type="ode"><max_step_size>0.001</max_step_size></physics>
<model name="ground"><static>true</static><link name="link"><collision name="shape"><geometry>%s</geometry></collision>
</link></model></world></sdf>"""
_MAP = "<heightmap><uri>%s</uri><size>%r %r %r</size><sampling>1</sampling></heightmap>"
_PLANE = "<plane><normal>0 0 1</normal><size>100 100</size></plane>"


def write_ground(folder: str, cell: float, rough: bool) -> Tuple[str, float]:
    """Write a heightmap as a world.

    Parameters
    ----------
    folder : str
        For the world and its picture.
    cell : float
        Distance of two samples [m].
    rough : bool
        Waves with noise; False: level.

    Returns
    -------
    (str, float)
        Path of the world, and its greatest height [m].
    """
    place, heights = np.arange(SAMPLES) * cell, np.zeros((SAMPLES, SAMPLES))
    if rough:
        high, along, across = _WAVES
        heights = high * np.sin(2.0 * np.pi / along * place) * np.cos(2.0 * np.pi / across * place)[:, None]
        heights += np.random.RandomState(1).normal(0.0, _NOISE, heights.shape)
    heights -= heights.min()
    top = max(float(heights.max()), 1e-3)
    picture, world = os.path.join(folder, "heights.png"), os.path.join(folder, "ground.world")
    Image.fromarray((heights / top * 65535.0).astype(np.uint16)).save(picture)
    side = cell * (SAMPLES - 1)
    with open(world, "w") as stream:
        stream.write(_WORLD % (_MAP % (picture, side, side, top)))
    return world, top


def step_time(world: str, height: float, steps: int) -> float:
    """Return the median processor time of a step of m2wr, which drives a circle [us].

    Parameters
    ----------
    world : str
        Path of the world.
    height : float
        Where the robot is dropped [m].
    steps : int
        Of 1 ms, that are measured.
    """
    with Sim(world, "m2wr", pose=(0.0, 0.0, height + 0.1, 0.0), sensing="off") as sim:
        sim.drive().command(_SPEED, _TURN)
        sim.step(duration=_SETTLING)
        times = []
        for _ in range(_PARTS):
            begun = time.thread_time()
            sim.step(duration=steps // _PARTS * sim.step_size)
            times.append((time.thread_time() - begun) / (steps // _PARTS))
    return 1e6 * statistics.median(times)


def report(steps: int = 20000, cells: Optional[Tuple[float, ...]] = None) -> str:
    """Return a table: the time of a step on each ground [us], and its ratio to the plane.

    Parameters
    ----------
    steps : int
        How many are measured of each.
    cells : tuple of float, optional
        Distances of two samples [m].
    """
    lines: List[str] = ["| ground | step [us] | ratio |", "|---|---|---|"]
    with tempfile.TemporaryDirectory(prefix="m2wr_ground_") as folder:
        plane = os.path.join(folder, "plane.world")
        with open(plane, "w") as stream:
            stream.write(_WORLD % _PLANE)
        level = step_time(plane, 0.0, steps)
        lines.append("| plane | %.1f | 1.0 |" % level)
        for rough in (False, True):
            for cell in cells or CELLS:
                taken = step_time(*write_ground(folder, cell, rough), steps)
                lines.append("| %s, %d x %d samples, cell %g cm | %.1f | %.1f |"
                             % ("rough" if rough else "level", SAMPLES, SAMPLES, 100.0 * cell, taken, taken / level))
    return "\n".join(lines) + "\n"
