# SPDX-License-Identifier: BSD-3-Clause
"""Scans passed over because others wait: none that is processed, and the map is made all the same."""
import math

import numpy as np
import pytest

from conftest import drive
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.ros.backlog import may_pass

LIMIT = 100


def run(ring, laser, waiting):
    """Drive with 3 cm between two scans; return the mapper, the number passed over and the largest error [m]."""
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=4, linearUpdate=0.5, angularUpdate=0.3)), laser)
    truth, passed, worst = drive(0.45, 0.03), 0, 0.0
    for k, pose in enumerate(truth):
        if k and may_pass(mapper, pose, 0.05 * k, waiting, LIMIT):
            passed += 1
            continue
        mapper.process(mapper.reading(ring.ranges(pose, laser.angles)), pose, 0.05 * k)
        worst = max(worst, np.hypot(*(mapper.pose - pose)[:2]))
    mapper.close()
    return mapper, passed, worst


def test_short_queue_skips_nothing(ring, laser):
    for waiting, limit in ((0, LIMIT), (9, LIMIT), (2, 5)):
        mapper = Mapper(GmappingConfig.from_mapping({"particles": 2}), laser)
        mapper.process(mapper.reading(ring.ranges(drive()[0], laser.angles)), np.zeros(3), 0.0)
        assert not may_pass(mapper, np.full(3, 0.01), 0.1, waiting, limit)
        mapper.close()


@pytest.mark.parametrize("waiting, share", [(10, 0.5), (50, 0.9)])
def test_due_scans_are_never_skipped(ring, laser, waiting, share):
    whole, none, _ = run(ring, laser, 0)
    hasty, passed, worst = run(ring, laser, waiting)
    assert none == 0 and passed > share * (passed + hasty.processed + hasty.tracked)
    # a scan is due where the way driven since the last one is long enough: the same ones, whatever was left out between
    assert hasty.stamps == whole.stamps and len(whole.stamps) > 40
    assert worst < 0.05


def test_temporal_update_makes_a_scan_due(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2, "temporalUpdate": 1.0}), laser)
    mapper.process(mapper.reading(ring.ranges(drive()[0], laser.angles)), np.zeros(3), 0.0)
    assert may_pass(mapper, np.zeros(3), 0.9, LIMIT, LIMIT) and not may_pass(mapper, np.zeros(3), 1.1, LIMIT, LIMIT)
    mapper.close()


def test_distant_scans_are_skipped_only_in_a_long_queue(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2}), laser)
    mapper.process(mapper.reading(ring.ranges(drive()[0], laser.angles)), np.zeros(3), 0.0)
    far = np.array([0.3, 0.0, 0.0])
    assert not may_pass(mapper, far, 0.1, 10, LIMIT) and may_pass(mapper, far, 0.1, 50, LIMIT)
    for pose, stamp in (([math.nan, 0.0, 0.0], 0.1), ([0.0, 0.0, 0.0], math.inf)):
        assert not may_pass(mapper, np.array(pose), stamp, LIMIT, LIMIT)
    mapper.close()


def test_compatible_mode_skips_nothing(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2, "compatible": True}), laser)
    mapper.process(mapper.reading(ring.ranges(drive()[0], laser.angles)), np.zeros(3), 0.0)
    assert not may_pass(mapper, np.zeros(3), 0.1, LIMIT, LIMIT)
    mapper.close()
