# SPDX-License-Identifier: BSD-3-Clause
"""How fast a process grows, separated from periodic use.

A mapper grows within a shift with its map and path, and starts again when the clock does.  So each shift gives one
number: the median of the samples of its last third, when the map has its full size.  The slope through these numbers
is that of Theil and Sen, the median of the slopes of all pairs, which single outliers do not change.  The shifts of
the warm-up are left out.
"""
import numpy as np

WARM_UP = 0.15          # share of the run
LAST = 0.67             # of a shift's length; samples after it count
LEAST_SHIFTS = 6


def levels(samples, name, shift_seconds):
    """Return hours (n,) and values (n,), one for each complete shift after the warm-up.

    Parameters
    ----------
    samples : list of watch.Sample
    name : str
        ``memory``, ``descriptors`` or ``threads``.
    shift_seconds : float
        Length of a shift [s, simulated].
    """
    end = samples[-1].hours if samples else 0.0
    hours, values = [], []
    for shift in sorted({sample.shift for sample in samples}):
        inside = [sample for sample in samples if sample.shift == shift and sample.age >= LAST * shift_seconds
                  and sample.hours >= WARM_UP * end]
        if inside:
            hours.append(float(np.median([sample.hours for sample in inside])))
            values.append(float(np.median([getattr(sample, name) for sample in inside])))
    return np.array(hours), np.array(values)


def slope(hours, values):
    """Return Theil and Sen's slope [per hour] and the bounds between which 95 % of its resamplings lie.

    Raises
    ------
    ValueError
        For fewer than ``LEAST_SHIFTS`` points, too few for a slope.
    """
    if len(hours) < LEAST_SHIFTS:
        raise ValueError("%d shifts; expected at least %d for a slope" % (len(hours), LEAST_SHIFTS))

    def middle(index):
        one, two = np.triu_indices(len(index), 1)
        apart = hours[index][two] - hours[index][one]
        some = apart != 0.0
        return float(np.median((values[index][two] - values[index][one])[some] / apart[some]))

    whole = np.arange(len(hours))
    generator = np.random.default_rng(0)
    drawn = [middle(np.sort(generator.integers(0, len(hours), len(hours)))) for _ in range(200)]
    return middle(whole), float(np.percentile(drawn, 2.5)), float(np.percentile(drawn, 97.5))
