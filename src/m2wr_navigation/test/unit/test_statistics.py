# SPDX-License-Identifier: BSD-3-Clause
"""Intervals cover what they should."""
import math

import numpy as np
import pytest

from m2wr_navigation.compare.statistics import bootstrap, wilson


@pytest.mark.parametrize("successes, total, expected", [(0, 10, (0.0, 0.2775)), (10, 10, (0.7225, 1.0)),
                                                        (9, 10, (0.5958, 0.9821)), (50, 100, (0.4038, 0.5962))])
def test_wilson_gives_the_published_intervals(successes, total, expected):
    assert wilson(successes, total) == pytest.approx(expected, abs=2e-4)


def test_nothing_is_known_without_runs():
    assert wilson(0, 0) == (0.0, 1.0) and all(map(math.isnan, bootstrap([])))


def test_a_bootstrap_comes_near_to_the_normal_interval():
    values = np.random.default_rng(0).normal(5.0, 1.0, 400)
    mean, low, high = bootstrap(values)
    assert mean == pytest.approx(values.mean())
    assert (high - low) / 2.0 == pytest.approx(1.96 * values.std() / 20.0, rel=0.1) and low < mean < high
    assert bootstrap(values) == (mean, low, high) and bootstrap([2.0]) == (2.0, 2.0, 2.0)
