# SPDX-License-Identifier: BSD-3-Clause
"""Small systems of linear equations in kernels."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


@kernel
def solve(h: FloatArray, g: FloatArray, step: FloatArray) -> bool:
    """Solve the symmetric 3 x 3 system h * step = -g by Cholesky factorisation.

    Parameters
    ----------
    h : (6,) float64
        Upper triangle (xx xy xt yy yt tt).
    g : (3,) float64
        Gradient.
    step : (3,) float64
        Written: solution.

    Returns
    -------
    bool
        False if the matrix is not positive definite.
    """
    if not h[0] > 0.0:
        return False
    l00 = math.sqrt(h[0])
    l10, l20 = h[1] / l00, h[2] / l00
    d = h[3] - l10 * l10
    if not d > 0.0:
        return False
    l11 = math.sqrt(d)
    l21 = (h[4] - l20 * l10) / l11
    d = h[5] - l20 * l20 - l21 * l21
    if not d > 0.0:
        return False
    l22 = math.sqrt(d)
    y0 = -g[0] / l00
    y1 = (-g[1] - l10 * y0) / l11
    y2 = (-g[2] - l20 * y0 - l21 * y1) / l22
    step[2] = y2 / l22
    step[1] = (y1 - l21 * step[2]) / l11
    step[0] = (y0 - l10 * step[1] - l20 * step[2]) / l00
    return True
