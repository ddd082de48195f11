"""What the kernels of this room share: how they are compiled, and an arc tangent.

A change here reaches all of them, for the room drops their caches when any of its modules has changed.
"""
import math

try:
    from numba import njit
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
