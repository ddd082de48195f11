# SPDX-License-Identifier: BSD-3-Clause
"""Two scans that look through each other's surfaces: a wrong pose does so both ways, a person only one way."""
import math

import numpy as np
import pytest

from m2wr_gmapping.frontend.occlusion import NO_CONFLICT, conflict_of, conflict_with_nearest
from m2wr_gmapping.frontend.scan import LaserModel

LASER = LaserModel.from_message(-math.pi, math.pi, math.pi / 90, 181, 0.05, 20.0, max_urange=8.0)
HERE = np.zeros(3)


def room(person=False):
    """Scan from a place 2 m and 4 m from the walls of a room, with a person 1 m ahead."""
    with np.errstate(divide="ignore"):
        c, s = np.cos(LASER.angles), np.sin(LASER.angles)
        ranges = np.minimum(np.where(c > 0, 4.0, 2.0) / np.abs(c), np.where(s > 0, 4.0, 2.0) / np.abs(s))
    return LASER.reading(np.where(person & (np.abs(LASER.angles) < 0.4), 1.0, ranges))


def test_the_same_scan_does_not_conflict():
    assert conflict_of([(HERE, room(), HERE, room())])[::2] == (0, 0)
    assert conflict_of([]) == NO_CONFLICT and NO_CONFLICT.share == NO_CONFLICT.mutual == 0.0


@pytest.mark.parametrize("now, before, appeared", [(True, False, True), (False, True, False)])
def test_a_person_comes_or_leaves_one_way(now, before, appeared):
    found = conflict_of([(HERE, room(now), HERE, room(before))])
    assert (found.appeared > 5, found.gone > 5) == (appeared, not appeared)
    assert found.share > 0.02 and found.mutual == 0.0


def test_a_wrong_rotation_conflicts_both_ways():
    found = conflict_with_nearest(np.array([0.0, 0.0, math.pi]), room(), HERE[None], [room()], 1)
    assert found.mutual > 0.3 and found.mutual <= found.share
