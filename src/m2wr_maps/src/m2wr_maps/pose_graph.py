# SPDX-License-Identifier: BSD-3-Clause
"""Optimisation of a planar pose graph: Gauss-Newton on sparse normal equations, robust against wrong loop closures."""
from __future__ import annotations

import math
from typing import Any, Tuple

import numpy as np

from m2wr_maps import pose_graph_kernels as kernels
from m2wr_maps.se2 import wrap
from m2wr_node.array_types import BoolArray, FloatArray

ITERATIONS, MOST_ITERATIONS = 6, 16     # with the final kernel, and together with those in which it narrows
CONVERGED = 1e-4                        # largest component of a step [m], [rad]
NARROWING = 8.0                         # factor of the robust kernel from one iteration to the next


def optimise(poses: Any, pairs: Any, measured: Any, information: Any, robust: BoolArray, kernel: float = 1.0,
             opened: bool = False) -> Tuple[FloatArray, FloatArray]:
    """Minimise the weighted squared residuals of a pose graph; the first pose is fixed.

    Parameters
    ----------
    poses : (K, 3) float64
        Initial poses x, y [m], theta [rad].
    pairs : (E, 2) int
        Numbers of the two poses of each measurement.
    measured : (E, 3) float64
        Pose of the second seen from the first [m, m, rad].
    information : (E, 3, 3) float64
        Inverse covariances, in the axes of the second pose.
    robust : (E,) bool
        Measurements that may be outliers; their weight falls with the residual (Cauchy).
    kernel : float
        Squared residual, in units of its covariance, at which a robust measurement has half its weight.
    opened : bool
        Whether to start with a wide kernel and narrow it. A correct loop closure of a long loop has a large residual at
        first.

    Returns
    -------
    poses : (K, 3) float64
    weights : (E,) float64
        Final weight of each measurement, 1 for those that are not robust.

    Raises
    ------
    ValueError
        If a pose is not connected to the first one.

    Notes
    -----
    The least-squares problem and its normal equations are those of Grisetti, Kuemmerle, Stachniss, Burgard: A Tutorial
    on Graph-Based SLAM, IEEE ITS Magazine 2(4), 2010. Robust measurements are reweighted in each iteration with the
    weight of Cauchy's cost, see Zhang: Parameter Estimation Techniques, Image and Vision Computing 15(1), 1997. A
    kernel that starts wide and narrows is graduated non-convexity: Blake, Zisserman: Visual Reconstruction, MIT Press
    1987; Yang, Antonante, Tzoumas, Carlone, RA-L 5(2), 2020. For the sparse factorisation see ``pose_graph_kernels``.
    """
    poses = np.array(poses, float)
    pairs = np.ascontiguousarray(pairs, np.int64)
    measured, information = np.ascontiguousarray(measured, float), np.ascontiguousarray(information, float)
    count, weights = len(poses), np.ones(len(pairs))
    if count < 2 or not len(pairs):
        poses[:, 2] = wrap(poses[:, 2])
        return poses, weights
    order, starts, columns, targets, slots = kernels.plan(count, pairs)
    residual, squared = np.empty((len(pairs), 3)), np.empty(len(pairs))
    diagonal, blocks, step = np.empty((count, 9)), np.empty((len(columns), 9)), np.empty((count, 3))
    widening = math.inf if opened else 1.0
    for k in range(MOST_ITERATIONS):
        kernels.residuals(poses, pairs, measured, information, residual, squared)
        widening = max(1.0, min(squared[robust].max(initial=0.0) / kernel, widening / NARROWING))
        weights = np.where(robust, 1.0 / (1.0 + squared / (kernel * widening)), 1.0)
        kernels.assemble(poses, pairs, measured, information, weights, residual, columns, slots, diagonal, blocks, step)
        if not kernels.factorise(order, starts, columns, targets, diagonal, blocks):
            raise ValueError("a graph of {} poses: expected each to be connected to the first".format(count))
        kernels.substitute(order, starts, columns, diagonal, blocks, step)
        poses[1:] -= step[1:]
        if widening == 1.0 and (np.abs(step[1:]).max() < CONVERGED or k >= ITERATIONS - 1):
            break
    poses[:, 2] = wrap(poses[:, 2])
    return poses, weights
