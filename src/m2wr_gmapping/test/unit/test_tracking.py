# SPDX-License-Identifier: BSD-3-Clause
"""How far odometry is trusted, and what is believed where it contradicts the scan."""
import numpy as np
import pytest

from m2wr_gmapping.filter.motion_model import MotionNoise
from m2wr_gmapping.frontend import odometry_kernels as ok
from m2wr_gmapping.frontend import track_layout as tl
from m2wr_gmapping.frontend.tracking import new_track
from m2wr_gmapping.se2 import between, compose, inverse

NOISE = MotionNoise(0.01, 0.02, 0.01, 0.02)


def deviations(track, distance, turn):
    """Of odometry along, across and of the heading, after a way with turns."""
    return np.sqrt(ok.odometry_variances(track, distance, turn))


def teach(track, error, variance, distance, turn):
    ok.update_noise_scales(track, tuple(error), tuple(variance), distance, turn)


WAYS = (0.5, 0.0), (0.0, 0.4)       # straight ahead, and on the spot [m], [rad]


def taught(true_scale, scan=0.002, steps=300):
    """The scales after odometry was seen to err ``true_scale`` times what the noise says, by scans that do ``scan``.

    ``true_scale`` is that of straight ways and that of turns on the spot, in turn; the result (2, 2) as in ``track``.
    """
    rng, track = np.random.default_rng(3), new_track(NOISE)
    real = [deviations(track, *way) for way in WAYS]
    for k in range(steps):
        way = WAYS[k % 2]
        prior, noise = np.square(deviations(track, *way)), scan * scan
        seen = rng.normal(0.0, np.broadcast_to(true_scale, 2)[k % 2] * real[k % 2]) + rng.normal(0.0, scan, 3)
        gain = prior / (prior + noise)
        teach(track, gain * seen, gain * noise, *way)
    return track[tl.SCALE:tl.SCALE_EVIDENCE, :2].copy()


@pytest.mark.parametrize("true_scale", [0.3, 1.0, 4.0])
def test_noise_scale_converges_to_the_actual_noise(true_scale):
    assert taught(true_scale)[:, 0] == pytest.approx(np.full(2, true_scale), rel=0.4)
    assert taught(true_scale)[1, 1] == pytest.approx(true_scale, rel=0.4)


def test_distance_and_rotation_have_separate_scales():
    scale = taught((0.1, 4.0))
    assert scale[1, 1] > 2.0 and scale[1, 0] < 0.5 and scale[0, 0] < 0.5


def test_rotation_scale_starts_with_the_distance_scale():
    track, sure = new_track(NOISE), np.square([0.003, 0.003, 0.002])
    for _ in range(6):
        teach(track, np.zeros(3), sure, 0.5, 0.0)
    way, heading = track[tl.SCALE:tl.SCALE_EVIDENCE, :2]
    assert way[0] < 0.5 and way[0] < way[1] < 0.8 and heading[0] < 0.7 and heading[1] == 1.0


def test_noise_scale_is_bounded():
    exact, wild = taught(0.0), taught(1000.0)
    assert (exact >= tl.MIN_SCALE).all() and (exact[:, 0] < 0.15).all()
    assert (wild <= tl.MAX_SCALE).all() and (wild[:, 0] > 10.0).all()


def test_uninformative_scan_changes_no_estimate():
    track = new_track(NOISE)
    for _ in range(50):
        teach(track, np.zeros(3), np.square(deviations(track, 0.5, 0.0)), 0.5, 0.0)
    assert (track[tl.SCALE:tl.SCALE_EVIDENCE, :2] == 1.0).all()


def test_deviations_grow_with_distance_from_user_values():
    track = new_track(NOISE)
    near, far = deviations(track, 0.1, 0.0), deviations(track, 10.0, 3.0)
    assert (near < far).all()
    assert far[0] == pytest.approx(0.01 * 10.0 + 0.01 * 3.0, rel=0.5) and far[2] == pytest.approx(0.26, rel=0.5)


@pytest.mark.parametrize("ahead", [(1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.6, 0.8)])
def test_systematic_odometry_error_is_estimated(ahead):
    rng, track = np.random.default_rng(4), new_track(NOISE, ahead)
    variance, lacks = (1e-4, 1e-4, 1e-4), np.array([-0.02, 0.015, 0.012])
    for k in range(1500):
        way, turn = rng.uniform(0.2, 0.5) * (-1.0 if k % 5 == 0 else 1.0), rng.normal(0.0, 0.3)
        step = np.array([way * ahead[0], way * ahead[1], turn])
        right = np.array([*step[:2] * (1.0 + lacks[0]), turn * (1.0 + lacks[1]) + lacks[2] * way])
        error = between(ok.corrected(track, *step)[:3], right) + rng.normal(0.0, 0.002, 3)
        ok.update_bias(track, tuple(error), variance, (0.9, 0.9, 0.9), way, turn)
    assert track[tl.BIAS] == pytest.approx(lacks, abs=0.004)


@pytest.mark.parametrize("ahead", [(1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.6, 0.8)])
@pytest.mark.parametrize("off", [0.05, -0.12])
def test_centre_of_rotation_is_estimated_by_turning(ahead, off):
    """Wheels tell of the middle of the axle; published as the base frame's, it goes round what it should be."""
    rng, track = np.random.default_rng(5), new_track(NOISE, ahead)
    point = np.array([off * ahead[0], off * ahead[1], 0.0])
    for _ in range(400):
        way, turn = rng.choice([0.0, 0.3]), rng.normal(0.0, 0.3)
        step = np.array([way * ahead[0], way * ahead[1], turn])
        right = compose(inverse(point), compose(step, point))
        error = np.array(between(ok.corrected(track, *step)[:3], right)) + rng.normal(0.0, 0.002, 3)
        ok.update_bias(track, tuple(error), (1e-4, 1e-4, 1e-4), (0.9, 0.9, 0.9), way, turn)
    assert track[tl.CENTRE, 0] == pytest.approx(off, abs=0.01) and track[tl.CENTRE, 1] < 1e-4
    assert np.abs(track[tl.BIAS]).max() < 0.01


def test_uninformative_scans_and_outliers_change_no_bias():
    track, variance = new_track(NOISE), (1e-4, 1e-4, 1e-4)
    for _ in range(50):
        ok.update_bias(track, (0.05, 0.05, 0.05), variance, (0.05, 0.05, 0.05), 0.5, 0.1)
        ok.update_bias(track, (0.8, 0.8, 0.8), variance, (0.9, 0.9, 0.9), 0.5, 0.1)
    assert (track[tl.BIAS] == 0.0).all() and track[tl.CENTRE, 0] == 0.0


def slipped(mapped, ring, laser, jump, looks, then=0.05):
    """A mapper after a drive, then ``looks`` scans ``jump`` (3,) from where odometry has them; and both last poses."""
    mapper, truth, odom = mapped(laps=0.4, noise=0.0, slip=0.0)
    at, wheels = compose(truth[-1], jump), odom[-1]
    for k in range(looks):
        at, wheels = compose(at, [then, 0.0, 0.0]), compose(wheels, [then, 0.0, 0.0])
        update = mapper.process(mapper.reading(ring.ranges(at, laser.angles)), wheels, 100.0 + 0.1 * k)
    origin = mapper.trajectory()[1][0]
    return mapper, between(between(truth[0], at), between(origin, update.pose))


def test_persistent_slip_is_tracked(mapped, ring, laser):
    mapper, error = slipped(mapped, ring, laser, [0.0, 0.0, 0.25], 8)
    assert np.abs(error).max() < 0.05 and not mapper._tracker.undecided
    mapper.close()


@pytest.mark.parametrize("told", [0.0, 0.25, 0.5])
def test_continuous_slip_in_a_turn_is_tracked(mapped, ring, laser, told):
    mapper, truth, odom = mapped(laps=0.4, noise=0.0, slip=0.0)
    at, wheels = truth[-1], odom[-1]
    for k in range(8):              # a turn of which odometry knows only a part
        at, wheels = compose(at, [0.03, 0.0, 0.2]), compose(wheels, [0.03, 0.0, 0.2 * told])
        mapper.process(mapper.reading(ring.ranges(at, laser.angles)), wheels, 100.0 + 0.1 * k)
    for k in range(10):
        at, wheels = compose(at, [0.05, 0.0, 0.0]), compose(wheels, [0.05, 0.0, 0.0])
        update = mapper.process(mapper.reading(ring.ranges(at, laser.angles)), wheels, 110.0 + 0.1 * k)
    origin = mapper.trajectory()[1][0]
    assert np.abs(between(between(truth[0], at), between(origin, update.pose))).max() < 0.05
    mapper.close()


def test_brief_contradiction_is_not_processed(mapped, ring, laser):
    mapper, truth, odom = mapped(laps=0.4, noise=0.0, slip=0.0)
    processed = mapper.processed
    aside = compose(truth[-1], [0.0, 0.0, 0.25])
    wheels = compose(odom[-1], [0.02, 0.0, 0.0])
    update = mapper.process(mapper.reading(ring.ranges(aside, laser.angles)), wheels, 100.0)
    assert not update.processed and mapper._tracker.undecided and mapper.processed == processed
    for k in range(1, 4):           # and is forgotten when it has passed
        at, wheels = compose(truth[-1], [0.02 + 0.05 * k, 0.0, 0.0]), compose(wheels, [0.05, 0.0, 0.0])
        update = mapper.process(mapper.reading(ring.ranges(at, laser.angles)), wheels, 100.0 + k)
    assert not mapper._tracker.undecided
    origin = mapper.trajectory()[1][0]
    assert np.abs(between(between(truth[0], at), between(origin, update.pose))).max() < 0.05
    mapper.close()


def test_plain_wall_leaves_its_direction_to_odometry(laser):
    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.mapper import Mapper
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=4, linearUpdate=0.3, maxUrange=4.0)), laser)
    rng = np.random.default_rng(2)
    with np.errstate(divide="ignore"):
        wall = np.where(laser.angles > 0.0, 1.0 / np.sin(laser.angles), np.inf)     # 1 m to the left, without end
    for k in range(400):
        ranges = wall + rng.normal(0.0, 0.01, len(wall))
        mapper.process(mapper.reading(ranges), np.array([0.05 * k, 0.0, 0.0]), 0.1 * k)
    assert mapper.pose == pytest.approx([19.95, 0.0, 0.0], abs=0.06)
    mapper.close()


def test_trust_in_odometry_adapts_within_a_few_steps():
    track, sure = new_track(MotionNoise()), np.square([0.003, 0.003, 0.002])
    before = deviations(track, 1.0, 0.0)
    for _ in range(6):
        teach(track, np.zeros(3), sure, 1.0, 0.0)
    believed = deviations(track, 1.0, 0.0)
    assert (believed < 0.45 * before).all()
    for _ in range(6):
        teach(track, 2.0 * before, sure, 1.0, 0.0)
    assert (deviations(track, 1.0, 0.0) > 2.0 * believed).all()


def walls(pose, angles, x=(-3.0, 5.0), y=(-3.0, 4.0)):
    """Distances (B,) to the walls of a room, from inside."""
    c, s = np.cos(pose[2] + angles), np.sin(pose[2] + angles)
    with np.errstate(divide="ignore"):
        ways = [np.where(part * (end - at) > 0.0, (end - at) / part, np.inf)
                for part, at, ends in ((c, pose[0], x), (s, pose[1], y)) for end in ends]
    return np.minimum.reduce(ways)


def driven(laser, steps, told, room):
    """A mapper after steps (K, 3), of which odometry tells as ``told`` (K, 3), in a room; and the true last pose."""
    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.mapper import Mapper
    mapper = Mapper(GmappingConfig.from_mapping(dict(
        particles=4, maxUrange=6.0, srr=0.01, srt=0.02, str=0.01, stt=0.02, linearUpdate=0.5, angularUpdate=0.436)),
        laser)
    rng, at, wheels = np.random.default_rng(2), np.zeros(3), np.zeros(3)
    for k in range(len(steps) + 1):
        ranges = walls(at, laser.angles, *room) + rng.normal(0.0, 0.01, len(laser.angles))
        mapper.process(mapper.reading(ranges), wheels, 0.1 * k)
        if k < len(steps):
            at, wheels = compose(at, steps[k]), compose(wheels, told[k])
    mapper.finish()
    return mapper, at


def test_exact_straight_driving_does_not_constrain_first_turn(laser):
    """Trust that straight ways have earned is none in the scale of turns."""
    steps = [[0.05, 0.0, 0.0]] * 60 + [[0.0, 0.0, 0.05]] * 32
    told = [[x, y, 0.98 * turn] for x, y, turn in steps]
    mapper, truth = driven(laser, steps, told, ((-3.0, 7.0), (-3.0, 4.0)))
    error = between(truth, mapper.pose)
    assert abs(error[2]) < 0.004 and np.hypot(error[0], error[1]) < 0.02
    mapper.close()


def test_turn_at_a_long_wall_is_corrected_later(laser):
    """The place along the wall cannot be seen while odometry goes round the wrong point; a corner tells of it later."""
    told = ([[0.0, 0.0, 0.05]] * 63 + [[0.05, 0.0, 0.0]] * 150 + [[0.0, 0.0, -0.05]] * 60 + [[0.0, 0.0, 0.05]] * 60)
    base = np.array([0.05, 0.0, 0.0])               # ahead of the axle, about which wheels tell
    steps = [compose(inverse(base), compose(step, base)) for step in told]
    mapper, truth = driven(laser, steps, told, ((-12.0, 20.0), (-9.0, 2.0)))
    assert mapper._tracker.centre == pytest.approx(0.05, abs=0.015)
    assert abs(between(truth, mapper.pose)[0]) < 0.035      # along the wall; 0.055 if it is not told
    mapper.close()
