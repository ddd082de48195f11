# SPDX-License-Identifier: BSD-3-Clause
"""Covariances of loop closures."""

import numpy as np
import pytest

from m2wr_gmapping.backend import loop_graph


@pytest.mark.parametrize("seed", range(3))
def test_match_covariance_equals_numpy(seed):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    h = root @ root.T * 50.0
    prior, floor = np.array([0.1, 0.2, 0.05]), np.array([1e-4, 2e-4, 3e-5])
    wanted = np.linalg.inv(h / loop_graph.DEPENDENT + np.diag(prior**-2)) + np.diag(floor)
    upper = h[np.triu_indices(3)]
    found = loop_graph.covariance(upper, prior, floor)
    assert np.allclose(found, wanted) and np.allclose(loop_graph.inverse_symmetric(found), np.linalg.inv(wanted))
