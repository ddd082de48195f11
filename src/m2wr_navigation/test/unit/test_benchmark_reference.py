# SPDX-License-Identifier: BSD-3-Clause
"""Our sampling planners against those of OMPL, where it is installed; without it there is a clear message."""
import importlib
import math

import numpy as np
import pytest

from m2wr_navigation.benchmark import reference
from m2wr_navigation.planners.visibility_kernels import shortest
from planner_grids import RESOLUTION, blocks, costs_along, grid, planner, pose

SIZE, SECONDS = 90, 1.0
WORSE = 1.03                # theirs take as many samples as there is time for, ours 5000


def length(path):
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


@pytest.mark.parametrize("name", sorted(reference.NAMES))
@pytest.mark.parametrize("seed", [0, 1])
def test_paths_are_as_short_as_those_of_the_reference(name, seed):
    pytest.importorskip("ompl.base", reason=reference.NO_OMPL)
    costs = blocks(SIZE, 25, seed)
    costmap, start, goal = grid(costs), pose(1, 1), pose(SIZE - 2, SIZE - 2)
    best = shortest((costs == 254).astype(np.uint8), (1, 1), (SIZE - 2, SIZE - 2))[1] * RESOLUTION
    theirs = reference.reference_path(name, costmap, start, goal, SECONDS)
    assert (costs_along(costmap, theirs) < 253).mean() > 0.995      # a motion is checked at points
    assert best < math.inf and length(theirs) > 0.99 * best
    assert planner(name).plan(costmap, start, goal).length < WORSE * length(theirs)


def test_without_ompl_it_is_told_how_to_get_it(monkeypatch):
    def missing(name):
        raise ImportError(name)
    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(reference.NoReferenceError, match="pip install ompl"):
        reference.reference_path("RRT", grid(blocks(SIZE, 25, 0)), (0.1, 0.1), (1.0, 1.0), SECONDS)
