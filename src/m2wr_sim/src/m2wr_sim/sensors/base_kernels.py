# SPDX-License-Identifier: BSD-3-Clause
"""What the kernels of this room share: how they are compiled, an arc tangent, rotations.

A change here reaches all of them, for the room drops their caches when any of its modules has changed.
"""
import math

import numpy as np

try:
    from numba import njit, types
    from numba.extending import intrinsic
except ImportError:
    njit = None

HAVE_NUMBA = njit is not None


def kernel(function):
    """Compile with numba where there is one; leave NaN and infinity their meaning, poses and ranges may hold both."""
    if njit is None:
        return function
    options = dict(nogil=True, error_model='numpy', fastmath={'contract', 'nsz', 'arcp'})
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:    # no folder that could hold the cache
        return njit(**options)(function)


if HAVE_NUMBA:
    @intrinsic
    def pointer(_, address):
        """Return an address as the pointer that numba's ``carray`` asks for; in compiled code only."""
        def convert(context, builder, __, arguments):
            return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
        return types.voidptr(types.uintp), convert


@kernel
def atan_unit(x):
    """Arc tangent for |x| <= 1 to 1.1e-5 rad (Abramowitz and Stegun, 4.4.47)."""
    q = x * x
    return x * (0.9998660 + q * (-0.3302995 + q * (0.1801410 + q * (-0.0851330 + q * 0.0208351))))


@kernel
def atan(slope):
    """Arc tangent of any slope, to 1.1e-5 rad."""
    if abs(slope) <= 1.0:
        return atan_unit(slope)
    return math.copysign(0.5 * math.pi, slope) - atan_unit(1.0 / slope)


@kernel
def azimuth(y, x):
    """Angle of (x, y) in [-pi, pi] to 1.1e-5 rad, 0 for the origin; a tenth of the cost of atan2."""
    flat, steep = abs(x), abs(y)
    if steep > flat:
        angle = 0.5 * math.pi - atan_unit(flat / steep)
    else:
        angle = 0.0 if flat == 0.0 else atan_unit(steep / flat)         # NaN stays NaN
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@kernel
def rotation(x, y, z, w):
    """Return the row-major rotation matrix of a quaternion of any length; all zeros give the identity.

    One that is not finite makes every element NaN.
    """
    norm = x * x + y * y + z * z + w * w
    s = 0.0
    if not norm < 1e-24:
        s = 2.0 / norm if norm < np.inf else np.nan
    return (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
            s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
            s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y))


@kernel
def product(b, sensor):
    """Return transpose(b) * sensor for two row-major rotations, row-major."""
    return (b[0] * sensor[0] + b[3] * sensor[3] + b[6] * sensor[6],
            b[0] * sensor[1] + b[3] * sensor[4] + b[6] * sensor[7],
            b[0] * sensor[2] + b[3] * sensor[5] + b[6] * sensor[8],
            b[1] * sensor[0] + b[4] * sensor[3] + b[7] * sensor[6],
            b[1] * sensor[1] + b[4] * sensor[4] + b[7] * sensor[7],
            b[1] * sensor[2] + b[4] * sensor[5] + b[7] * sensor[8],
            b[2] * sensor[0] + b[5] * sensor[3] + b[8] * sensor[6],
            b[2] * sensor[1] + b[5] * sensor[4] + b[8] * sensor[7],
            b[2] * sensor[2] + b[5] * sensor[5] + b[8] * sensor[8])
