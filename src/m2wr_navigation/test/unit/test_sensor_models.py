# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from localization_room import CELL, room, scan, settings
from m2wr_navigation.localization.amcl_parameters import LASER_MODELS
from m2wr_navigation.localization.sensor_kernels import ray_length
from m2wr_navigation.localization.sensor_models import likelihoods, match, weigh

TRUE = np.array([1.2, 2.0, 0.7])
WRONG = TRUE + np.array([[0.3, 0.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.3], [2.5, 0.5, 1.0]])


@pytest.mark.parametrize("model", LASER_MODELS)
@pytest.mark.parametrize("weighting", ["tempered", "original"])
def test_the_true_pose_has_the_greatest_weight(model, weighting):
    values = settings(laser_model_type=model, laser_weighting=weighting, laser_max_beams=60)
    fit = weigh(np.vstack([TRUE[None], WRONG]), scan(TRUE), room(), values, False)
    assert fit.log_weights[0] > fit.log_weights[1:].max() + 0.1
    assert fit.goodness[0] > fit.goodness[1:].max()


def test_the_original_weight_is_one_plus_the_sum_of_cubes():
    values = settings(laser_weighting="original", laser_max_beams=8)
    grid, beams = room(), scan(TRUE)
    pose = TRUE + np.array([0.317, 0.013, 0.011])     # no end point at the edge of a cell
    used = beams.spread(8)
    placed = grid.to_grid(pose[None])[0]
    turn = np.array([[np.cos(placed[2]), -np.sin(placed[2])], [np.sin(placed[2]), np.cos(placed[2])]])
    cells = np.floor(placed[:2, None] + turn @ beams.ends[:, used] / CELL).astype(int)
    way = turn @ (beams.ends[:, used] - beams.mount[:, None])
    distance = grid.fields(2.0)[cells[1], cells[0], (way[0] < 0) + 2 * (way[1] < 0)] * 2.0 / 255.0
    p = 0.95 * np.exp(-distance ** 2 / (2.0 * 0.2 ** 2)) + 0.05 / 8.0
    fit = weigh(pose[None], beams, grid, values, False)
    assert math.exp(fit.log_weights[0]) == pytest.approx(1.0 + (p ** 3).sum(), rel=1e-4)


def test_off_the_map_a_beam_has_the_least_likelihood():
    values = settings(laser_model_type="likelihood_field_prob", laser_max_beams=10)
    fit = weigh(np.array([[500.0, 0.0, 0.0]]), scan(TRUE), room(), values, False)
    assert fit.log_weights[0] == pytest.approx(10.0 * likelihoods(values, 8.0)[255, 1], rel=1e-5)


def test_a_rotated_grid_gives_the_same_weights():
    turn = 0.6
    cos, sin = math.cos(turn), math.sin(turn)
    poses = np.vstack([TRUE[None], WRONG])
    turned = np.column_stack([1.0 + cos * poses[:, 0] - sin * poses[:, 1],
                              2.0 + sin * poses[:, 0] + cos * poses[:, 1], poses[:, 2] + turn])
    one = weigh(poses, scan(TRUE), room(), settings(), False)
    other = weigh(turned, scan(TRUE), room(turn, (1.0, 2.0)), settings(), False)
    np.testing.assert_allclose(one.log_weights, other.log_weights, rtol=1e-2)


def test_the_back_of_a_wall_is_no_hit():
    # 0.2 m farther on, beams end at the back of the left wall instead of its front; nothing else may explain that
    values = settings(laser_sigma_hit=0.03, laser_max_beams=60)
    beams = scan(TRUE)
    fit = weigh(np.stack([TRUE, TRUE + [-0.2, 0.0, 0.0]]), beams, room(), values, False)
    ahead = beams.polar[0, beams.hit]
    assert len(ahead) and fit.log_weights[0] > fit.log_weights[1] + 1.0


@pytest.mark.parametrize("pose", [(1.0, 2.0), (3.4, 1.1), (5.1, 0.7)])
def test_a_ray_is_at_most_half_a_cell_too_long(pose):
    grid = room()
    blocked, free = grid.clear_distance()
    beams = scan((pose[0] - 0.1, pose[1], 0.0))
    for direction, length in zip(*beams.polar):
        cast = CELL * ray_length(pose[0] / CELL, pose[1] / CELL, direction, 400.0, blocked, free)
        assert -1e-6 <= cast - length <= CELL + 1e-6 or abs(cast - length) < 3.0 * CELL


def test_beams_without_return_say_nothing_to_the_field():
    beams = scan(TRUE)
    blind = type(beams)(beams.ends, beams.polar, np.zeros(len(beams.hit), bool), beams.mount, beams.reach)
    assert weigh(TRUE[None], blind, room(), settings(), False) is None
    assert weigh(TRUE[None], blind, room(), settings(laser_model_type="beam"), False) is not None


def test_beam_skipping_leaves_out_what_no_particle_explains():
    values = settings(laser_model_type="likelihood_field_prob", do_beamskip=True, laser_max_beams=180)
    beams = scan(TRUE)
    ends = beams.ends.copy()
    ends[:, :40] *= 0.3                 # a person near the robot
    seen = type(beams)(ends, beams.polar, beams.hit, beams.mount, beams.reach)
    kept = weigh(np.tile(TRUE, (5, 1)), seen, room(), values, True)
    all_of_them = weigh(np.tile(TRUE, (5, 1)), seen, room(), values, False)
    assert kept.log_weights[0] > all_of_them.log_weights[0] + 20.0


@pytest.mark.parametrize("offset", [(0.08, -0.05, 0.05), (-0.1, 0.1, -0.08)])
def test_a_match_finds_the_pose(offset):
    found, share, _ = match(TRUE + np.array(offset), np.diag([0.1, 0.1, 0.05]), scan(TRUE), room(), settings())
    assert np.hypot(*(found - TRUE)[:2]) < 0.03 and abs(found[2] - TRUE[2]) < 0.01
    assert share > 0.9


def test_a_match_keeps_what_the_scan_does_not_tell():
    # one wall along x only: nothing is known of x
    beams = scan(TRUE)
    down = (beams.polar[0] + TRUE[2] > -2.0) & (beams.polar[0] + TRUE[2] < -1.2)
    seen = type(beams)(beams.ends, beams.polar, beams.hit & down, beams.mount, beams.reach)
    start = TRUE + np.array([0.05, 0.08, 0.0])
    found = match(start, np.diag([0.01, 0.01, 0.001]), seen, room(), settings()).pose
    assert abs(found[0] - start[0]) < 0.03 and abs(found[1] - TRUE[1]) < 0.03
