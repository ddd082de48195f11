# SPDX-License-Identifier: BSD-3-Clause
"""Weights and resampling."""
import math

import numpy as np
import pytest

from m2wr_gmapping.filter import resampling
from m2wr_gmapping.ros.pose_covariance import normalise


def test_weights_effective_number_and_entropy():
    even = normalise(np.full(8, -1e4), 24.0)
    assert np.allclose(even, 1 / 8) and resampling.effective_number(even) == pytest.approx(8.0)
    assert resampling.entropy(even) == pytest.approx(math.log(8))
    one = normalise(np.array([0.0, -1e9, -1e9]), 1.0)
    assert resampling.effective_number(one) == pytest.approx(1.0) and resampling.entropy(one) == 0.0


@pytest.mark.parametrize("seed", range(10))
def test_resampling_equals_reference(seed):
    rng = np.random.default_rng(seed)
    weights = rng.random(20)**4
    weights /= weights.sum()
    start = rng.random()
    plain = [next(i for i in range(20) if weights[:i + 1].sum() > (start + k) / 20 or i == 19) for k in range(20)]
    ancestors = resampling.systematic_resample(weights, start)
    assert sorted(ancestors) == sorted(plain)
    assert all(ancestors[i] == i for i in set(plain))       # survivors keep their place
