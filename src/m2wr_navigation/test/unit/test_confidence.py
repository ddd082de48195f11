# SPDX-License-Identifier: BSD-3-Clause
import math

import pytest

from m2wr_navigation.localization.confidence import doubt


@pytest.mark.parametrize("share, weight, words", [
    (0.9, 1.0, ""), (math.nan, 1.0, ""), (0.31, 0.9, "only 31 % of the beams fit the map"),
    (0.9, 0.21, "the robot may be in several places: only 21 % of the particles agree"),
    (math.nan, 0.1, "the robot may be in several places")])
def test_a_doubtful_pose_is_told_with_its_reason(share, weight, words):
    assert bool(doubt(share, weight)) == bool(words) and words in doubt(share, weight)
