# SPDX-License-Identifier: BSD-3-Clause
"""Walls have two sides: a scan of the one is no evidence for a place from which the other was seen."""
import math
from dataclasses import replace

import numpy as np
import pytest

from m2wr_gmapping.backend.loop_graph import LoopGraph
from m2wr_gmapping.backend.place_check import opposite_share
from m2wr_gmapping.backend.place_search import Scene
from m2wr_gmapping.backend.route import distances_along
from m2wr_gmapping.backend.step_history import StepHistory
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend.matcher import FastMatcher
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_node.thread_team import ThreadTeam
from wall_ranges import ranges

LASER = LaserModel.from_message(-math.pi / 2, math.pi / 2, math.pi / 240, 241, 0.05, 10.0)
THICK, AWAY = 0.7, 1.3        # m


def walls(thick):
    """A folded sheet along x, both faces with the same steps, between two walls along y that fit anywhere."""
    breaks, heights = (-3.0, -2.2, -1.2, -0.6, 0.6, 1.5, 2.1, 3.0), (0.0, 0.4, 0.0, 0.5, 0.1, 0.4, 0.0)
    fold = [(x, y, to_x, y) for x, to_x, y in zip(breaks, breaks[1:], heights)]
    fold += [(x, y, x, to_y) for x, y, to_y in zip(breaks[1:], heights, heights[1:])]
    faces = [(x, y + away, to_x, to_y + away) for away in (0.5 * thick, -0.5 * thick) for x, y, to_x, to_y in fold]
    ends = [(x, -0.5 * thick, x, 0.5 * thick) for x in (-3.0, 3.0)]
    return np.array(faces + ends + [(x, -9.0, x, 9.0) for x in (-4.5, 4.5)])


def scene(thick, side=1.0):
    """Scans of the one side along x, then of one side at the end: 1 the other one, -1 the same again."""
    places = [(x, -AWAY, math.pi / 2) for x in np.arange(-2.0, 2.1, 0.5)]
    places += [(x, AWAY * side, -0.5 * side * math.pi) for x in np.arange(-1.0, 1.1, 0.5)]
    path = np.array(places)
    readings = [LASER.reading(ranges(walls(thick), pose, LASER.angles)) for pose in path]
    return Scene(path, distances_along(path), readings, 9, np.full(len(path), 1.4), np.full(len(path), 0.2))


@pytest.mark.parametrize("side, moved, low, high", [
    (1.0, -THICK, 0.3, 1.0),        # the far face is taken for the near one
    (1.0, 0.0, 0.0, 0.05), (-1.0, 0.0, 0.0, 0.05)])
def test_the_other_face_of_a_wall_is_opposite(side, moved, low, high):
    seen = scene(THICK, side)
    share = opposite_share(seen, seen.path[-1] + (0.0, moved, 0.0), np.arange(9))
    assert low <= share <= high


def test_scans_without_end_points_are_not_opposite():
    seen = scene(THICK)
    empty = LASER.reading(np.full(241, np.inf))
    assert opposite_share(replace(seen, readings=[empty] * 14), seen.path[-1], np.arange(9)) == 0.0


def near_link(seen):
    graph = LoopGraph(FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), 0.05, StepHistory())
    return graph.near_link(seen, np.arange(9))


def test_no_loop_is_closed_on_the_other_side_of_a_wall():
    found = near_link(scene(THICK))
    assert found is None or abs(found.pose[1] - AWAY) < 0.1


def test_a_loop_is_closed_on_the_same_side_of_a_wall():
    found = near_link(scene(THICK, -1.0))
    assert found is not None and np.allclose(found.pose, (1.0, -AWAY, math.pi / 2), atol=0.05)
