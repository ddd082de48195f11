# SPDX-License-Identifier: BSD-3-Clause
"""What a scan tells about its pose, and how it is fused with odometry."""
import math

import numpy as np
import pytest

from m2wr_gmapping.frontend import information_kernels as ik
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_maps.se2 import between, compose

EXPECTED, PRIOR = np.array([2.0, 1.0, 0.5]), np.array([400.0, 600.0, 1000.0])
SLOPE = ik.NORMAL_VARIANCE


def row_of(information, pose=EXPECTED):
    row = np.zeros(mk.RESULT_SIZE)
    row[:3], row[mk.INFORMATION:] = pose, np.asarray(information)[np.triu_indices(3)]
    return row


def walls(across, along, angle, heading=5e4):
    """Information (3, 3) with that much across a wall and along it, which has that direction in the laser's frame."""
    c, s = math.cos(angle), math.sin(angle)
    found = np.zeros((3, 3))
    found[:2, :2] = across * np.outer([-s, c], [-s, c]) + along * np.outer([c, s], [c, s])
    found[2, 2] = heading
    return found


def random_rows(count=300):
    rng = np.random.default_rng(3)
    for _ in range(count):
        root = rng.normal(size=(3, 3)) * 10.0**rng.uniform(0.0, 2.5, (3, 1)) * rng.integers(0, 2, (3, 1))
        yield row_of(root.T @ root, compose(EXPECTED, rng.normal(size=3) * [0.1, 0.1, 0.02]))


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.0, 0.5 * math.pi, 3.0])
def test_plain_wall_has_no_information_along_itself(angle):
    """Noisy normals pretend some."""
    row, along = row_of(walls(1e4, SLOPE * 1e4, angle)), np.array([math.cos(angle), math.sin(angle), 0.0])
    x, y, weak, true = ik.weak_axis(row)
    assert abs(x * along[0] + y * along[1]) == pytest.approx(1.0) and weak == pytest.approx(SLOPE * 1e4)
    assert true == pytest.approx(0.0, abs=1e-6)
    found, across = ik.scan_information(row, 1.0), np.array([-along[1], along[0], 0.0])
    assert found @ along == pytest.approx(np.zeros(3), abs=1e-3)
    assert across @ found @ across == pytest.approx(1e4) and found[2, 2] == pytest.approx(5e4)


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.0, 0.5 * math.pi, 3.0])
def test_odometry_is_kept_along_a_plain_wall(angle):
    moved = np.array([0.1, -0.05, 0.02])
    row = row_of(walls(1e4, SLOPE * 1e4, angle), compose(EXPECTED, moved))
    ik.fuse(row, EXPECTED, PRIOR)
    turned = np.array([math.cos(angle + moved[2]), math.sin(angle + moved[2])])     # the axes of the matched pose
    left = between(EXPECTED, row[:3])
    assert left[:2] @ turned == pytest.approx(0.0, abs=1e-6) and left[2] == pytest.approx(moved[2])
    aside = np.array([-turned[1], turned[0]])
    assert left[:2] @ aside == pytest.approx(moved[:2] @ aside)


def test_odometry_is_kept_along_an_exact_wall():
    """As made by a simulator: its normals do not lean."""
    row = row_of(np.diag([0.0, 1e4, 1e4]), compose(EXPECTED, [0.1, -0.05, 0.0]))
    ik.fuse(row, EXPECTED, PRIOR)
    assert between(EXPECTED, row[:3]) == pytest.approx([0.0, -0.05, 0.0], abs=1e-9)


def test_match_without_partners_stays():
    row = row_of(np.zeros((3, 3)), compose(EXPECTED, [0.1, -0.05, 0.02]))
    before = row.copy()
    ik.fuse(row, EXPECTED, PRIOR)
    assert (row == before).all()


def test_corner_is_not_changed():
    row = row_of(walls(1e6, 0.9e6, 0.3), compose(EXPECTED, [0.1, -0.05, 0.02]))
    before = row[:3].copy()
    ik.fuse(row, EXPECTED, PRIOR)
    assert between(before, row[:3]) == pytest.approx(np.zeros(3), abs=1e-4)
    assert ik.scan_information(row, 1.0)[:2, :2] == pytest.approx(walls(1e6, 0.9e6, 0.3)[:2, :2], abs=0.12e6)


def test_information_of_the_normals_noise_is_removed():
    """Walls of both directions: each adds to the other's what its normals' noise pretends."""
    across, along = 1e4, 4e3
    seen = walls(across + SLOPE * along, along + SLOPE * across, 0.7)
    assert ik.weak_axis(row_of(seen))[3] == pytest.approx(along)


def test_random_information_stays_positive_semidefinite():
    for row in random_rows():
        found, whole = ik.scan_information(row, 1.0), ik.unfold(row)
        scale = max(1.0, np.abs(whole).max())
        assert np.allclose(found, found.T, atol=1e-9 * scale)
        assert np.linalg.eigvalsh(found).min() > -1e-9 * scale
        assert found.diagonal()[:2].sum() <= whole.diagonal()[:2].sum() + 1e-9 * scale
        assert np.allclose(ik.scan_information(row, 0.1), 0.1 * found)


def test_fusion_never_moves_away_from_odometry():
    moved = 0
    for row in random_rows():
        before = between(EXPECTED, row[:3])
        ik.fuse(row, EXPECTED, PRIOR)
        after = between(EXPECTED, row[:3])
        assert np.hypot(*after[:2]) <= np.hypot(*before[:2]) + 1e-12 and after[2] == pytest.approx(before[2])
        moved += bool(np.hypot(*after[:2]) < 0.9 * np.hypot(*before[:2]))
    assert moved > 30


def test_fusion_of_many_equals_fusion_of_each():
    rows, expected = np.array(list(random_rows(20))), compose(np.tile(EXPECTED, (20, 1)), [0.01, 0.02, 0.0])
    single = rows.copy()
    ik.fuse_all(rows, expected, PRIOR)
    for row, at in zip(single, expected):
        ik.fuse(row, at, PRIOR)
    assert (rows == single).all()


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_odometry_is_removed_from_a_match(angle):
    """A match is the mean of scan and odometry; what the scan alone tells does not depend on the prior."""
    true, seen, error = walls(2e4, 3e3, angle), walls(2e4 + SLOPE * 3e3, 3e3 + SLOPE * 2e4, angle), [0.03, -0.04, 0.0]
    told = []
    for weight in (1e2, 1e4):
        prior = np.array([weight, weight, weight])
        match = np.linalg.solve(seen + np.diag(prior), seen @ error)
        out, vector = ik.scan_vector(row_of(seen, compose(EXPECTED, match)), EXPECTED, prior)
        told.append(vector)
        along = np.array([math.cos(angle), math.sin(angle), 0.0])
        assert along @ out @ along == pytest.approx(3e3) and along @ vector == pytest.approx(along @ true @ error)
    assert told[0] == pytest.approx(told[1], rel=1e-6)
