"""How far odometry is trusted, and what is believed where it contradicts the scan."""
import numpy as np
import pytest

from m2wr_gmapping.motion_model import MotionNoise
from m2wr_gmapping.odometry_trust import NARROWEST, WIDEST, OdometryBias, OdometryTrust
from m2wr_gmapping.se2 import between, compose

NOISE = MotionNoise(0.01, 0.02, 0.01, 0.02)


def taught(true_scale, scan=0.002, steps=300):
    """A trust that has seen odometry err ``true_scale`` times what the noise says, by scans that err by ``scan``."""
    rng, trust = np.random.default_rng(3), OdometryTrust(NOISE)
    real, _ = OdometryTrust(NOISE)._parts(0.5, 0.2)
    for _ in range(steps):
        prior, noise = np.square(trust.deviations(0.5, 0.2)), scan * scan
        seen = rng.normal(0.0, true_scale * real) + rng.normal(0.0, scan, 3)
        gain = prior / (prior + noise)
        trust.learn(gain * seen, gain * noise, 0.5, 0.2)
    return trust


@pytest.mark.parametrize("true_scale", [0.3, 1.0, 4.0])
def test_the_scale_becomes_what_odometry_is_like(true_scale):
    assert taught(true_scale).scale == pytest.approx(np.full(2, true_scale), rel=0.4)


def test_the_scale_stays_within_its_bounds():
    assert (taught(0.0).scale >= NARROWEST).all() and (taught(0.0).scale < 0.15).all()
    assert (taught(1000.0).scale <= WIDEST).all() and (taught(1000.0).scale > 10.0).all()


def test_a_scan_that_says_nothing_teaches_nothing():
    trust = OdometryTrust(NOISE)
    for _ in range(50):
        trust.learn(np.zeros(3), np.square(trust.deviations(0.5, 0.0)), 0.5, 0.0)
    assert (trust.scale == 1.0).all()


def test_deviations_grow_with_the_way_and_are_the_user_s_at_first():
    trust = OdometryTrust(NOISE)
    near, far = trust.deviations(0.1, 0.0), trust.deviations(10.0, 3.0)
    assert (near < far).all()
    assert far[0] == pytest.approx(0.01 * 10.0 + 0.01 * 3.0, rel=0.5) and far[2] == pytest.approx(0.26, rel=0.5)


@pytest.mark.parametrize("ahead", [(1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.6, 0.8)])
def test_what_wheels_err_by_all_the_time_is_learnt(ahead):
    rng, bias = np.random.default_rng(4), OdometryBias(ahead)
    variance, lacks = np.square([0.01, 0.01, 0.01]), np.array([-0.02, 0.015, 0.012])
    for k in range(1500):
        way, turn = rng.uniform(0.2, 0.5) * (-1.0 if k % 5 == 0 else 1.0), rng.normal(0.0, 0.3)
        step = np.array([way * ahead[0], way * ahead[1], turn])
        right = np.array([*step[:2] * (1.0 + lacks[0]), turn * (1.0 + lacks[1]) + lacks[2] * way])
        error = between(bias.corrected(step), right) + rng.normal(0.0, 0.002, 3)
        bias.learn(error, variance, np.full(3, 0.9), way, turn)
    assert bias.bias == pytest.approx(lacks, abs=0.004)


def test_a_scan_that_says_little_and_an_error_of_another_kind_teach_no_bias():
    bias = OdometryBias((1.0, 0.0))
    for _ in range(50):
        bias.learn(np.full(3, 0.05), np.full(3, 1e-4), np.full(3, 0.05), 0.5, 0.1)
        bias.learn(np.full(3, 0.8), np.full(3, 1e-4), np.full(3, 0.9), 0.5, 0.1)
    assert (bias.bias == 0.0).all()


def slipped(mapped, ring, laser, jump, looks, then=0.05):
    """A mapper after a drive, then ``looks`` scans ``jump`` (3,) from where odometry has them; and both last poses."""
    mapper, truth, odom = mapped(laps=0.4, noise=0.0, slip=0.0)
    at, wheels = compose(truth[-1], jump), odom[-1]
    for k in range(looks):
        at, wheels = compose(at, [then, 0.0, 0.0]), compose(wheels, [then, 0.0, 0.0])
        update = mapper.process(mapper.reading(ring.ranges(at, laser.angles)), wheels, 100.0 + 0.1 * k)
    origin = mapper.trajectory()[1][0]
    return mapper, between(between(truth[0], at), between(origin, update.pose))


def test_a_slip_that_stays_is_followed(mapped, ring, laser):
    mapper, error = slipped(mapped, ring, laser, [0.0, 0.0, 0.25], 8)
    assert np.abs(error).max() < 0.05 and not mapper._tracker.undecided
    mapper.close()


def test_a_scan_that_contradicts_odometry_for_a_moment_is_not_processed(mapped, ring, laser):
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


def test_a_wall_alone_leaves_the_way_along_it_to_odometry(laser):
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


def test_exact_odometry_is_believed_after_a_few_steps_and_doubted_again_when_it_errs():
    trust = OdometryTrust(MotionNoise())
    before = trust.deviations(1.0, 0.0)
    for _ in range(6):
        trust.learn(np.zeros(3), np.square([0.003, 0.003, 0.002]), 1.0, 0.0)
    believed = trust.deviations(1.0, 0.0)
    assert (believed < 0.45 * before).all()
    for _ in range(6):
        trust.learn(2.0 * before, np.square([0.003, 0.003, 0.002]), 1.0, 0.0)
    assert (trust.deviations(1.0, 0.0) > 2.0 * believed).all()
