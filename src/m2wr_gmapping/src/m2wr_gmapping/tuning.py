# SPDX-License-Identifier: BSD-3-Clause
"""Tuned constants of the mapper, each with its unit, its meaning and the source of its value.

A constant is here if another value would give another map and if data or taste decide about it. What follows from
constants is a property with its formula. Indices, layouts, buffer sizes, file formats and limits of input stay where
they are used. Users' parameters are in ``config``.

Modules read ``tuning.MATCHING.narrow``, or import the group. Compiled kernels need plain numbers, so a module of
kernels assigns the values that it uses to names of its own when it is imported.
"""
from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any, Dict, Tuple

#: A value may be one number or a tuple with one unit per component.
Vector2 = Tuple[float, float]
Vector3 = Tuple[float, float, float]
Vector6 = Tuple[float, float, float, float, float, float]

#: Sources of values that only a measurement supports: `sensitivity --set report` on the development logs 1005 to 1017.
FLAT = "measured: halved and doubled, the median error of 13 logs changes by at most 1 mm, and none is lost"
#: Not tuned, but as in OpenSLAM gmapping: the share of the noise along a direction that motion across it adds, and the
#: squared distance of an end point without a partner in the likelihood of a scan (nullLikelihood) [m^2].
CROSS_NOISE, NULL_DISTANCE2 = 0.3, 0.5


def tuned(value: Any, unit: str, meaning: str, source: str) -> Any:
    """Return the field of a tuned constant.

    Parameters
    ----------
    value : float, int or tuple
    unit : str
        1 for numbers without one; of tuples all units, separated by commas.
    meaning, source : str
    """
    return field(default=value, metadata=dict(unit=unit, meaning=meaning, source=source))


@dataclass(frozen=True)
class Scans:
    """End points of a scan and the surfaces through them."""

    merge_gap: float = tuned(0.04, "m", "End points closer together than this are merged into their mean.",
                             "range noise of common lasers (Hokuyo, SICK data sheets): 1 to 3 cm")
    normal_reach: float = tuned(0.3, "m", "Farthest neighbour of an end point in the line that gives its normal.",
                                "geometry: walls are straight over 0.6 m, furniture is not")
    normal_side: int = tuned(4, "1", "Most neighbours on either side in that line.", FLAT)
    sparse: Vector2 = tuned((1.6, 1.0), "1, m", "Reach of that line at grazing incidence, in distances of the nearest "
                            "neighbour, and its limit.",
                            "geometry: the next beam but one is farther than twice that distance; the width of a door")
    straight: Vector2 = tuned((0.15, 0.4), "1, 1", "Spread across a line over the spread along it: of a noisy wall, "
                              "and of a corner, whose normal is not used.",
                              "geometry: 2 cm of range noise over 0.3 m, twice; a right angle of six points")
    slide: float = tuned(0.02, "1", "Weight of the tangential residual at a straight wall, for stability only.",
                         FLAT)


@dataclass(frozen=True)
class Matching:
    """Match of a scan with a map, and the search before it."""

    narrow: float = tuned(0.01, "m^2", "Squared width of the robust kernel in the last round, and squared step "
                          "of a search.",
                          "geometry: 0.1 m, two cells of the usual map")
    rounds: int = tuned(20, "1", "Most steps of a match, each with a search for partners of the end points.",
                        "time of a match; fr079 and Intel need 6 and 5 on average, and 99 of 100 matches at most 16")
    basin: Vector2 = tuned((0.15, 0.1), "m, rad", "Motion from which a match converges. No step of Gauss-Newton is "
                           "longer, and a slip persists over more.",
                           "geometry: three cells, from which partners are found; the same at 1.5 m")
    dependent: float = tuned(10.0, "1", "Errors of beams are correlated: so many count as one.", FLAT)
    normal_variance: float = tuned(0.085, "rad^2", "Variance of the angle of a normal that is fitted to noisy end "
                                   "points.", FLAT)
    good_share: float = tuned(0.8, "1", "Share of the beams below whose score a match is compared with older scans, "
                              "and share of another place's score below which one is worse.",
                              "measured: halved, the median error of 13 logs does not change; above 1 no match is good")
    certain: float = tuned(3.0, "1", "Standard deviations beyond which a difference is no chance.",
                           "normal distribution: 99.7 %")
    outlier: float = tuned(14.2, "1", "Squared Mahalanobis distance of an outlier, which halves its weight.",
                           "chi-squared with 3 degrees of freedom, as improbable as ``certain``: 99.7 %")
    search_most: Vector2 = tuned((0.8, 0.9), "m, rad", "Widest window of a search, and that around an initial pose on "
                                 "a saved map.", "time of a search")

    @property
    def wide(self) -> float:
        """Squared width of the robust kernel in the first round: a cell of the wide search, as its result is [m^2]."""
        return SEARCH.cells[1]**2

    @property
    def beam_deviation(self) -> float:
        """Standard deviation of the distance of one end point from its wall: half the last kernel, a cell [m]."""
        return 0.5 * math.sqrt(self.narrow)

    @property
    def beam_cost(self) -> float:
        """Greatest negative log-likelihood of one beam, with the robust kernel of the last round [1]."""
        return 0.5 * self.narrow / self.beam_deviation**2 / self.dependent

    @property
    def converged(self) -> float:
        """A match has converged if it moves by less than a tenth of the error of a step [m, rad]."""
        return 0.1 * DRIFT.step[0]

    @property
    def score(self) -> float:
        """Limit of minimumScore, and least score of a loop closure: of a search, if some beams see new things [1]."""
        return SEARCH.least_score * self.good_share

    @property
    def search_beams(self) -> int:
        """Beams that the window search uses: around a known pose a quarter of the points will do [1]."""
        return SEARCH.points // 4


@dataclass(frozen=True)
class Tracking:
    """Scans between the processed ones."""

    tilted_distance: float = tuned(1.0, "m", "A driving robot that pitches is level again within this distance.",
                                   "geometry: a few lengths of the robot")
    steepest: float = tuned(0.2, "m/m", "A steeper slope is no ramp: the robot has tipped over.",
                            "ramps of buildings have at most 1 in 8")

    @property
    def missing_scan(self) -> float:
        """Scans are missing in an interval that is nearer to two usual ones than to one [1]."""
        return 1.5

    @property
    def slope_memory(self) -> float:
        """Distance in which the reference slope adapts to a ramp, which is as long as a corridor [m]."""
        return SEARCH.path

    @property
    def stationary(self) -> float:
        """Scans closer to the last matched one than half the error of a step are not matched [m, rad]."""
        return 0.5 * DRIFT.step[0]

    @property
    def sector_change(self) -> float:
        """Change of the mean range of a sector that odometry must explain: no match converges over it [m]."""
        return MATCHING.basin[0]

    @property
    def affected_share(self) -> float:
        """Share of a scan that differs if the laser is tilted or the robot was moved: twice a usual conflict [1]."""
        return 2.0 * OCCLUSION.most_conflict


@dataclass(frozen=True)
class Slips:
    """Motion that odometry does not report, or reports although there was none."""

    cost: float = tuned(6.0, "1", "Negative logarithm of the probability of a slip.", "one scan in 400")
    window: Vector2 = tuned((0.2, 0.3), "m, rad", "Half width of the search, without motion.",
                            "measured: halved or doubled, one of 13 logs is lost")
    window_share: float = tuned(0.4, "1", "Growth of the half width with the step.", FLAT)
    confirm_scans: int = tuned(20, "1", "Scans after which a slip that persists is confirmed without motion; from scan "
                               "to scan it changes by at most a step of a search.", "longer than a robot pitches")

    @property
    def lost(self) -> float:
        """A scan with fewer of the beams that should fit, a half, fits nothing that is known [1]."""
        return 0.5

    @property
    def left(self) -> Vector3:
        """Standard deviations of odometry after a slip, five steps; a larger difference is another one [m, m, rad]."""
        return 5.0 * DRIFT.step[0], 5.0 * DRIFT.step[1], 5.0 * DRIFT.step[2]

    @property
    def sectors(self) -> int:
        """Sectors of directions that are searched if a scan contradicts older ones: window and basin overlap [1]."""
        return math.ceil(math.pi / (self.window[1] + MATCHING.basin[1]))


@dataclass(frozen=True)
class Occlusion:
    """Check of a pose by rays that must not end behind surfaces that other scans have seen."""

    margin: float = tuned(0.4, "m", "A ray conflicts with a surface if it ends this much behind it.",
                          "geometry: larger than the errors of a pose, smaller than a room")
    most_conflict: float = tuned(0.15, "1", "Greatest share of end points in conflict at a right pose.",
                                 "people, glass, thin posts")
    scans: int = tuned(8, "1", "Processed scans that a doubtful scan is compared with.", "time of a check")

    @property
    def gap(self) -> float:
        """Beams farther apart, in median gaps, have an unknown area between them: one may be missing [1]."""
        return 1.0 + TRACKING.missing_scan


@dataclass(frozen=True)
class Odometry:
    """Random errors of odometry."""

    floor: Vector2 = tuned((0.004, 0.005), "m or rad, 1", "Least standard deviation of a step of length 0, and its "
                           "growth with distance and rotation.", "good wheels: half a per cent")
    memory: Vector2 = tuned((10.0, 1.0), "1, 1", "Steps that the scale of the noise is estimated from, and those that "
                            "the user's noise parameters weigh.", "users seldom measure them")
    scale: Vector2 = tuned((0.1, 30.0), "1, 1", "Least and greatest scale of the user's noise.", FLAT)
    fastest: float = tuned(5.0, "m/s", "A higher speed between a saved state and the next scan means that odometry was "
                           "reset.", "robots for rooms drive at most half as fast")


@dataclass(frozen=True)
class Calibration:
    """Systematic errors of odometry and of the laser's mount; components as in ``frontend.track``."""

    prior: Vector6 = tuned((0.03, 0.03, 0.03, 0.1, 0.05, 0.035), "1, 1, rad/m, m, m, rad",
                           "Standard deviations before the first scan.",
                           "a robot measured with a ruler, a laser screwed on by eye, odometry that may report a point "
                           "in front of the axle")
    change: float = tuned(1.0 / 300.0, "1/m", "Growth of the variances of distance and drift with distance, as a "
                          "share of the prior's.", "tyres and floors change within some 100 m")

    @property
    def reported(self) -> Vector2:
        """Smaller errors of the laser's mount are not reported: they are less than those of a step [m, rad]."""
        return DRIFT.step[0], DRIFT.step[2]


@dataclass(frozen=True)
class Particles:
    """Particle filter, and the map that is published."""

    drawn: float = tuned(0.3, "1", "Share of a draw from the proposal that is used.", FLAT)
    kld: Vector2 = tuned((0.15, 2.326), "1, 1", "Bound of the Kullback-Leibler distance between sample and "
                         "distribution, and the quantile of the normal distribution for it.",
                         "Fox, Adapting the sample size in particle filters, IJRR 22(12), 2003: 0.05 to 0.2; 99 %")
    changed_count: float = tuned(0.2, "1", "Relative change of the number of particles that triggers a resampling.",
                                 "time of a resampling")

    @property
    def bin(self) -> Vector3:
        """Bin of poses of KLD-sampling: matches from all of its poses find the same one [m, m, rad]."""
        return MATCHING.basin[0], MATCHING.basin[0], MATCHING.basin[1]

    @property
    def frozen_hits(self) -> int:
        """Hits after which the mean of a cell is final: it is as exact as a step [1]."""
        return math.ceil((MATCHING.beam_deviation / DRIFT.step[0])**2)

    @property
    def same(self) -> Vector3:
        """A map is not made again if a pose changes by less than the error of a step [m, m, rad]."""
        return DRIFT.step

    @property
    def covariance_floor(self) -> Vector3:
        """Least standard deviation of the published pose, that of a step [m, m, rad]."""
        return DRIFT.step


@dataclass(frozen=True)
class Drift:
    """Drift of the path between two visits of a place, which bounds the search for it."""

    heading: float = tuned(4e-5, "rad^2/m", "Variance of the heading per distance of scan matching.",
                           "measured without loop closing on 26 generated logs")
    deviations: float = tuned(2.5, "1", "Half width of a search, in standard deviations of the drift, or of a slip.",
                              "normal distribution: 98.8 %")
    least: Vector2 = tuned((0.5, 0.1), "m, rad", "Least half width of a search. Corrections by wide searches that "
                           "differ by less agree.", "geometry: several cells of the raster of a wide search")
    most: float = tuned(30.0, "m", "Greatest half width of a search along x and y; rotations have none.",
                        "time and memory of a search: both grow with its square")
    room: float = tuned(2.5, "m", "Greatest distance of a result from the old path. With less drift only the newest "
                        "scans are searched, and of the old ones those within drift and room.",
                        "geometry: half of a room")
    step: Vector3 = tuned((0.01, 0.01, 0.004), "m, m, rad", "Least standard deviation of a step of the path.",
                          "geometry: a fifth of a cell")
    carried: Vector3 = tuned((2.0, 2.0, 0.5), "m, m, rad", "Standard deviations of a step on which the robot was "
                             "carried.", "geometry: a person who lifts it puts it down nearby")
    calibration: float = tuned(10.0, "1", "The calibration changes more slowly than the filter assumes, by this "
                               "factor.",
                               "the filter has to follow at once, the smoother knows the whole run")


@dataclass(frozen=True)
class Search:
    """Search for an old place."""

    local: Vector2 = tuned((0.3, 0.08), "m, rad", "A correction up to this needs no other one; corrections by near "
                           "searches that differ by less agree.", "geometry: three cells of the raster, at 4 m")
    least_score: float = tuned(0.6, "1", "Least score, as a share of the best possible one, and least share of the "
                               "beams with a partner in the match after a search.",
                               "measured: halved, the median error of 13 logs grows by 1 mm; above 1 no loop is closed")
    rival: float = tuned(0.9, "1", "Another place with this share of the best score, or of the best rating by points "
                         "in free space, makes the result ambiguous.",
                         "development logs: with 0.92 equal aisles are closed wrongly")
    against: int = tuned(3, "1", "Weight of a point in free space against a point on a wall.", FLAT)
    path: float = tuned(10.0, "m", "Path whose scans a wide search uses. Such a segment is shifted by at most its "
                        "length, and an extension ends after such a gap.", "geometry: a corridor with its doors")
    points: int = tuned(240, "1", "Points of a query, and beams of the match after a search.", "time of a search")
    spacing: float = tuned(0.25, "m", "Cell with one point of the query of a wide search.",
                           "geometry: one cell of its raster; tests with shallow niches")
    reach: float = tuned(12.0, "m", "Farther end points are not used. A place is old after this path, and a candidate "
                         "of a loop closure is dropped.", "time and memory of a search")
    nodes: Tuple[int, int, int] = tuned((24, 160, 320), "1, 1, 1", "Old scans of a near search, of a wide one, and of "
                                        "one with a long segment.", "time of a search")

    @property
    def cells(self) -> Vector2:
        """Cells of the raster of a near search, a step of a window search, and of a wide one, twice that [m, m]."""
        return math.sqrt(MATCHING.narrow), 2.0 * math.sqrt(MATCHING.narrow)

    @property
    def apart(self) -> Vector2:
        """Least distance of another place: it needs another correction than a local one [m, rad]."""
        return 2.0 * self.local[0], 2.0 * self.local[1]

    @property
    def beyond(self) -> float:
        """Other places are searched where the drift can lead for certain, in half widths of a search [1]."""
        return MATCHING.certain / DRIFT.deviations

    @property
    def near_path(self) -> float:
        """Path whose scans a near search uses, in one room, and between two scans of the check of a turned path [m]."""
        return DRIFT.room

    @property
    def alike(self) -> float:
        """Radius of the search for similar places outside the drift: ``reach`` and a room [m]."""
        return self.reach + self.near_path

    @property
    def long_path(self) -> float:
        """Path whose scans are used if several places fit: twice ``reach`` [m]."""
        return 2.0 * self.reach

    @property
    def short_drift(self) -> float:
        """Greatest drift of a search after a short return: half of ``reach`` [m]."""
        return 0.5 * self.reach

    @property
    def fewest(self) -> int:
        """Least number of points of a query, and of beams of a scan that is searched: an eighth of ``points`` [1]."""
        return self.points // 8


@dataclass(frozen=True)
class Links:
    """Fine match of a loop closure, and its covariance."""

    @property
    def prior(self) -> Vector3:
        """Standard deviations of the result of the search: a local correction [m, m, rad]."""
        return SEARCH.local[0], SEARCH.local[0], SEARCH.local[1]

    @property
    def weight(self) -> float:
        """Robust weight of an end point where observability is tested, at the width of the kernel: nearly 1/e [1]."""
        return 1.0 / (1.0 + 1.0 + 1.0 / 2.0 + 1.0 / 6.0)

    @property
    def unheld(self) -> Vector3:
        """Standard deviations in directions that the scans do not fix: the greatest drift [m, m, rad]."""
        return DRIFT.most, DRIFT.most, math.pi

    @property
    def reach(self) -> float:
        """Old scans within this distance, in the same room, make the map [m]."""
        return 2.0 * DRIFT.room

    @property
    def nodes(self) -> float:
        """Additional old scans per distance of a segment that is matched together: as dense as for one scan [1/m]."""
        return SEARCH.nodes[0] / self.reach

    @property
    def looks(self) -> int:
        """Scans of a segment, and old ones, that are checked by occlusion: their pairs are ``OCCLUSION.scans`` [1]."""
        return math.ceil(math.sqrt(OCCLUSION.scans))

    @property
    def floor(self) -> Vector3:
        """Standard deviation that is added to that of a match: twice that of a step, for two visits [m, m, rad]."""
        return 2.0 * DRIFT.step[0], 2.0 * DRIFT.step[1], 2.0 * DRIFT.step[2]


@dataclass(frozen=True)
class Loops:
    """When loop closures are searched and accepted."""

    every: float = tuned(1.0, "m", "Path between two searches. A node this close to a loop closure needs no other one: "
                         "it would be found by the same search.", "time of a search")
    evidence: float = tuned(0.5, "1", "Evidence of candidates that agree, from which on they are accepted.",
                            "development logs: all wrong candidates had at most 0.22 each, 0.4 together")
    searches: int = tuned(4, "1", "Searches of an extension per scan.", "longest time of a scan")

    @property
    def least_change(self) -> Vector2:
        """The maps are made again if a pose certainly moves by more than the error of a step [m, rad]."""
        return MATCHING.certain * DRIFT.step[0], MATCHING.certain * DRIFT.step[2]

    @property
    def spacing(self) -> float:
        """Path between two loop closures in a known area: two searches. A review of the path has twice that [m]."""
        return 2.0 * self.every

    @property
    def least_weight(self) -> float:
        """A loop closure with less weight is removed: that of a residual ``certain`` times the outlier's [1]."""
        return 1.0 / (1.0 + MATCHING.certain**2)


@dataclass(frozen=True)
class Turns:
    """Turns of the path that were not noticed."""

    half_turn: float = tuned(1.0, "s", "In less time no person turns a robot by half a turn, or lifts it.", "3 rad/s")
    count: int = tuned(5, "1", "Least number of results that agree.", "a false turn is worse than a missed one")

    @property
    def memory(self) -> float:
        """Path after which a result is dropped: each may have a segment of its own [m]."""
        return self.count * SEARCH.path

    @property
    def support(self) -> float:
        """Least path with results that agree: half of a segment [m]."""
        return 0.5 * SEARCH.path


SCANS, MATCHING, TRACKING, SLIPS, OCCLUSION = Scans(), Matching(), Tracking(), Slips(), Occlusion()
ODOMETRY, CALIBRATION, PARTICLES = Odometry(), Calibration(), Particles()
DRIFT, SEARCH, LINKS, LOOPS, TURNS = Drift(), Search(), Links(), Loops(), Turns()
#: Names of the groups, in the order of the tables.
GROUPS = ("SCANS", "MATCHING", "TRACKING", "SLIPS", "OCCLUSION", "ODOMETRY", "CALIBRATION", "PARTICLES", "DRIFT",
          "SEARCH", "LINKS", "LOOPS", "TURNS")
#: Ends of the names of modules whose values are frozen in compiled kernels.
KERNEL_MODULES = ("kernels.py", "track.py")
_READ = re.compile(r"\b({})\.([a-z_0-9]+)".format("|".join(GROUPS)))


def read_by(source: str) -> Dict[str, Any]:
    """Return the values that a module's source text reads here, such as {"MATCHING.narrow": 0.01}."""
    return {"{}.{}".format(group, name): getattr(globals()[group], name) for group, name in _READ.findall(source)}
