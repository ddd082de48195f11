# SPDX-License-Identifier: BSD-3-Clause
"""Two sets of logs by seed: one for development, one for examination only.

Every log is drawn from the same distributions, its difficulties by turns.  The random sequences of the two sets have
nothing in common, so that what was tuned on the one is judged on data that was never seen.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Dict, Optional, Tuple

import numpy as np

from m2wr_tools.buildings.generators import generate
from m2wr_tools.slam_logs.difficulties import draw
from m2wr_tools.slam_logs.drive import Upset, drive
from m2wr_tools.slam_logs.odometry import OdometryErrors, integrate
from m2wr_tools.slam_logs.sensing import LaserErrors, scans

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray
    from m2wr_tools.buildings.floor_plan import FloorPlan
    from m2wr_tools.slam_logs.drive import Drive

SETS = {"development": 1, "exam": 2}        # first words of the random seed
#: Length of a tour, as the crow flies [m], and records for each scan: 5 Hz, less in longer tours.
TOURS = {"house": ((30.0, 80.0), 2), "hall": ((80.0, 200.0), 3), "office": ((80.0, 220.0), 3),
         "corridors": ((80.0, 220.0), 3), "aisles": ((120.0, 250.0), 3), "loops": ((250.0, 400.0), 4),
         "large": ((400.0, 560.0), 5)}
#: Of lasers: from small indoor ones to SICK's LMS [m].
RANGES = {"6 to 8 m": (6.0, 8.0), "8 to 30 m": (8.0, 30.0), "30 to 80 m": (30.0, 80.0)}
#: Field of view [rad] and beams of common lasers.
FIELDS = ((math.radians(180.0), 181), (math.radians(180.0), 361), (math.radians(240.0), 683),
          (math.radians(270.0), 541), (math.radians(360.0), 360))
RANGE_NOISE = (0.003, 0.03)         # standard deviation; assumed, up to the accuracy in the UTM-30LX data sheet [m]
MOUNT_OFFSET = (0.01, 0.05)         # least and greatest error of a wrong mount, along each axis [m]
MOUNT_YAW = (math.radians(0.3), math.radians(2.0))      # [rad]
PEOPLE = (2, 8)             # least and greatest number of people
GLASS = (0.05, 0.25)        # share of the walls that are of glass
#: Angles of turns that odometry does not notice [rad], and their rate [rad/s].
TURNS = {"misses 20 to 80 deg": (math.radians(20.0), math.radians(80.0)),
         "misses 80 to 180 deg": (math.radians(80.0), math.radians(180.0)),
         "carried": (math.radians(160.0), math.radians(200.0))}
UPSET_RATE = (1.0, 3.0)
SPARSE = 10                 # records for each scan: 1 Hz
DROPPED = (0.25, 0.35)      # share of the scans
SWAPPED, LATE = 0.05, 0.1   # share of the scans


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
    """All that defines a log, besides the random numbers.

    Attributes
    ----------
    name, kind : str
        Of the log; of its building.
    difficulties : dict
        Aspect -> class, see :mod:`m2wr_tools.slam_logs.difficulties`.
    length : float
        Of the tour, as the crow flies [m].
    every : int
        A scan is taken at each so many records.
    glass : float
        Probability that a wall is of glass.
    laser : LaserErrors
    odometry : OdometryErrors
    upset : Upset or None
        A turn that odometry does not notice.
    faults : Faults
    """

    name: str
    kind: str
    difficulties: Dict[str, str]
    length: float
    every: int
    glass: float
    laser: LaserErrors
    odometry: OdometryErrors
    upset: Optional[Upset]
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


def _log_uniform(limits: Tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a value whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(limits[0]), np.log(limits[1]))))


def _signed(limits: Tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a value of either sign, with a magnitude between two limits."""
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(*limits))


def _laser(classes: Dict[str, str], rng: np.random.Generator) -> LaserErrors:
    field, beams = FIELDS[int(rng.integers(len(FIELDS)))]
    mount = [_signed(limits, rng) for limits in (MOUNT_OFFSET, MOUNT_OFFSET, MOUNT_YAW)]
    if "offset" not in classes["mount"]:
        mount[:2] = [0.0, 0.0]
    if "yaw" not in classes["mount"]:
        mount[2] = 0.0
    people = int(rng.integers(PEOPLE[0], PEOPLE[1] + 1)) if "people" in classes["surroundings"] else 0
    return LaserErrors(_log_uniform(RANGES[classes["range"]], rng), field, beams, _log_uniform(RANGE_NOISE, rng),
                       (mount[0], mount[1], mount[2]), people)


def _odometry(kind: str, rng: np.random.Generator) -> OdometryErrors:
    """Draw the errors of the wheels: those of a calibrated robot, and larger ones of one kind.

    Radii and separation of an uncalibrated robot were measured with a ruler.  All magnitudes are assumed.
    """
    plain = OdometryErrors((rng.normal(0.0, 0.001), rng.normal(0.0, 0.001)), rng.normal(0.0, 0.003), 0.001, 2000)
    if kind == "uncalibrated":
        return OdometryErrors((rng.normal(0.0, 0.01), rng.normal(0.0, 0.01)), rng.normal(0.0, 0.03),
                              _log_uniform((0.002, 0.02), rng), 360)
    if kind == "wrong scale":
        both = _signed((0.03, 0.15), rng)
        return replace(plain, radius=(both, both), separation=_signed((0.05, 0.2), rng))
    if kind == "unequal wheels":
        return replace(plain, radius=(_signed((0.01, 0.04), rng), 0.0))
    if kind == "coarse encoder":
        return replace(plain, ticks=int(rng.integers(16, 61)))
    if kind == "noisy":
        return replace(plain, noise=_log_uniform((0.01, 0.04), rng))
    if kind == "slipping wheel":
        return replace(plain, bursts=_log_uniform((0.02, 0.2), rng))
    if kind == "wrong centre":
        return replace(plain, centre=(_signed((0.03, 0.1), rng), _signed((0.0, 0.05), rng)))
    return plain


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
    classes = draw(SETS[name], number)
    kind = classes["building"]
    length, every = TOURS[kind]
    laser, odometry = _laser(classes, rng), _odometry(classes["odometry"], rng)
    glass = rng.uniform(*GLASS) if "glass" in classes["surroundings"] else 0.0
    upset = None
    if classes["turn"] in TURNS:
        upset = Upset(_signed(TURNS[classes["turn"]], rng), rng.uniform(*UPSET_RATE), classes["turn"] == "carried")
    if classes["scans"] == "sparse":
        every = SPARSE
    late = classes["scans"] == "swapped and late"
    faults = Faults(rng.uniform(*DROPPED) if classes["scans"] == "30 % dropped" else 0.0, SWAPPED if late else 0.0,
                    LATE if late else 0.0)
    return Recipe("%s_%03d_%s" % (name, number, kind), kind, classes, rng.uniform(*length), every, glass, laser,
                  odometry, upset, faults)


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
    done = drive(plan, wanted.length, way, wanted.upset)
    taken, ranges = scans(plan, done, wanted.every, wanted.laser, sensor)
    return MadeLog(wanted, plan, done, integrate(done, wanted.odometry, wheels), taken, ranges)
