# SPDX-License-Identifier: BSD-3-Clause
"""Functions that the kernels of this package share: compilation, arc tangent, rotations.

After a change here all kernels of the package are compiled again, see :mod:`m2wr_node.kernel_cache`.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Sequence, Tuple, TypeVar

import numpy as np

try:
    from numba import njit, types
    from numba.extending import intrinsic
except ImportError:
    njit = None

HAVE_NUMBA = njit is not None
_Function = TypeVar("_Function", bound=Callable[..., Any])

if TYPE_CHECKING:
    #: Rotation matrix, row-major.
    Matrix = Tuple[float, float, float, float, float, float, float, float, float]


def kernel(function: _Function, inline: str = "never") -> _Function:
    """Compile a function if numba is available. NaN and infinity keep their meaning; poses and ranges may have both.

    Parameters
    ----------
    function : callable
    inline : str
        See :func:`inlined`.

    Returns
    -------
    callable
    """
    if njit is None:
        return function
    options = dict(nogil=True, error_model='numpy', fastmath={'contract', 'nsz', 'arcp'}, inline=inline)
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:    # no folder that could hold the cache
        return njit(**options)(function)


def inlined(function: _Function) -> _Function:
    """Compile a function into each of its callers: a call with ten arrays takes 50 ns, as each is five arguments."""
    return kernel(function, "always")


if HAVE_NUMBA:
    @intrinsic
    def pointer(_: Any, address: Any) -> Any:
        """Return an address as the pointer that numba's ``carray`` takes; only in compiled code."""
        def convert(context: Any, builder: Any, __: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
        return types.voidptr(types.uintp), convert


@kernel
def atan_unit(x: float) -> float:
    """Arc tangent for x from -1 to 1, to 1.1e-5 rad (Abramowitz and Stegun, 4.4.47)."""
    q = x * x
    return x * (0.9998660 + q * (-0.3302995 + q * (0.1801410 + q * (-0.0851330 + q * 0.0208351))))


@kernel
def atan(slope: float) -> float:
    """Arc tangent of any slope, to 1.1e-5 rad."""
    if abs(slope) <= 1.0:
        return atan_unit(slope)
    return math.copysign(0.5 * math.pi, slope) - atan_unit(1.0 / slope)


@kernel
def azimuth(y: float, x: float) -> float:
    """Return the azimuth of a point; takes a tenth of the time of atan2.

    Parameters
    ----------
    y, x : float
        Coordinates of the point.

    Returns
    -------
    float
        Angle in [-pi, pi], with an error of at most 1.1e-5 rad; 0 for the origin.
    """
    flat, steep = abs(x), abs(y)
    if steep > flat:
        angle = 0.5 * math.pi - atan_unit(flat / steep)
    else:
        angle = 0.0 if flat == 0.0 else atan_unit(steep / flat)         # NaN stays NaN
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@kernel
def rotation(x: float, y: float, z: float, w: float) -> Matrix:
    """Return the rotation matrix of a quaternion.

    Parameters
    ----------
    x, y, z, w : float
        Quaternion of any length. Zeros give the identity; a component that is not finite makes every element NaN.

    Returns
    -------
    tuple of 9 floats
        Row-major.
    """
    norm = x * x + y * y + z * z + w * w
    s = 0.0
    if not norm < 1e-24:
        s = 2.0 / norm if norm < np.inf else np.nan
    return (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
            s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
            s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y))


@kernel
def product(b: Sequence[float], sensor: Sequence[float]) -> Matrix:
    """Return the matrix product transpose(b) * sensor.

    Parameters
    ----------
    b, sensor : (9,) sequence of float
        Rotation matrices, row-major.

    Returns
    -------
    tuple of 9 floats
        Row-major.
    """
    return (b[0] * sensor[0] + b[3] * sensor[3] + b[6] * sensor[6],
            b[0] * sensor[1] + b[3] * sensor[4] + b[6] * sensor[7],
            b[0] * sensor[2] + b[3] * sensor[5] + b[6] * sensor[8],
            b[1] * sensor[0] + b[4] * sensor[3] + b[7] * sensor[6],
            b[1] * sensor[1] + b[4] * sensor[4] + b[7] * sensor[7],
            b[1] * sensor[2] + b[4] * sensor[5] + b[7] * sensor[8],
            b[2] * sensor[0] + b[5] * sensor[3] + b[8] * sensor[6],
            b[2] * sensor[1] + b[5] * sensor[4] + b[8] * sensor[7],
            b[2] * sensor[2] + b[5] * sensor[5] + b[8] * sensor[8])
