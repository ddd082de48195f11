# SPDX-License-Identifier: BSD-3-Clause
"""The kernels of the way between two processed scans, against a slow plain twin that keeps poses in objects."""
import math

import numpy as np
import pytest

from m2wr_gmapping.filter.motion_model import MotionNoise
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import odometry_kernels as ok
from m2wr_gmapping.frontend import track_layout as tl
from m2wr_gmapping.frontend import tracking_kernels as tk
from m2wr_gmapping.frontend.tracking import new_track
from m2wr_gmapping.se2 import between, compose, inverse, wrap

NOISE = MotionNoise(0.03, 0.05, 0.02, 0.04)
AHEAD = 0.6, -0.8


def size(step):
    return np.array([math.hypot(step[0], step[1]), abs(step[2])])


def exceeds(step, limits):
    return bool((np.abs(step) > limits).any())


def together(information, prior):
    """Variances of what a scan and a prior tell."""
    h = np.zeros((3, 3))
    h[np.triu_indices(3)] = information
    h = h + h.T - np.diag(h.diagonal()) + np.diag(1.0 / prior)
    return np.linalg.inv(h).diagonal()


class Plain:
    """What ``track`` holds, in words of its own, and what each kernel does to it."""

    def __init__(self):
        self.scale, self.heard = np.ones((2, 2)), np.zeros((2, 2))      # way and heading, by way and by turn
        self.centre, self.centre_variance = 0.0, 0.1**2
        self.bias, self.covariance = np.zeros(3), np.diag(np.full(3, 0.03**2))
        self.doubt = self.slip = None
        self.rel = self.driven = self.since = np.zeros(3)
        self.begin_from(np.zeros(3), np.zeros(3))

    def begin_from(self, rel, slack):
        self.expected, self.slack, self.way, self.signed = rel, slack, np.zeros(2), np.zeros(2)

    def parts(self, way):
        """Deviations along, across and of the heading, (3, 2) by way and by turn; and what the last adds across."""
        own = np.stack([NOISE.deviations((way[0], 0.0, 0.0)), NOISE.deviations((0.0, 0.0, way[1]))], -1)
        own += [[0.004 + 0.005 * way[0], 0.0], [0.004 + 0.005 * way[0], 0.0], [0.004, 0.005 * way[1]]]
        own *= self.scale[[0, 0, 1]]
        return own, 0.5 * way[0] * own[2].sum()

    def squares(self, way):
        own, aside = self.parts(way)
        return np.square(own.sum(axis=1)) + [0.0, aside * aside, 0.0]

    @property
    def always(self):
        """Variances of what odometry errs alike all the time, as far as it is not known."""
        forward, turn = self.signed
        heading = np.array([0.0, turn, forward]) @ self.covariance @ [0.0, turn, forward]
        along, across = self.covariance[0, 0] * forward**2, 0.25 * heading * forward**2
        ahead = np.array(AHEAD)
        moved = ahead - compose([0.0, 0.0, -turn], [*ahead, 0.0])[:2]       # by a centre a metre off
        squares = np.square(AHEAD)
        return np.array([squares @ [along, across], squares @ [across, along], heading]) + self.centre_variance * (
            np.array([*np.square(moved), 0.0]))

    @property
    def variances(self):
        return self.squares(self.way) + self.slack

    def advance(self, step):
        ahead = step[0] * AHEAD[0] + step[1] * AHEAD[1]
        right = np.array([*step[:2] * (1.0 + self.bias[0]), step[2] * (1.0 + self.bias[1]) + self.bias[2] * ahead])
        point = np.array([self.centre * AHEAD[0], self.centre * AHEAD[1], 0.0])
        right[:2] += compose([0.0, 0.0, right[2]], point)[:2] - point[:2]
        self.rel, self.expected = compose(self.rel, right), compose(self.expected, right)
        self.driven, self.since = compose(self.driven, step), compose(self.since, step)
        self.way, self.signed = self.way + size(step), self.signed + [ahead, step[2]]

    def good_share(self, step):
        if self.doubt is None:
            return 0.8
        share, way = self.doubt
        self.doubt = None if (way + size(step) > 0.15).any() else (share, way + size(step))
        return 0.8 if self.doubt is None else min(0.8, share - 0.1)

    def settle(self, anchor, row, share, slipped, at_once):
        self.rel = between(anchor, row[:3])
        if share < 0.8 and self.doubt is None:
            self.doubt = share, np.zeros(2)
        if not slipped:
            self.slip = None
            return
        if self.slip is None or exceeds(between(compose(self.slip[0], self.expected), self.rel), 0.1):
            self.slip = None, self.way, 0
        _, way, looks = self.slip
        self.slip = compose(self.rel, inverse(self.expected)), way, looks + 1
        if at_once or looks >= 20 or (self.way - way > [0.15, 0.1]).any():
            self.slip = None
            self.update_noise_scales(between(self.expected, self.rel), np.zeros(3))
            self.begin_from(self.rel, np.square([0.05, 0.05, 0.03]))

    def update_noise_scales(self, error, variance):
        own, _ = self.parts(self.way)
        whole, squared = own.sum(axis=1), self.squares(self.way)
        told = np.maximum(1.0 - variance / squared, 0.0)
        excess = np.minimum(np.square(error) / squared / np.maximum(told, 1e-3), 9.0) - 1.0
        told[1] *= whole[1]**2 / squared[1]
        shares = own / whole[:, None]
        for k, part in np.ndindex(2, 2):
            axes = [2] if k else [0, 1]
            heard = shares[axes, part]
            if k == 0:
                heard = heard + (1.0 - heard) / (1.0 + self.heard[k, part])
            heard = heard * told[axes]
            share = heard.sum()
            if share > 0.01:
                self.heard[k, part] += min(share, 1.0)
                mean = (heard * excess[axes]).sum() / share
                growth = 1.0 + min(share, 1.0) * mean / min(1.0 + self.heard[k, part], 10.0)
                self.scale[k, part] = np.clip(self.scale[k, part] * math.sqrt(growth), 0.1, 30.0)

    def update_bias(self, error, variance, told):
        forward, turn = self.signed
        grown = self.covariance.diagonal() + 0.03**2 * np.array([1.0, 0.0, 1.0]) / 300.0 * abs(forward)
        np.fill_diagonal(self.covariance, np.minimum(grown, 0.03**2))
        along, squares = np.array(AHEAD), np.square(AHEAD)
        for seen, noise, heard, row in (
                (along @ error[:2], squares @ variance[:2], squares @ told[:2], np.array([forward, 0.0, 0.0])),
                (error[2], variance[2], told[2], np.array([0.0, turn, forward]))):
            gain = self.covariance @ row
            expected = row @ gain + 4.0 * noise
            if heard >= 0.1 and seen * seen <= 16.0 * expected:
                self.told += np.outer(row, row) / (4.0 * noise)
                self.told_of += row * (seen + row @ self.bias) / (4.0 * noise)
                self.bias = self.bias + gain * seen / expected
                self.covariance = self.covariance - np.outer(gain, gain) / expected
        aside, lever = np.array([-AHEAD[1], AHEAD[0]]), math.sin(turn)
        seen, noise, heard = aside @ error[:2], np.square(aside) @ variance[:2], np.square(aside) @ told[:2]
        expected = lever * self.centre_variance * lever + 4.0 * noise
        if heard >= 0.1 and seen * seen <= 16.0 * expected:
            gain = self.centre_variance * lever / expected
            self.centre += gain * seen
            self.centre_variance *= 1.0 - gain * lever

    def learn(self, anchor, row):
        self.told, self.told_of, self.led_by = np.zeros((3, 3)), np.zeros(3), self.bias
        if not self.slack.any():
            error = between(self.expected, between(anchor, row[:3]))
            self.update_noise_scales(error, together(row[mk.INFORMATION:], self.squares(self.way)))

    @property
    def prior(self):
        return self.squares(self.way) + self.always

    def heard_of(self, information):
        """What a scan tells along, across and of the heading, less what normals that lean by noise make of it."""
        heard = np.maximum(1.0 - together(information / 10.0, self.prior) / self.prior, 0.0)
        both = information[0] + information[3]
        for k in range(2):
            part = information[3 * k]
            heard[k] *= max(0.0, 1.0 - 0.085 * both / part) if part > 0.0 else 0.0
        return heard

    def is_bias_observable(self, row):
        return not self.slack.any() and (self.heard_of(row[mk.INFORMATION:]) >= 0.1).any()

    def update_bias_unconstrained(self, anchor, row):
        own, prior, heard = self.squares(self.way), self.prior, self.heard_of(row[mk.INFORMATION:])
        error = between(self.expected, between(anchor, row[:3]))
        told = np.maximum(1.0 - together(row[mk.INFORMATION:], prior) / prior, 0.1)
        self.update_bias(error / told, own + prior * (1.0 - heard) / np.maximum(heard, 1e-9), heard)


def compare(track, plain):
    for row, wanted in ((tl.REL, plain.rel), (tl.EXPECTED, plain.expected), (tl.DRIVEN, plain.driven),
                        (tl.SINCE, plain.since)):
        assert np.abs(wrap(track[row] - wanted)).max() < 1e-7
    assert np.allclose(track[tl.SLACK], plain.slack) and np.allclose(track[tl.MOTION, :2], plain.way)
    assert np.allclose(track[tl.SIGNED_MOTION, :2], plain.signed)
    assert (track[tl.DOUBT, 0] == tl.NO_DOUBT) == (plain.doubt is None)
    assert (track[tl.SLIP, 2] == 0) == (plain.slip is None)
    if plain.doubt is not None:
        assert np.allclose(track[tl.DOUBT], [plain.doubt[0], *plain.doubt[1]])
    if plain.slip is not None:
        assert np.allclose(track[tl.SLIP_TRANSFORM], plain.slip[0])
        assert np.allclose(track[tl.SLIP], [*plain.slip[1], plain.slip[2]])
    assert np.allclose(track[tl.SCALE:tl.SCALE_EVIDENCE, :2], plain.scale)
    assert np.allclose(track[tl.SCALE_EVIDENCE:tl.BIAS, :2], plain.heard)
    assert np.allclose(track[tl.BIAS], plain.bias) and np.allclose(track[tl.COVARIANCE:tl.CENTRE], plain.covariance)
    assert np.allclose(track[tl.CENTRE, :2], [plain.centre, plain.centre_variance])


def information(rng):
    """Upper triangle of a scan's information; at times of a corridor, or of nothing at all."""
    root = rng.normal(size=(3, 3)) * 10.0**rng.uniform(0.0, 2.5, 3)[:, None] * rng.integers(0, 2, (3, 1))
    return (root.T @ root)[np.triu_indices(3)]


def step_of(rng):
    """A step of odometry: standing, creeping, driving, backwards, turning on the spot, or far."""
    kind = rng.integers(6)
    return np.array([(0.0, 0.002, 0.1, -0.1, 0.0, 1.5)[kind], (0.0, 0.0, 0.01, 0.0, 0.0, 0.2)[kind],
                     (0.0, 0.001, 0.05, -0.03, 0.4, 2.0)[kind]]) * rng.uniform(0.5, 1.5)


@pytest.mark.parametrize("seed", range(6))
def test_tracking_a_drive_equals_reference(seed):
    rng = np.random.default_rng(seed)
    track, plain, ask = new_track(NOISE, AHEAD), Plain(), np.empty((tl.ASK_ROWS, 3))
    odom, anchor = rng.normal(size=3), np.array([3.0, -2.0, 3.1])
    for k in range(400):
        step = step_of(rng)
        before, odom = odom, compose(odom, step)
        distance, turn, moved = tk.advance(track, before, odom)
        plain.advance(step)
        assert np.allclose([distance, turn], size(step))
        assert moved == exceeds(plain.since, 0.005)
        if rng.random() < 0.8:          # a match
            taken, plain.since = plain.since, np.zeros(3)
            long, good = tk.expect(track, anchor, ask)
            assert long == exceeds(taken, [0.15, 0.15, 0.1]) and good == pytest.approx(plain.good_share(taken))
            assert np.abs(wrap(ask[tl.START] - compose(anchor, plain.rel))).max() < 1e-7
            assert np.abs(wrap(ask[tl.WANTED] - compose(anchor, plain.expected))).max() < 1e-7
            assert np.allclose(ask[tl.VARIANCES], plain.variances) and np.allclose(ask[tl.INVERSE], 1 / plain.variances)
            assert np.allclose(ask[tl.WINDOW, :2], [0.2, 0.3] + 0.4 * size(taken))
            row = np.zeros(mk.RESULT_SIZE)
            row[:3] = compose(compose(anchor, plain.rel), rng.normal(size=3) * [0.03, 0.03, 0.02])
            slipped = k % 50 > 25 and rng.random() < 0.95
            at_once, share = rng.random() < 0.1, rng.uniform(0.5, 1.0)
            tk.accept_match(track, anchor, row, share, slipped, at_once)
            plain.settle(anchor, row, share, slipped, at_once)
            assert tk.unexplained(track) == exceeds(between(plain.driven, plain.rel), [0.05, 0.05, 0.02])
        if rng.random() < 0.3:          # a processed scan
            row = np.concatenate([compose(compose(anchor, plain.rel), rng.normal(size=3) * [0.02, 0.02, 0.01]),
                                  np.zeros(4), information(rng)])
            ok.learn(track, anchor, row)
            plain.learn(anchor, row)
            inverse = np.empty(3)
            teaches = ok.is_bias_observable(track, row, inverse)
            assert teaches == plain.is_bias_observable(row)
            if teaches:
                assert np.allclose(1.0 / inverse, plain.prior)
                freed = row.copy()
                freed[:3] = compose(row[:3], rng.normal(size=3) * [0.02, 0.02, 0.01])
                ok.update_bias_unconstrained(track, anchor, freed, inverse)
                plain.update_bias_unconstrained(anchor, freed)
            assert np.allclose(track[tl.BIAS_INFORMATION:tl.BIAS_INFORMATION_VECTOR], plain.told)
            assert np.allclose(track[tl.BIAS_INFORMATION_VECTOR], plain.told_of)
            assert np.allclose(track[tl.APPLIED_BIAS], plain.led_by)
            assert np.allclose(track[tl.TRAVELLED, :2], plain.signed)
            compare(track, plain)
            track[:tl.SINCE_PROCESSED] = 0.0
            plain.rel = plain.driven = plain.since = np.zeros(3)
            plain.slip = None
            plain.begin_from(np.zeros(3), np.zeros(3))
        compare(track, plain)
    assert plain.heard.min() > 3.0 and plain.bias.all() and plain.centre


@pytest.mark.parametrize("seed", range(3))
def test_prediction_of_particles_equals_reference(seed):
    rng, track, plain = np.random.default_rng(seed), new_track(NOISE, AHEAD), Plain()
    for _ in range(3):
        step = step_of(rng)
        tk.advance(track, np.zeros(3), step)
        plain.advance(step)
    track[tl.REL] = plain.rel = compose(plain.rel, [0.01, 0.02, 0.03])
    track[tl.SLACK] = plain.slack = np.array([0.01, 0.02, 0.0])
    anchors, known = rng.uniform(-4.0, 4.0, (20, 3)), np.empty((3, 3))
    starts, predictions = np.empty((20, 3)), np.empty((20, 3))
    tk.predict_all(track, anchors, starts, predictions, known)
    assert np.allclose(starts, compose(anchors, plain.rel))
    assert np.allclose(predictions, compose(anchors, plain.expected))
    assert np.allclose(known[0], plain.variances) and np.allclose(known[1], 1.0 / plain.variances)
    assert np.allclose(known[2], np.minimum(np.sqrt(plain.variances), NOISE.deviations(plain.expected)))


@pytest.mark.parametrize("forward, turn", [(0.5, 0.0), (0.0, 0.45), (-0.3, -0.4), (0.6, 0.5)])
def test_bias_uncertainty_adds_pose_variance(forward, turn):
    rng, found = np.random.default_rng(1), []
    track = new_track(NOISE, AHEAD)
    track[tl.COVARIANCE:tl.CENTRE] = np.diag(np.square([0.02, 0.03, 0.0]))
    exact = track.copy()
    parts = 10
    for _ in range(2000):
        track[tl.BIAS], track[tl.CENTRE, 0] = rng.normal(0.0, [0.02, 0.03, 1e-12]), rng.normal(0.0, 0.1)
        poses = np.zeros((2, 3))
        for k, known in enumerate((track, exact)):
            for _ in range(parts):
                step = np.array([forward * AHEAD[0], forward * AHEAD[1], turn]) / parts
                poses[k] = compose(poses[k], ok.corrected(known, *step)[:3])
        found.append(between(poses[0], poses[1]))
    assert np.sqrt(ok.bias_variances(exact, forward, turn)) == pytest.approx(np.std(found, axis=0), rel=0.1, abs=1e-3)


def test_match_is_projected_only_onto_degenerate_direction():
    row, expected = np.zeros(mk.RESULT_SIZE), np.array([2.0, 1.0, 0.5])
    c, s = math.cos(0.4), math.sin(0.4)         # a wall along that direction of the laser's frame
    for weak, silent in ((0.01, True), (0.15, False)):
        normals = 1e4 * (np.outer([-s, c], [-s, c]) + weak * np.outer([c, s], [c, s]))
        row[mk.INFORMATION:] = normals[0, 0], normals[0, 1], 0.0, normals[1, 1], 0.0, 5e4
        row[:3] = compose(expected, [0.1, -0.05, 0.02])
        before = row[:3].copy()
        tk.project_onto_degenerate(row, expected)
        moved, lacks = between(before, row[:3]), between(before, expected)
        wanted = np.array([c, s]) * (lacks[:2] @ [c, s]) if silent else np.zeros(2)
        assert moved == pytest.approx([*wanted, 0.0], abs=1e-12)
        assert tk.degenerate_direction(row) == pytest.approx((c * c, c * s, s * s) if silent else (0.0, 0.0, 0.0))
    row[mk.INFORMATION:] = 0.0                  # what no scan holds stays where the match has it
    tk.project_onto_degenerate(row, expected)
    assert tk.degenerate_direction(row) == (0.0, 0.0, 0.0)


def test_match_cost_is_beam_cost_plus_odometry_prior():
    row, expected, variances = np.zeros(mk.RESULT_SIZE), np.array([1.0, 2.0, 3.1]), np.array([0.01, 0.04, 0.0025])
    row[:3], row[mk.COST] = compose(expected, [0.1, -0.4, 0.1]), 30.0
    cost, pull = tk.cost_of(row, expected, variances)
    assert pull == pytest.approx(1.0 + 4.0 + 4.0) and cost == pytest.approx(3.0 + 4.5)
