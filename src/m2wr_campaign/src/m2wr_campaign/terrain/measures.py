# SPDX-License-Identifier: BSD-3-Clause
"""How rough ground is, as numbers."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def measures_of(heights: NDArray[np.float64], cell: float) -> Dict[str, float]:
    """Return the roughness of ground.

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    cell : float
        Distance of two samples [m].

    Returns
    -------
    dict of str to float
        ``rms_height``: about the plane that fits best [m]; ``slope_median``, ``slope_95``, ``slope_max``: of the
        triangles [deg]; ``step_95``, ``step_max``: between neighbours [m].
    """
    rows, columns = heights.shape
    x, y = (np.arange(count) - 0.5 * (count - 1) for count in (columns, rows))
    rest = heights - heights.mean()
    # the least squares solution of each coefficient alone, as x, y and 1 are orthogonal on a grid about its centre
    rest = (rest - x * (x * rest.mean(axis=0)).sum() / (x * x).sum()
            - y[:, None] * (y * rest.mean(axis=1)).sum() / (y * y).sum())
    along, down = np.diff(heights, axis=1), np.diff(heights, axis=0)
    # the diagonal rises with x and against the rows: one triangle has the upper and left side, one the lower and right
    slopes = np.degrees(np.arctan(np.concatenate((np.hypot(along[:-1], down[:, :-1]).ravel(),
                                                  np.hypot(along[1:], down[:, 1:]).ravel())) / cell))
    steps = np.abs(np.concatenate((along.ravel(), down.ravel())))
    return {"rms_height": float(np.sqrt(np.mean(rest ** 2))), "slope_median": float(np.median(slopes)),
            "slope_95": float(np.quantile(slopes, 0.95)), "slope_max": float(slopes.max()),
            "step_95": float(np.quantile(steps, 0.95)), "step_max": float(steps.max())}
