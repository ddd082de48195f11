# SPDX-License-Identifier: BSD-3-Clause
"""Two sets of logs by seed: one for development, one for examination only.

Every log is drawn from the same distributions.  The random sequences of the two sets have nothing in common, so that
what was tuned on the one is judged on data that was never seen.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_tools.buildings.generators import KINDS, generate
from m2wr_tools.slam_logs.drive import drive
from m2wr_tools.slam_logs.odometry import OdometryErrors, integrate
from m2wr_tools.slam_logs.sensing import LaserErrors, scans

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import Float32Array, FloatArray, IndexArray
    from m2wr_tools.buildings.floor_plan import FloorPlan
    from m2wr_tools.slam_logs.drive import Drive

SETS = {"development": 1, "exam": 2}        # first words of the random seed
EVERY = 2                   # a scan at each second record: 5 Hz
LENGTH = (60.0, 220.0)      # of a tour, as the crow flies [m]
RANGES = (6.0, 80.0)        # of lasers: from small indoor ones to SICK's LMS [m]
#: Field of view [rad] and beams of common lasers.
FIELDS = ((math.radians(180.0), 181), (math.radians(180.0), 361), (math.radians(240.0), 683),
          (math.radians(270.0), 541), (math.radians(360.0), 360))
RANGE_NOISE = (0.003, 0.03)         # standard deviation; assumed, up to the accuracy in the UTM-30LX data sheet [m]
#: Standard deviations of the relative errors of the radii and of the wheels' separation: assumed, of a robot that was
#: measured with a ruler and not calibrated.
RADIUS_ERROR, SEPARATION_ERROR = 0.01, 0.03
WHEEL_NOISE = (0.002, 0.02)         # [m per square root of a metre]
TICKS = (0, 360, 2000)
MOUNT_OFFSET, MOUNT_YAW = 0.05, math.radians(2.0)       # greatest errors of the mount [m, rad]


@dataclass(frozen=True)
class Faults:
    """What happens to messages.

    Attributes
    ----------
    dropped : float
        Share of scans that are missing.
    swapped : float
        Share of scans that arrive after the following one.
    late : float
        Share of scans that arrive up to 2 s after their stamp.
    """

    dropped: float = 0.0
    swapped: float = 0.0
    late: float = 0.0


@dataclass(frozen=True)
class Recipe:
    """All that defines a log, besides the random numbers."""

    name: str
    kind: str
    length: float
    glass: float
    laser: LaserErrors
    odometry: OdometryErrors
    slip: float
    faults: Faults


@dataclass(frozen=True)
class MadeLog:
    """A log.

    Attributes
    ----------
    recipe : Recipe
    plan : FloorPlan
    drive : Drive
    odometry : (K, 3) float64
        Poses of odometry at the records of ``drive`` [m, m, rad].
    taken : (S,) int64
        Records at which scans were taken.
    ranges : (S, beams) float32
        [m]
    """

    recipe: Recipe
    plan: FloorPlan
    drive: Drive
    odometry: FloatArray
    taken: IndexArray
    ranges: Float32Array


def _between(limits: Tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a value whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(limits[0]), np.log(limits[1]))))


def _sometimes(share: float, value: float, rng: np.random.Generator) -> float:
    """Return ``value`` with probability ``share``, else 0; draws one number in any case."""
    return value if rng.random() < share else 0.0


def recipe(name: str, number: int) -> Recipe:
    """Return the recipe of one log of a set.

    Parameters
    ----------
    name : str
        A key of :data:`SETS`.
    number : int
        Of the log, from 0.

    Raises
    ------
    ValueError
        If there is no such set, or the number is negative.
    """
    if name not in SETS or number < 0:
        raise ValueError("no log %r of set %r; expected a number from 0 of %s" % (number, name, " or ".join(SETS)))
    rng = np.random.default_rng([SETS[name], number])
    kinds = sorted(KINDS)
    kind = kinds[number % len(kinds)]
    field, beams = FIELDS[int(rng.integers(len(FIELDS)))]
    mount = [_sometimes(0.5, rng.uniform(-most, most), rng) for most in (MOUNT_OFFSET, MOUNT_OFFSET, MOUNT_YAW)]
    laser = LaserErrors(_between(RANGES, rng), field, beams, _between(RANGE_NOISE, rng), (mount[0], mount[1], mount[2]),
                        int(_sometimes(0.3, float(rng.integers(1, 6)), rng)))
    odometry = OdometryErrors((rng.normal(0.0, RADIUS_ERROR), rng.normal(0.0, RADIUS_ERROR)),
                              rng.normal(0.0, SEPARATION_ERROR), _between(WHEEL_NOISE, rng),
                              int(rng.choice(TICKS)))
    slip = _sometimes(0.2, float(rng.choice([-1.0, 1.0])) * rng.uniform(0.3, math.pi), rng)
    faults = Faults(_sometimes(0.2, rng.uniform(0.05, 0.3), rng), _sometimes(0.1, 0.05, rng),
                    _sometimes(0.1, 0.1, rng))
    return Recipe("%s_%03d_%s" % (name, number, kind), kind, rng.uniform(*LENGTH), _sometimes(0.25, 0.15, rng), laser,
                  odometry, slip, faults)


def make(name: str, number: int) -> MadeLog:
    """Make one log of a set.

    Parameters
    ----------
    name, number
        As of :func:`recipe`.

    Returns
    -------
    MadeLog

    Raises
    ------
    StuckError
        If the robot gets stuck in the building.
    """
    wanted = recipe(name, number)
    # one sequence each, so that a change of one part leaves the others as they are
    building, way, wheels, sensor = (np.random.default_rng([SETS[name], number, part]) for part in range(1, 5))
    plan = generate(wanted.kind, building, wanted.glass)
    done = drive(plan, wanted.length, way)
    errors = wanted.odometry
    if wanted.slip and done.spins:
        errors = replace(errors, slips=((int(wheels.integers(len(done.spins))), wanted.slip),))
    taken, ranges = scans(plan, done, EVERY, wanted.laser, sensor)
    return MadeLog(wanted, plan, done, integrate(done, errors, wheels), taken, ranges)
