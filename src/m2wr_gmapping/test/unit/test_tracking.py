# SPDX-License-Identifier: BSD-3-Clause
"""How far odometry is trusted, and what is believed where it contradicts the scan."""
import math

import numpy as np
import pytest

from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend import odometry_kernels as ok
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.mapper import Mapper, continued_turn
from m2wr_maps.se2 import between, compose, inverse

NOISE = np.array([[0.01, 0.01], [0.02, 0.02]])


def noise_of(parameters=NOISE):
    return tr.noise_of(tr.new_noise(parameters))


def test_noise_follows_the_step():
    user = np.array([[0.1, 0.3], [0.2, 0.4]])
    assert np.allclose(ok.user_noise(user, 1.0, 0.0, 0.0), [0.1, 0.03, 0.2])
    assert np.allclose(ok.user_noise(user, 0.0, 0.0, -2.0), [0.6, 0.6, 0.8])
    assert np.allclose(ok.user_noise(user, 0.0, 0.0, 0.0), 0.0)


def deviations(noise, distance, turn):
    """Of odometry along, across and of the heading, after a way with turns."""
    return np.sqrt(ok.odometry_variances(noise, distance, turn))


def teach(noise, error, variance, distance, turn):
    ok.update_noise_scales(noise, tuple(error), tuple(variance), distance, turn)


WAYS = (0.5, 0.0), (0.0, 0.4)       # straight ahead, and on the spot [m], [rad]


def taught(true_scale, scan=0.002, steps=300):
    """The scales after odometry was seen to err ``true_scale`` times what the noise says, by scans that do ``scan``.

    ``true_scale`` is that of straight ways and that of turns on the spot, in turn; the result (2, 2) as in ``Noise``.
    """
    rng, noise = np.random.default_rng(3), noise_of()
    real = [deviations(noise, *way) for way in WAYS]
    for k in range(steps):
        way = WAYS[k % 2]
        prior, seen_by = np.square(deviations(noise, *way)), scan * scan
        seen = rng.normal(0.0, np.broadcast_to(true_scale, 2)[k % 2] * real[k % 2]) + rng.normal(0.0, scan, 3)
        gain = prior / (prior + seen_by)
        teach(noise, gain * seen, gain * seen_by, *way)
    return noise.scale.copy()


@pytest.mark.parametrize("true_scale", [0.3, 1.0, 4.0])
def test_noise_scale_converges_to_the_actual_noise(true_scale):
    assert taught(true_scale)[:, 0] == pytest.approx(np.full(2, true_scale), rel=0.4)
    assert taught(true_scale)[1, 1] == pytest.approx(true_scale, rel=0.4)


def test_distance_and_rotation_have_separate_scales():
    scale = taught((0.1, 4.0))
    assert scale[1, 1] > 2.0 and scale[1, 0] < 0.5 and scale[0, 0] < 0.5


def test_rotation_scale_starts_with_the_distance_scale():
    noise, sure = noise_of(), np.square([0.003, 0.003, 0.002])
    for _ in range(6):
        teach(noise, np.zeros(3), sure, 0.5, 0.0)
    way, heading = noise.scale
    assert way[0] < 0.5 and way[0] < way[1] < 0.8 and heading[0] < 0.7 and heading[1] == 1.0


def test_noise_scale_is_bounded():
    exact, wild = taught(0.0), taught(1000.0)
    assert (exact >= ok.MIN_SCALE).all() and (exact[:, 0] < 0.15).all()
    assert (wild <= ok.MAX_SCALE).all() and (wild[:, 0] > 10.0).all()


def test_uninformative_scan_changes_no_estimate():
    noise = noise_of()
    for _ in range(50):
        teach(noise, np.zeros(3), np.square(deviations(noise, 0.5, 0.0)), 0.5, 0.0)
    assert (noise.scale == 1.0).all()


def test_deviations_grow_with_distance_from_user_values():
    noise = noise_of()
    near, far = deviations(noise, 0.1, 0.0), deviations(noise, 10.0, 3.0)
    assert (near < far).all()
    assert far[0] == pytest.approx(0.01 * 10.0 + 0.01 * 3.0, rel=0.5) and far[2] == pytest.approx(0.26, rel=0.5)


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
    noise, sure = noise_of(GmappingConfig.from_mapping({}).noise), np.square([0.003, 0.003, 0.002])
    before = deviations(noise, 1.0, 0.0)
    for _ in range(6):
        teach(noise, np.zeros(3), sure, 1.0, 0.0)
    believed = deviations(noise, 1.0, 0.0)
    assert (believed < 0.45 * before).all()
    for _ in range(6):
        teach(noise, 2.0 * before, sure, 1.0, 0.0)
    assert (deviations(noise, 1.0, 0.0) > 2.0 * believed).all()


def walls(pose, angles, x=(-3.0, 5.0), y=(-3.0, 4.0)):
    """Distances (B,) to the walls of a room, from inside."""
    c, s = np.cos(pose[2] + angles), np.sin(pose[2] + angles)
    with np.errstate(divide="ignore"):
        ways = [np.where(part * (end - at) > 0.0, (end - at) / part, np.inf)
                for part, at, ends in ((c, pose[0], x), (s, pose[1], y)) for end in ends]
    return np.minimum.reduce(ways)


def driven(laser, steps, told, room):
    """A mapper after steps (K, 3), of which odometry tells as ``told`` (K, 3), in a room; and the true last pose."""
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
    assert mapper.calibration()["laser_x"] == pytest.approx(0.05, abs=0.015)
    assert abs(between(truth, mapper.pose)[0]) < 0.035      # along the wall; 0.055 if it is not told
    mapper.close()


# ---- wheels that tell nothing of a turn


HALL = np.array([(-4.0, -3.0, 5.0, -3.0), (5.0, -3.0, 5.0, 2.0), (5.0, 2.0, 2.0, 2.0), (2.0, 2.0, 2.0, 4.0),
                 (2.0, 4.0, -4.0, 4.0), (-4.0, 4.0, -4.0, -3.0), (-4.0, 1.0, -3.0, 1.0), (1.0, -3.0, 1.0, -2.2)])


def hall_ranges(pose, angles, segments=HALL):
    """Distances (B,) to the walls (S, 4) of a hall that looks the same in no two directions."""
    dx, dy = np.cos(pose[2] + angles)[:, None], np.sin(pose[2] + angles)[:, None]
    x0, y0, x1, y1 = (segments - np.tile(pose[:2], 2)).T
    ex, ey = x1 - x0, y1 - y0
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        along, part = (x0 * ey - y0 * ex) / cross, (x0 * dy - y0 * dx) / cross
    return np.where((along > 0) & (part >= 0) & (part <= 1), along, np.inf).min(axis=1)


def run(laser, truth, odom, segments=HALL, seed=2, period=0.1, **parameters):
    """A mapper after scans at the true poses (K, 3), with the poses (K, 3) of odometry."""
    mapper = Mapper(GmappingConfig.from_mapping(dict(dict(
        particles=4, maxUrange=10.0, linearUpdate=0.4, angularUpdate=0.4), **parameters)), laser)
    rng = np.random.default_rng(seed)
    for k, (pose, wheels) in enumerate(zip(truth, odom)):
        ranges = hall_ranges(pose, laser.angles, segments) + rng.normal(0.0, 0.01, len(laser.angles))
        mapper.process(mapper.reading(ranges), wheels, period * k)
    return mapper


def path_along(steps, start=(0.0, 0.0, 0.0)):
    poses = [np.array(start)]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


@pytest.mark.parametrize("degrees", [100, -130, 160, 180])
def test_robot_turned_without_odometry_is_found_again(laser, degrees):
    """It has seen the hall in a turn on the spot; then it is turned, stands for two seconds, and drives on."""
    told = [[0.0, 0.0, math.radians(10)]] * 36 + [[0.0, 0.0, 0.0]] * 6 + [[0.05, 0.0, 0.0]] * 12
    steps = [list(step) for step in told]
    steps[36][2] = math.radians(degrees)
    truth = path_along(steps)
    mapper = run(laser, truth, path_along(told), period=0.3)
    error = between(truth[-1], mapper.pose)
    assert np.hypot(error[0], error[1]) < 0.05 and abs(error[2]) < 0.02
    mapper.close()


@pytest.mark.parametrize("beams, agrees", [(15, False), (180, True)])
def test_few_beams_do_not_show_that_the_robot_was_not_turned(laser, beams, agrees):
    """The wheels are at rest. Until enough of the hall is seen again, a person may have turned the robot."""
    told = path_along([[0.0, 0.0, math.radians(10)]] * 36 + [[0.0, 0.0, 0.02]] * 4)
    mapper = run(laser, told[:-3], told[:-3], period=0.3)
    for k in (-3, -2, -1):
        ranges = hall_ranges(told[k], laser.angles)
        ranges[beams:] = np.inf
        mapper.process(mapper.reading(ranges), told[k], 0.3 * (len(told) + k))
    assert mapper._tracker.agrees == agrees and (mapper._standstill.unexplained == 0.0) == agrees
    mapper.close()


@pytest.mark.parametrize("turn, expected, right", [
    (-178.0, 180.0, 182.0), (178.0, -180.0, -182.0), (178.0, 180.0, 178.0), (-100.0, 120.0, 260.0),
    (5.0, 2190.0, 5.0), (-5.0, 2190.0, -5.0), (-178.0, 20.0, -178.0), (-178.0, 0.0, -178.0)])
def test_turn_of_more_than_half_a_turn_is_continued(turn, expected, right):
    found = continued_turn(math.radians(turn), math.radians(expected))
    assert math.degrees(found) == pytest.approx(right)


def test_disagreement_is_remembered_until_a_scan_is_processed(laser):
    """A scan fits nothing after a second of rest; the next ones do. The robot may have been turned in between."""
    told = path_along([[0.0, 0.0, math.radians(10)]] * 36 + [[0.0, 0.0, 0.0]])
    mapper, processed = run(laser, told, told, period=0.3), []
    for k, fits in enumerate((False, True, True)):
        told_now = compose(told[-1], [0.0, 0.0, 0.3 * (k + 1)])
        ranges = hall_ranges(told_now, laser.angles)
        if not fits:
            ranges = 1.5 + 0.4 * np.random.default_rng(1).random(len(laser.angles))
        processed.append(mapper.process(mapper.reading(ranges), told_now, 0.3 * len(told) + 1.0 + 0.3 * k).processed)
        assert mapper._tracker.is_doubtful == (not any(processed))
    assert processed[0] is False and any(processed)
    mapper.close()


def test_rate_of_rotation_is_known_from_the_second_scan_on(laser):
    """Stamps are those of the day; a reset of odometry ends the motion that was known."""
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=4, maxUrange=10.0)), laser)
    for k, pose in enumerate(path_along([[0.0, 0.0, 0.1]] * 2)):
        mapper.process(mapper.reading(hall_ranges(pose, laser.angles)), pose, 1.7e9 + 0.5 * k)
        assert mapper._rate == pytest.approx(0.2 if k else 0.0)
    mapper.reset_odometry(np.zeros(3))
    assert mapper._rate == 0.0
    mapper.close()


def test_scan_without_beams_decides_nothing_and_does_not_wait(laser):
    """Else a robot that no longer sees a wall would not process a scan until it sees one."""
    still = path_along([[0.0, 0.0, 0.0]] * 3)
    mapper = run(laser, still, still)
    mapper._tracker._waits = True
    mapper.process(mapper.reading(np.full(len(laser.angles), np.inf)), np.array([0.5, 0.0, 0.0]), 1.0)
    assert mapper.processed == 2 and not mapper._tracker.undecided and not mapper._tracker.agrees
    mapper.close()


def test_wrong_scale_of_odometry_in_a_turn_without_scans(laser):
    """Odometry tells 30 % too much of each turn. After 2 s without scans its heading is that of a turn back."""
    turns = [10.0] * 72 + [140.0] + [10.0] * 10
    truth = path_along([[0.0, 0.0, math.radians(turn)] for turn in turns])
    odom = path_along([[0.0, 0.0, math.radians(1.3 * turn)] for turn in turns])
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=4, maxUrange=10.0, linearUpdate=0.4,
                                                     angularUpdate=0.4)), laser)
    stamp, rng = 0.0, np.random.default_rng(3)
    for k, (pose, wheels) in enumerate(zip(truth, odom)):
        stamp += 0.01 * turns[k - 1] if k else 0.0
        mapper.process(mapper.reading(hall_ranges(pose, laser.angles) + rng.normal(0.0, 0.01, len(laser.angles))),
                       wheels, stamp)
    assert mapper._rate == pytest.approx(math.radians(1300.0 / 10.0), rel=0.01)
    error = between(truth[-1], mapper.pose)
    assert np.hypot(error[0], error[1]) < 0.05 and abs(error[2]) < 0.02
    mapper.close()


@pytest.mark.parametrize("door", [0.4, 0.6])
def test_robot_in_unknown_area_is_not_turned(laser, door):
    """It goes by a door to a room that equals the known one turned by 180 degrees."""
    room = np.array([(0.0, door, -0.1, door), (-0.1, door, -0.1, 3.0), (-0.1, 3.0, -4.0, 3.0), (-4.0, 3.0, -4.0, -2.0),
                     (-4.0, -2.0, -0.1, -2.0), (-0.1, -2.0, -0.1, -door), (-0.1, -door, 0.0, -door),
                     (-3.0, 1.5, -3.0, 2.0), (-1.5, -2.0, -1.5, -1.4)])
    steps = [[0.0, 0.0, math.radians(10)]] * 36 + [[0.2, 0.0, 0.0]] * 20
    truth = path_along(steps, (-2.0, 0.0, 0.0))
    mapper = run(laser, truth, truth, np.concatenate([room, -room]))
    error = between(truth[-1], mapper.pose)
    assert np.hypot(error[0], error[1]) < 0.05 and abs(error[2]) < 0.02
    mapper.close()


# ---- what is known about odometry and mount


def star(legs=40):
    """Steps of straight legs through the hall, with turns on the spot to both sides between them."""
    steps = []
    for k in range(legs):
        turn = math.radians(135.0 if k % 10 < 5 else -135.0)
        steps += [[0.1, 0.0, 0.0]] * 20 + [[0.0, 0.0, turn / 8]] * 8
    return steps


@pytest.mark.parametrize("yaw, shift", [(2.0, 0.05), (-1.0, -0.05), (0.0, 0.0)])
def test_calibration_tells_the_error_of_the_mount(yaw, shift):
    """The laser is mounted otherwise than the model says, by degrees and metres; odometry is 2 % short."""
    model = (0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0)
    laser = LaserModel.from_message(-math.pi, math.pi, math.pi / 90, 180, 0.05, 20.0, model)
    mount = laser.base_from_sensor
    real = mount + [shift, -shift, math.radians(yaw)]
    told = star()
    bases = path_along([[x / 0.98, y / 0.98, turn] for x, y, turn in told], (-1.0, -1.0, 0.0))
    mapper = run(laser, compose(bases, real), compose(path_along(told), mount), linearUpdate=0.5)
    mapper.finish()
    found = mapper.calibration()
    assert set(found) == {name + ending for name in tr.NAMES for ending in ("", "_deviation")}
    assert math.degrees(found["laser_yaw"]) == pytest.approx(yaw, abs=0.2)
    assert found["laser_x"] == pytest.approx(shift, abs=0.01) and found["laser_y"] == pytest.approx(-shift, abs=0.01)
    assert found["distance"] == pytest.approx(1.0 / 0.98 - 1.0, abs=0.005)
    assert 0.0 < found["laser_yaw_deviation"] < 0.5 * tr.CALIBRATION_PRIOR[tr.MOUNT_YAW]
    assert mapper.info()["calibration"] == found
    mapper.close()


def test_compatible_mapper_has_no_calibration(mapped):
    mapper, _, _ = mapped(laps=0.1, compatible=True)
    assert mapper.calibration() == {} and "calibration" not in mapper.info()
    mapper.close()
