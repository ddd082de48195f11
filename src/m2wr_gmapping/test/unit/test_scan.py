# SPDX-License-Identifier: BSD-3-Clause
"""Beam angles, mounts, usable ranges and normals."""
import math

import numpy as np
import pytest

from conftest import drive
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.scan import LaserModel, ScanError
from m2wr_gmapping.frontend.scan_kernels import classify_ranges, surface_normals, with_normals
from m2wr_maps.transforms import rotation

UPRIGHT = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def ends_in_base(model, ranges):
    """Hit points (2, H) of a scan in the base frame."""
    x, y, theta = model.base_from_sensor
    c, s = math.cos(theta), math.sin(theta)
    px, py = model.reading(ranges).points
    return np.stack([x + c * px - s * py, y + s * px + c * py])


def expected(angle_min, increment, ranges, mount):
    """The same from first principles: each beam's end in the laser's frame, brought over by the full transform."""
    angles = angle_min + increment * np.arange(len(ranges))
    ends = np.stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(ranges))])
    return (rotation(mount[1]) @ ends + np.array(mount[0])[:, None])[:2]


@pytest.mark.parametrize("roll", [0.0, math.pi])
@pytest.mark.parametrize("yaw", [0.0, 0.4, -2.0])
@pytest.mark.parametrize("angle_min, angle_max", [(-1.0, 1.0), (-0.3, 1.2), (1.2, -0.3), (0.0, 6.0)])
def test_end_points_follow_the_mount(roll, yaw, angle_min, angle_max):
    quaternion = (math.sin(roll / 2) * math.cos(yaw / 2), math.sin(roll / 2) * math.sin(yaw / 2),
                  math.cos(roll / 2) * math.sin(yaw / 2), math.cos(roll / 2) * math.cos(yaw / 2))
    mount = ((0.2, -0.1, 0.3), quaternion)
    count = 31
    increment = (angle_max - angle_min) / (count - 1)
    model = LaserModel.from_message(angle_min, angle_max, increment, count, 0.1, 10.0, mount)
    ranges = np.linspace(1.0, 3.0, count)
    found, wanted = ends_in_base(model, ranges), expected(angle_min, increment, ranges, mount)
    order = np.lexsort(np.round(found, 9)), np.lexsort(np.round(wanted, 9))
    assert np.allclose(found[:, order[0]], wanted[:, order[1]])
    assert (np.diff(model.angles) > 0).all() and abs(model.angles.sum()) < 1e-9


def test_thousands_of_beams_and_a_single_beam():
    model = LaserModel.from_message(-math.pi, math.pi, 2 * math.pi / 5000, 5000, 0.1, 30.0)
    assert model.reading(np.full(5000, 2.0)).points.shape == (2, 5000)
    assert LaserModel.from_message(0.0, 0.0, 0.0, 1, 0.1, 30.0).reading([3.0]).points[0, 0] == 3.0


def test_ranges_become_hits_clearing_beams_or_nothing():
    model = LaserModel.from_message(-0.3, 0.3, 0.1, 7, 0.2, 10.0, None, 8.0, 6.0)
    reading = model.reading([0.1, 1.0, 6.0, 7.0, 9.0, math.inf, math.nan])
    assert reading.points.shape[1] == 2                             # 1.0 and 6.0
    assert reading.rays.shape[1] == 3 and reading.ray_hits.tolist() == [True, False, False]
    assert np.allclose(np.hypot(*reading.rays), [1.0, 6.0, 6.0])    # a longer one clears as far as maxUrange


def test_default_max_range_is_1_cm_below_range_max():
    model = LaserModel.from_message(-0.1, 0.1, 0.1, 3, 0.2, 10.0)
    assert model.max_range == model.max_urange == pytest.approx(9.99)


def test_lskip_affects_matching_only():
    model = LaserModel.from_message(-0.4, 0.5, 0.1, 10, 0.1, 9.0)
    full, thin = model.reading(np.full(10, 2.0)), model.reading(np.full(10, 2.0), skip=2)
    assert thin.points.shape == full.points.shape
    assert np.allclose(thin.beams[:2], full.beams[:2, [2, 5, 8]])


def test_normals_of_walls_and_corners():
    model = LaserModel.from_message(-1.0, 1.0, 0.02, 101, 0.1, 20.0)
    wall = model.reading(3.0 / np.cos(model.angles))                # the line x = 3
    inside = wall.beams[:, 1:-1]                                      # the last ones have one neighbour only
    assert (np.abs(inside[2]) > 0.999).all() and (inside[6] < 0.1).all()
    lonely = model.reading(np.where(np.arange(101) % 2, 3.0, 6.0))
    assert (lonely.beams[6] == 1.0).all()


@pytest.mark.parametrize("change, words", [
    (dict(count=0), "no ranges"), (dict(angle_min=math.nan), "finite"),
    (dict(angle_increment=0.0), "angle_increment 0"), (dict(range_max=0.0), "range_max 0.0"),
    (dict(range_max=math.nan), "range_max nan"), (dict(range_max=-5.0), "maxRange"),
    (dict(range_min=9.5), "range_min 9.5"), (dict(max_range=0.0), "up to 0.0 m"),
    (dict(base_from_laser=((0, 0, 0), (0.0, math.sin(0.2), 0.0, math.cos(0.2)))), "tilted")])
def test_unusable_lasers_raise_an_error(change, words):
    fields = dict(angle_min=-1.0, angle_max=1.0, angle_increment=0.1, count=21, range_min=0.1, range_max=9.0)
    fields.update(change)
    with pytest.raises(ScanError, match=words):
        LaserModel.from_message(**fields)


@pytest.mark.parametrize("change", [dict(range_max=0.0, max_range=8.0), dict(range_min=math.nan), dict(range_min=-1.0),
                                    dict(count=1, angle_increment=0.0)])
def test_unusual_but_usable_lasers_are_accepted(change):
    fields = dict(angle_min=-1.0, angle_max=1.0, angle_increment=0.1, count=21, range_min=0.1, range_max=9.0)
    fields.update(change)
    model = LaserModel.from_message(**fields)
    assert model.reading(np.full(fields["count"], 3.0)).points.shape[1] == fields["count"]


def test_wrong_number_of_ranges_is_refused():
    with pytest.raises(ScanError, match="4 ranges; expected 3"):
        LaserModel.from_message(-0.1, 0.1, 0.1, 3, 0.1, 9.0).reading([1.0] * 4)


@pytest.mark.parametrize("range_max", [math.inf, 3.4e38, 1e9])
def test_infinite_range_max_leaves_beams_without_return(range_max):
    laser = LaserModel.from_message(-1.0, 1.0, 0.5, 5, 0.1, range_max)
    reading = laser.reading([2.0, math.inf, 0.0, range_max, 3.0])
    assert reading.points.shape[1] == 2 and reading.rays.shape[1] == 2
    assert np.isfinite(reading.points).all() and np.isfinite(reading.rays).all()
    assert LaserModel.from_message(-1.0, 1.0, 0.5, 5, 0.1, 30.0, max_urange=math.inf).max_urange <= 1000.0


def plain_take_in(ranges, directions, limits, skip, gap):
    """The same with sets of beams, one rule after the other."""
    low, instead, most, usable = limits
    ranges = np.where(np.isnan(ranges) | (ranges >= low), ranges, instead)
    seen = [b for b, r in enumerate(ranges) if 0.0 < r <= most]
    rays = [(min(ranges[b], usable) * directions[:, b]) for b in seen]
    groups = []
    for b in seen:
        end = ranges[b] * directions[:, b]
        if ranges[b] > usable:
            continue
        if groups and gap and np.square(end - groups[-1][0][0]).sum() < gap * gap:
            groups[-1][0].append(end)
        else:
            groups.append(([end], b in range(skip, len(ranges), skip + 1)))
    return [(np.mean(ends, axis=0), use) for ends, use in groups], rays, [ranges[b] < usable for b in seen]


@pytest.mark.parametrize("seed", range(6))
def test_range_classification_equals_reference(seed):
    rng = np.random.default_rng(seed)
    beams, skip, gap = int(rng.integers(1, 200)), int(rng.integers(0, 4)), float(rng.choice([0.0, 0.04, 0.5]))
    ranges = rng.choice([0.05, 3.0, 6.0, 9.0, 0.0, -1.0, math.inf, -math.inf, math.nan, 1e30], beams)
    ranges = np.where(rng.random(beams) < 0.7, rng.uniform(0.0, 10.0, beams), ranges)
    angles = np.linspace(-2.0, 2.0, beams)
    directions = np.stack([np.cos(angles), np.sin(angles)])
    limits = np.array([0.1, 10.0, 9.0, float(rng.choice([6, 20]))])
    points, used = np.empty((2, beams)), np.empty(beams, bool)
    rays, ray_hits = np.empty((2, beams), np.float32), np.empty(beams, bool)
    count, seen = classify_ranges(ranges, directions, limits, skip, gap, points, used, rays, ray_hits)
    wanted, wanted_rays, wanted_hits = plain_take_in(ranges, directions, limits, skip, gap)
    assert (count, seen) == (len(wanted), len(wanted_rays))
    np.testing.assert_allclose(points[:, :count].T.reshape(-1, 2), np.reshape([end for end, _ in wanted], (-1, 2)),
                               rtol=0.0, atol=1e-12)
    assert used[:count].tolist() == [use for _, use in wanted] and ray_hits[:seen].tolist() == wanted_hits
    np.testing.assert_allclose(rays[:, :seen].T.reshape(-1, 2), np.reshape(wanted_rays, (-1, 2)), rtol=1e-6)


def test_noise_does_not_rotate_a_dense_wall():
    model = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 719, 720, 0.1, 10.0, None, 8.0, 6.0)
    rng, turns = np.random.default_rng(0), []
    for _ in range(60):
        with np.errstate(divide="ignore"):
            ranges = 2.5 / np.maximum(np.sin(model.angles), 0.0) + 0.01 * rng.standard_normal(720)     # wall at y = 2.5
        x, y = model.reading(ranges, 0, 0.04).points
        turns.append(np.polyfit(x, y, 1)[0])
    assert abs(np.mean(turns)) < 1.2e-4 and np.sqrt(np.mean(np.square(turns))) < 3.3e-4       # rad


def test_slope_is_the_rise_along_the_centred_laser():
    def turned(roll, pitch, yaw):
        (cr, cp, cy), (sr, sp, sy) = np.cos([roll / 2, pitch / 2, yaw / 2]), np.sin([roll / 2, pitch / 2, yaw / 2])
        return np.array([sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                         cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy])

    ahead = LaserModel.from_message(-1.0, 1.0, 0.01, 201, 0.1, 10.0)
    assert ahead.slope(turned(0.0, 0.0, 2.0)) == pytest.approx([0.0, 0.0])
    assert ahead.slope(turned(0.0, 0.1, 2.0)) == pytest.approx([-math.sin(0.1), 0.0])       # nods: looks down ahead
    assert ahead.slope(3.0 * turned(0.2, 0.0, 2.0)) == pytest.approx([0.0, math.sin(0.2)])  # of any length
    left = LaserModel.from_message(0.5 * math.pi - 1.0, 0.5 * math.pi + 1.0, 0.01, 201, 0.1, 10.0)
    assert left.slope(turned(0.0, 0.1, 0.5)) == pytest.approx([0.0, math.sin(0.1)])         # ahead is on its right
    over = LaserModel.from_message(-1.0, 0.4, 0.01, 141, 0.1, 10.0, ((0, 0, 0), turned(math.pi, 0.0, 0.0)))
    rotated = turned(math.pi - 0.05, 0.08, 1.0)
    for x, y in ((3.0, 0.0), (0.0, 2.0), (-1.0, 4.0)):      # the same points, seen from the laser's own frame
        c, s = math.cos(over.centre), math.sin(over.centre)
        own = np.array([c * x + s * y, s * x - c * y, 0.0])
        assert np.dot(over.slope(rotated), (x, y)) == pytest.approx((rotation(rotated) @ own)[2])


@pytest.mark.parametrize("turn", np.linspace(-math.pi, math.pi, 17))
def test_normals_equal_reference_in_all_directions(turn):
    rng, c, s = np.random.default_rng(3), math.cos(turn), math.sin(turn)
    along = np.linspace(-0.2, 0.2, 7)
    points = np.array([[c, -s], [s, c]]) @ np.stack([along, rng.normal(0.0, 0.005, 7)]) + [[3.0], [1.0]]
    shape = np.empty((3, 7))
    surface_normals(points, 0.3, 4, math.inf, shape)
    for b in range(7):
        near = points[:, [k for k in range(7) if abs(k - b) <= 4 and np.hypot(*(points[:, k] - points[:, b])) <= 0.3]]
        sizes, axes = np.linalg.eigh(np.cov(near))
        assert abs(shape[:2, b] @ axes[:, 0]) == pytest.approx(1.0, abs=1e-9)
        assert np.hypot(*shape[:2, b]) == pytest.approx(1.0)
        spread = math.sqrt(sizes[0] / sizes[1])
        assert shape[2, b] == pytest.approx(min(1.0, max(0.0, (0.4 - spread) / 0.25)))


@pytest.mark.parametrize("points", [
    [[1.0, 1.1, 1.1, 1.0], [0.0, 0.0, 0.1, 0.1]], [[1.0, 1.1, 1.0, 0.9], [2.1, 2.0, 1.9, 2.0]],
    [[2.0, 2.0, 2.0], [1.0, 1.0, 1.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]], ids=["square", "cross", "one", "origin"])
def test_isotropic_points_inform_all_directions_alike(points):
    """A surface without a direction: whatever unit normal it gets, the error counts the same along it and across."""
    points = np.array(points)
    beams = np.full((mk.BEAM_ROWS, points.shape[1]), np.nan)
    with_normals(points, 0.3, 4, math.inf, 0.02, beams)
    for normal, along in zip(beams[mk.NX:mk.NY + 1].T, beams[mk.SLIDE]):
        tangent = np.array([-normal[1], normal[0]])
        assert np.allclose(np.outer(normal, normal) + along * np.outer(tangent, tangent), np.eye(2), atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2, 90])
def test_beams_have_normals_lever_arms_and_weights(count):
    points = np.random.default_rng(count).uniform(-2.0, 2.0, (2, count))
    beams, shape = np.full((mk.BEAM_ROWS, count), np.nan), np.empty((3, count))
    with_normals(points, 0.3, 4, math.inf, 0.02, beams)
    surface_normals(points, 0.3, 4, math.inf, shape)
    for b in range(count):
        normal, straightness = shape[:2, b], shape[2, b]
        tangent = np.array([-normal[1], normal[0]])
        turned = np.array([-points[1, b], points[0, b]])        # how the end point moves with the heading
        assert np.allclose(beams[:, b], [*points[:, b], *normal, normal @ turned, tangent @ turned,
                                         1.0 - 0.98 * straightness])


def test_sparse_wall_at_grazing_incidence_has_a_normal():
    model = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 180, 181, 0.05, 20.0)
    with np.errstate(divide="ignore"):
        wall = np.where(model.angles > 0.0, 1.2 / np.sin(model.angles), np.inf)
    beams = model.reading(np.where(wall < 7.0, wall, np.inf)).beams
    gaps = np.hypot(*np.diff(beams[mk.QX:mk.QY + 1], axis=1))
    assert gaps.max() > 0.35                            # beyond the reach of near neighbours
    inner = slice(1, -1)                                # the last point has no neighbour on one side
    assert np.allclose(np.abs(beams[mk.NY, inner]), 1.0, atol=1e-6) and beams[mk.SLIDE, inner].max() < 0.05


@pytest.mark.parametrize("limit", [5.0, 6.0, 7.5])
def test_wall_cut_by_maximum_range_is_no_post(limit):
    """Its last end point, with one neighbour, would hold every match where the robot was before."""
    model = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 180, 181, 0.05, 20.0, max_urange=limit)
    with np.errstate(divide="ignore"):
        wall = np.where(model.angles > 0.0, 1.2 / np.sin(model.angles), np.inf)
    beams = model.reading(wall).beams
    assert np.hypot(*beams[:2, 0]) > 0.85 * limit and np.allclose(np.abs(beams[mk.NY]), 1.0, atol=1e-6)
    assert beams[mk.SLIDE, 0] < 0.05
    post = np.where(np.abs(model.angles - 0.3) < 0.01, 2.0, np.inf)         # nor is a post a wall
    post[np.flatnonzero(np.isfinite(post))[0] + 1] = 2.0
    assert (model.reading(post).beams[mk.SLIDE] == 1.0).all()


@pytest.mark.parametrize("last_is_angle_max", [True, False])
@pytest.mark.parametrize("count", [181, 360])
def test_each_beam_keeps_its_angle(count, last_is_angle_max):
    step = math.radians(1.0)
    laser = LaserModel.from_message(-0.5 * math.pi, -0.5 * math.pi + step * (count - last_is_angle_max), step, count,
                                    0.1, 10.0)
    angles = -0.5 * math.pi + step * np.arange(count)
    reading = laser.reading(np.full(count, 2.0))
    turn = laser.sensor_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))[2]
    c, s = math.cos(turn), math.sin(turn)
    right = 2.0 * np.stack([np.cos(angles), np.sin(angles)])
    for ends in (reading.points, reading.beams[:2], reading.rays):
        np.testing.assert_allclose(np.array([[c, -s], [s, c]]) @ ends, right, atol=1e-6)


def test_invalid_ranges_are_ignored(ring, laser):
    ranges = ring.ranges(drive(0.1)[0], laser.angles)
    whole = laser.reading(ranges)
    for value in (0.0, -1.0, math.nan, math.inf, -math.inf, 1e30):
        few = ranges.copy()
        few[10:20] = value
        reading = laser.reading(few)
        kept = np.r_[0:10, 20:181]
        assert reading.points.shape[1] == reading.beams.shape[1] == 171
        np.testing.assert_array_equal(reading.points, whole.points[:, kept])
        assert np.isfinite(reading.beams).all()
        # free space is cleared, if at all, to the end of the laser's reach: nothing was there
        assert reading.rays.shape[1] - 171 in (0, 10)
        assert reading.ray_hits.sum() == 171


@pytest.mark.parametrize("skip", [0, 1])
@pytest.mark.parametrize("slope", [None, (0.1, 0.0)])
def test_beams_of_a_stored_scan_are_as_before(skip, slope):
    """They are computed again if all of its end points are known."""
    laser = LaserModel.from_message(-1.5, 1.5, 0.01, 301, 0.1, 10.0)
    reading = laser.reading(np.random.default_rng(1).uniform(1.0, 12.0, 301), skip, 0.04)
    if slope is not None:
        reading = reading.level_part(slope, 0.3)
    before = reading.beams.copy()
    reading.compact()
    assert np.array_equal(reading.beams, before) and before.shape[1] > 20
    assert (reading._beams is None) == (skip == 0 and slope is None)
