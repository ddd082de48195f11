# SPDX-License-Identifier: BSD-3-Clause
"""The places where a robot may be that could be anywhere: all that fit are kept until the scans decide.

A set of particles loses places by chance, and few beams cannot tell similar ones apart. So each place is followed by
itself here, fitted to each scan, and judged by all its beams. What falls behind is not a place any more.

P. Jensfelt, S. Kristensen, Active Global Localization for a Mobile Robot Using Multiple Hypothesis Tracking, IEEE
Trans. Robotics and Automation 17(5), 2001, has the idea.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping, Tuple

import numpy as np

from m2wr_maps.se2 import between, compose
from m2wr_navigation.localization import place_kernels as kernels
from m2wr_navigation.localization.sensor_models import match

if TYPE_CHECKING:
    from m2wr_navigation.localization.beams import Beams
    from m2wr_navigation.localization.localization_map import LocalizationMap
    from m2wr_node.array_types import FloatArray

MOST_PLACES = 100           # that are followed; the first scan leaves so many in a building
APART = np.array([0.5, np.radians(20.0)])       # nearer poses are one place [m, rad]: a bin and two of the filter's
NEAR = np.array([1.0, np.radians(40.0)])        # particles so near belong to a place [m, rad]: twice that
#: Deviations of a place before it is fitted to a scan [m, m, rad]: of a particle that was drawn, and after a step of
#: 0.2 m or 30 degrees, `update_min_d` and `update_min_a`.
DRAWN: FloatArray = np.diag(np.square([0.3, 0.3, 0.15]))
MOVED: FloatArray = np.diag(np.square([0.05, 0.05, 0.03]))
SPREAD = 0.1                # deviation of a range from the map's, two cells [m]
UNMAPPED = 0.1              # share of beams that hit what is not in the map: people, furniture
#: Beams of a scan whose errors are independent. In world01, whose quarters are alike, a wrong quarter was never more
#: than 4 ahead of the true one with this number, in ten drives of 150 s, and at the end at least 45 behind.
INDEPENDENT_BEAMS = 7.5
DROPPED = 10.0              # natural logarithms that a place may be behind the best: more than twice those 4
ELSEWHERE = 0.01            # share of the weight that particles in no place keep together; a later place begins with it
COPIES = 20                 # particles that a place without any gets
SCATTER = np.array([0.05, 0.05, 0.03])          # their deviation [m, m, rad]


class PlaceSearch:
    """Places that fit all scans so far.

    Attributes
    ----------
    poses : (K, 3) float64
        x, y [m], theta [rad] on the map.
    evidence : (K,) float64
        Logarithms of their probabilities over that of the best one, which is the first.
    """

    def __init__(self) -> None:
        self.poses: FloatArray = np.zeros((0, 3))
        self.evidence: FloatArray = np.zeros(0)

    @property
    def decided(self) -> bool:
        """Whether one place is left."""
        return len(self.poses) == 1

    @property
    def probabilities(self) -> FloatArray:
        """Of the places (K,), with sum 1."""
        weights = np.exp(self.evidence)
        return weights / weights.sum()

    def move(self, before: FloatArray, after: FloatArray) -> None:
        """Move all places as odometry did.

        Parameters
        ----------
        before, after : (3,) float64
            Poses of the base in the odometry's frame.
        """
        self.poses = compose(self.poses, between(before, after))

    def look(self, particles: FloatArray, fit: FloatArray, beams: Beams, grid: LocalizationMap,
             values: Mapping[str, Any]) -> None:
        """Judge all places by a scan, with the particles that fit it as new places.

        Parameters
        ----------
        particles : (N, 3) float64
        fit : (N,) float64
            How well the scan fits from them, logarithms.
        beams : Beams
        grid : LocalizationMap
        values : mapping of str to object
            Parameters of ``amcl_parameters``.
        """
        known = len(self.poses)
        order = np.argsort(-fit)
        room = np.empty((MOST_PLACES, 3))
        room[:known] = self.poses
        count = kernels.distinct(particles[order], room, known, APART)
        poses, agreement = room[:count].copy(), np.empty(count)
        blocked, free = grid.clear_distance()
        for k in range(count):
            found = match(poses[k], MOVED if k < known else DRAWN, beams, grid, values)
            if np.isfinite(found.pose).all():
                poses[k] = found.pose
        kernels.agreement(grid.to_grid(poses), beams.mount, beams.polar, beams.reach, blocked, free, grid.occupied,
                          grid.resolution, SPREAD, UNMAPPED, agreement)
        agreement *= min(1.0, INDEPENDENT_BEAMS / max(1, beams.polar.shape[1]))
        begin = np.full(count - known, math.log(ELSEWHERE) if known else 0.0)
        self._keep(poses, agreement + np.concatenate([self.evidence, begin]))

    def _keep(self, poses: FloatArray, evidence: FloatArray) -> None:
        """Keep places that are apart and not too far behind, the best first."""
        order = np.argsort(-evidence)
        kept = order[evidence[order] >= evidence[order[0]] - DROPPED]
        room, chosen = np.empty((MOST_PLACES, 3)), []
        count = 0
        for k in kept:
            more = kernels.distinct(poses[k:k + 1], room, count, APART)
            if more > count:
                chosen.append(k)
            count = more
        self.poses, self.evidence = poses[chosen], evidence[chosen] - evidence[order[0]]

    def share_out(self, particles: FloatArray, weights: FloatArray,
                  rng: np.random.Generator) -> Tuple[FloatArray, FloatArray]:
        """Give each place's particles its probability; places without particles get some.

        Parameters
        ----------
        particles : (N, 3) float64
        weights : (N,) float64
        rng : numpy.random.Generator

        Returns
        -------
        particles : (M, 3) float64
        weights : (M,) float64
            With sum 1.
        """
        owner = np.empty(len(particles), np.int64)
        kernels.nearest(particles, self.poses, NEAR, owner)
        count = len(self.poses)
        sums = np.bincount(owner + 1, weights, count + 1)
        lost = np.flatnonzero(sums[1:] <= 0.0)
        wanted = np.concatenate([[ELSEWHERE], self.probabilities * (1.0 - ELSEWHERE)])
        factors = np.divide(wanted, sums, out=np.zeros(count + 1), where=sums > 0.0)
        more = np.repeat(self.poses[lost], COPIES, axis=0)
        more = more + SCATTER * rng.standard_normal(more.shape)
        particles = np.concatenate([particles, more])
        weights = np.concatenate([weights * factors[owner + 1], np.repeat(wanted[1:][lost] / COPIES, COPIES)])
        return particles, weights / weights.sum()
