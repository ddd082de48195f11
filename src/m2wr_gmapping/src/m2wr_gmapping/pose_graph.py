"""Poses that fit their relative measurements best: Gauss-Newton on a sparse graph of planar poses."""
import math

import numpy as np

from m2wr_gmapping.se2 import between, wrap

ITERATIONS, MOST_ITERATIONS = 6, 16     # with the kernel as asked for, and together with those in which it narrows
NARROWING = 8.0         # of the kernel from one iteration to the next
CONVERGED = 1e-4


def optimise(poses, pairs, measured, information, robust, kernel=1.0, opened=False):
    """Move poses so that the weighted squares of the graph's residuals are least; the first pose stays.

    Parameters
    ----------
    poses : (K, 3) float64
        Start.
    pairs : (E, 2) int
        Which two poses each measurement relates.
    measured : (E, 3) float64
        Pose of the second seen from the first.
    information : (E, 3, 3) float64
        Inverse covariances, in the axes of the second pose.
    robust : (E,) bool
        Measurements that may be wrong; their weight falls with their residual (Cauchy).
    kernel : float
        Squared residual, in units of its covariance, at which a robust measurement has lost half its weight.
    opened : bool
        Whether to begin with a kernel so wide that the worst of them is heard, and to narrow it: what closes a long
        loop is far off at first, though it is right.

    Returns
    -------
    poses : (K, 3) float64
    weights : (E,) float64
        Final weight of each measurement, 1 for those that are not robust.

    Notes
    -----
    After Grisetti, Kuemmerle, Stachniss, Burgard: A Tutorial on Graph-Based SLAM, IEEE ITS Magazine 2(4), 2010.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import splu

    poses = np.array(poses, float)
    first, second = pairs[:, 0], pairs[:, 1]
    count = len(poses)
    weights = np.ones(len(pairs))
    places = _places(first, second)
    widening = math.inf if opened else 1.0
    for k in range(MOST_ITERATIONS):
        residual, a, b = _linearised(poses, first, second, measured)
        squared = np.einsum("ei,eij,ej->e", residual, information, residual)
        widening = max(1.0, min(squared[robust].max(initial=0.0) / kernel, widening / NARROWING))
        weights = np.where(robust, 1.0 / (1.0 + squared / (kernel * widening)), 1.0)
        omega = information * weights[:, None, None]
        at, bt = np.transpose(a, (0, 2, 1)) @ omega, np.transpose(b, (0, 2, 1)) @ omega
        values = np.concatenate([at @ a, at @ b, bt @ a, bt @ b]).reshape(-1)
        gradient = np.zeros((count, 3))
        np.add.at(gradient, first, (at @ residual[..., None])[..., 0])
        np.add.at(gradient, second, (bt @ residual[..., None])[..., 0])
        matrix = coo_matrix((values, places), shape=(3 * count, 3 * count)).tocsc()[3:, 3:]
        solver = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        step = solver.solve(-gradient.reshape(-1)[3:]).reshape(-1, 3)
        poses[1:] += step
        if widening == 1.0 and (np.abs(step).max() < CONVERGED or k >= ITERATIONS - 1):
            break
    poses[:, 2] = wrap(poses[:, 2])
    return poses, weights


def _places(first, second):
    """Rows and columns of the 3 x 3 blocks aa, ab, ba, bb of all measurements."""
    inner_row, inner_column = np.repeat(np.arange(3), 3), np.tile(np.arange(3), 3)
    rows = np.concatenate([first, first, second, second])[:, None] * 3 + inner_row
    columns = np.concatenate([first, second, first, second])[:, None] * 3 + inner_column
    return rows.reshape(-1), columns.reshape(-1)


def _linearised(poses, first, second, measured):
    """Residuals (E, 3) in the axes of the measured second pose, and their derivatives (E, 3, 3) by both poses."""
    p, q = poses[first], poses[second]
    error = between(measured, between(p, q))
    c, s = np.cos(p[:, 2] + measured[:, 2]), np.sin(p[:, 2] + measured[:, 2])
    dx, dy = q[:, 0] - p[:, 0], q[:, 1] - p[:, 1]
    a, b = np.zeros((len(p), 3, 3)), np.zeros((len(p), 3, 3))
    b[:, 0, 0], b[:, 0, 1], b[:, 1, 0], b[:, 1, 1], b[:, 2, 2] = c, s, -s, c, 1.0
    a[:, :2, :2] = -b[:, :2, :2]
    a[:, 0, 2], a[:, 1, 2] = -s * dx + c * dy, -c * dx - s * dy
    # the measured translation turns with p as well, but by rotation inverse of measured only: it is a constant there
    a[:, 2, 2] = -1.0
    return error, a, b
