# SPDX-License-Identifier: BSD-3-Clause
"""The kernels of the way between two processed scans, against a slow plain twin that keeps poses in objects."""
import math

import numpy as np
import pytest

from m2wr_gmapping.frontend import calibration_kernels as ck
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend import tracking_kernels as tk
from m2wr_gmapping.frontend.information_kernels import DEPENDENT
from m2wr_gmapping.frontend.odometry_kernels import odometry_variances
from m2wr_maps.se2 import between, compose, inverse, wrap

NOISE = np.array([[0.03, 0.02], [0.05, 0.04]])
MOUNT = np.array([0.2, -0.1, 0.7])
VALUE = np.array([0.02, -0.03, 0.015, -0.05, 0.04, 0.03])


def size(step):
    return np.array([math.hypot(step[0], step[1]), abs(step[2])])


def exceeds(step, limits):
    return bool((np.abs(step) > limits).any())


def new_state(value=VALUE):
    """Data of a track, of the noise and of a calibration with that value (6,)."""
    calibration = tr.new_calibration(MOUNT)
    tr.calibration_of(calibration).value[:] = value
    return tr.new_track(), tr.new_noise(NOISE), calibration


def full(information):
    h = np.zeros((3, 3))
    h[np.triu_indices(3)] = information
    return h + h.T - np.diag(h.diagonal())


def by_user(step):
    """Standard deviations of a step."""
    dx, dy, turn = np.abs(step)
    return np.array([NOISE[0] @ [dx + 0.3 * dy, turn], NOISE[0] @ [dy + 0.3 * dx, turn],
                     NOISE[1] @ [math.hypot(dx, dy), turn]])


class Plain:
    """What a ``Track`` and its ``Noise`` hold, in words of its own, and what each kernel does to it."""

    def __init__(self, calibration):
        self.calibration = tr.calibration_of(calibration)
        self.scale, self.heard = np.ones((2, 2)), np.zeros((2, 2))      # way and heading, by way and by turn
        self.process()

    def process(self):
        self.rel = self.since = np.zeros(3)
        self.slip = None
        self.begin_from(np.zeros(3), np.zeros(3))

    def begin_from(self, rel, slack):
        self.expected, self.slack, self.way, self.forward = rel, slack, np.zeros(2), 0.0

    def parts(self, way):
        """Deviations along, across and of the heading, (3, 2) by way and by turn; and what the last adds across."""
        own = np.stack([by_user((way[0], 0.0, 0.0)), by_user((0.0, 0.0, way[1]))], -1)
        own += [[0.004 + 0.005 * way[0], 0.0], [0.004 + 0.005 * way[0], 0.0], [0.004, 0.005 * way[1]]]
        own *= self.scale[[0, 0, 1]]
        return own, 0.5 * way[0] * own[2].sum()

    @property
    def squares(self):
        own, aside = self.parts(self.way)
        return np.square(own.sum(axis=1)) + [0.0, aside * aside, 0.0]

    @property
    def variances(self):
        return self.squares + self.slack

    def advance(self, step):
        right, jacobian = np.empty(3), np.empty((3, 6))
        self.forward += ck.corrected_step(self.calibration, *step, right, jacobian)
        self.rel, self.expected = compose(self.rel, right), compose(self.expected, right)
        self.since, self.way = compose(self.since, step), self.way + size(step)

    def settle(self, anchor, row, slipped, at_once):
        self.rel = between(anchor, row[:3])
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
            self.begin_from(self.rel, np.square([0.05, 0.05, 0.02]))

    def update_noise_scales(self, error, variance):
        own, _ = self.parts(self.way)
        whole, squared = own.sum(axis=1), self.squares
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
            if share > 0.0:
                self.heard[k, part] += min(share, 1.0)
                mean = (heard * excess[axes]).sum() / share
                growth = 1.0 + min(share, 1.0) * mean / min(1.0 + self.heard[k, part], 10.0)
                self.scale[k, part] = np.clip(self.scale[k, part] * math.sqrt(growth), 0.1, 30.0)

    def learn_noise(self, anchor, row):
        if not self.slack.any():
            variance = np.linalg.inv(full(row[mk.INFORMATION:]) + np.diag(1.0 / self.squares)).diagonal()
            self.update_noise_scales(between(self.expected, between(anchor, row[:3])), variance)


def compare(track_data, noise_data, plain):
    track, noise = tr.track_of(track_data), tr.noise_of(noise_data)
    for found, wanted in ((track.matched, plain.rel), (track.predicted, plain.expected),
                          (track.since_match, plain.since)):
        assert np.abs(wrap(found - wanted)).max() < 1e-7
    assert np.allclose(track.slack, plain.slack) and np.allclose(track.motion, [*plain.way, plain.forward])
    assert (track.slip[2] == 0) == (plain.slip is None)
    if plain.slip is not None:
        assert np.allclose(track.slip_transform, plain.slip[0])
        assert np.allclose(track.slip, [*plain.slip[1], plain.slip[2]])
    assert np.allclose(noise.scale, plain.scale) and np.allclose(noise.evidence, plain.heard)


def information(rng):
    """Upper triangle of a scan's information; at times of a corridor, or of nothing at all."""
    root = rng.normal(size=(3, 3)) * 10.0**rng.uniform(0.0, 2.5, 3)[:, None] * rng.integers(0, 2, (3, 1))
    return (root.T @ root)[np.triu_indices(3)]


def step_of(rng):
    """A step of odometry: standing, creeping, driving, backwards, turning on the spot, or far."""
    kind = rng.integers(6)
    return np.array([(0.0, 0.002, 0.1, -0.1, 0.0, 1.5)[kind], (0.0, 0.0, 0.01, 0.0, 0.0, 0.2)[kind],
                     (0.0, 0.001, 0.05, -0.03, 0.4, 2.0)[kind]]) * rng.uniform(0.5, 1.5)


@pytest.mark.parametrize("seed", range(4))
def test_tracking_a_drive_equals_reference(seed):
    rng = np.random.default_rng(seed)
    track, noise, calibration = new_state()
    plain, slips = Plain(calibration), 0
    odom, anchor = rng.normal(size=3), np.array([3.0, -2.0, 3.1])
    for k in range(400):
        step = step_of(rng)
        before, odom = odom, compose(odom, step)
        distance, turn, moved = tk.advance(track, calibration, between(before, odom))
        plain.advance(step)
        assert np.allclose([distance, turn], size(step))
        assert moved == exceeds(plain.since, 0.005)
        if rng.random() < 0.8:          # a match
            taken, plain.since = plain.since, np.zeros(3)
            data = np.empty(tr.REQUEST_SIZE)
            long = tk.expect(track, noise, anchor, data)
            start, expected, variances, window, _ = tr.request_of.py_func(data)
            assert long == exceeds(taken, [0.15, 0.15, 0.1])
            assert np.abs(wrap(start - compose(anchor, plain.rel))).max() < 1e-7
            assert np.abs(wrap(expected - compose(anchor, plain.expected))).max() < 1e-7
            assert np.allclose(variances, plain.variances)
            assert np.allclose(window, [0.2, 0.3] + 0.4 * size(taken))
            row = np.zeros(mk.RESULT_SIZE)
            row[:3] = compose(compose(anchor, plain.rel), rng.normal(size=3) * [0.03, 0.03, 0.02])
            slipped = k % 50 > 25 and rng.random() < 0.95
            at_once = rng.random() < 0.1
            tk.accept_match(track, noise, anchor, row, slipped, at_once)
            plain.settle(anchor, row, slipped, at_once)
            slips += plain.slip is not None
        if rng.random() < 0.3:          # a processed scan
            row = np.concatenate([compose(compose(anchor, plain.rel), rng.normal(size=3) * [0.02, 0.02, 0.01]),
                                  np.zeros(4), information(rng)])
            tk.learn_noise(track, noise, anchor, row)
            plain.learn_noise(anchor, row)
            compare(track, noise, plain)
            track[:] = 0.0
            plain.process()
        compare(track, noise, plain)
    assert plain.heard.min() > 3.0 and slips > 20


@pytest.mark.parametrize("seed", range(3))
def test_prediction_of_particles_equals_reference(seed):
    rng, (track, noise, calibration) = np.random.default_rng(seed), new_state()
    plain = Plain(calibration)
    for _ in range(3):
        step = step_of(rng)
        tk.advance(track, calibration, step)
        plain.advance(step)
    parts = tr.track_of(track)
    parts.matched[:] = plain.rel = compose(plain.rel, [0.01, 0.02, 0.03])
    parts.slack[:] = plain.slack = np.array([0.01, 0.02, 0.0])
    anchors, known = rng.uniform(-4.0, 4.0, (20, 3)), np.empty((3, 3))
    starts, predictions = np.empty((20, 3)), np.empty((20, 3))
    tk.predict_all(track, noise, anchors, starts, predictions, known)
    assert np.allclose(starts, compose(anchors, plain.rel))
    assert np.allclose(predictions, compose(anchors, plain.expected))
    assert np.allclose(known[0], plain.variances) and np.allclose(known[1], 1.0 / plain.variances)
    assert np.allclose(known[2], np.minimum(np.sqrt(plain.variances), by_user(plain.expected)))


def driven(steps=(0.3, 0.0, 0.1), value=VALUE, count=3):
    """Track, noise and calibration after some equal steps of the laser by odometry."""
    track, noise, calibration = new_state(value)
    for _ in range(count):
        tk.advance(track, calibration, np.array(steps))
    return track, noise, calibration


def test_calibration_weakens_the_prior_of_its_own_match():
    track, noise, calibration = driven()
    out, parts = np.empty(3), tr.track_of(track)
    assert tk.weak_prior(track, noise, calibration, out)
    own = odometry_variances(tr.noise_of(noise), parts.motion[0], parts.motion[1])
    wanted = own + (parts.jacobian @ np.diag(np.square(tr.CALIBRATION_PRIOR)) @ parts.jacobian.T).diagonal()
    assert 1.0 / out == pytest.approx(wanted)
    parts.slack[:] = tk.SLIP_LEFT
    assert not tk.weak_prior(track, noise, calibration, out)


def match_of(track, anchor, seen, error):
    """Prediction in ``map``, and the row of an exact match whose scan sees the prediction to err by ``error``."""
    prediction, row = compose(anchor, tr.track_of(track).predicted), np.zeros(mk.RESULT_SIZE)
    row[:3], row[mk.INFORMATION:] = compose(prediction, error), np.diag(seen)[np.triu_indices(3)]
    return prediction, row


def test_learning_equals_the_information_form():
    """What the step tells is kept for the smoother, as information about the calibration itself."""
    track, noise, calibration = driven()
    anchor, error, record = np.array([3.0, -2.0, 3.1]), np.array([0.004, 0.003, 0.002]), np.zeros(tr.RECORD_SIZE)
    prediction, row = match_of(track, anchor, [1e5, 1e5, 1e5], error)
    parts, step, before = tr.track_of(track), tr.record_of(record), calibration.copy()
    tk.record_step(track, noise, calibration, row, record)
    assert (step.applied == VALUE).all() and not step.information.any() and not step.vector.any()
    assert step.forward[0] == parts.motion[2] != 0.0
    tk.learn(track, noise, calibration, prediction, row, np.zeros(3), record)
    assert np.linalg.matrix_rank(step.information, tol=1e-3) == 3
    was, now = tr.calibration_of(before), tr.calibration_of(calibration)
    ck.drift(was.covariance, parts.motion[2], tr.CALIBRATION_PRIOR, tr.CALIBRATION_CHANGE)
    total = np.linalg.inv(was.covariance) + step.information
    assert np.allclose(now.covariance, np.linalg.inv(total), rtol=1e-5, atol=1e-9)
    assert np.allclose(now.value, np.linalg.solve(total, np.linalg.solve(was.covariance, VALUE) + step.vector))
    assert np.abs(now.value - VALUE).max() > 1e-3
    own = odometry_variances(tr.noise_of(noise), parts.motion[0], parts.motion[1])
    seen = np.linalg.inv(np.linalg.inv(1e5 / DEPENDENT * np.eye(3)) + np.diag(own))
    wanted = parts.jacobian.T @ seen @ parts.jacobian
    assert step.information == pytest.approx(wanted, rel=0.1, abs=0.02 * wanted.max())  # of the normals' noise


def test_outlier_is_not_recorded():
    track, noise, calibration = driven()
    prediction, row = match_of(track, np.zeros(3), [1e5, 1e5, 1e5], [3.0, 0.0, 0.0])
    value, record = tr.calibration_of(calibration).value.copy(), np.zeros(tr.RECORD_SIZE)
    tk.record_step(track, noise, calibration, row, record)
    tk.learn(track, noise, calibration, prediction, row, np.zeros(3), record)
    step = tr.record_of(record)
    assert (tr.calibration_of(calibration).value == value).all()
    assert not step.information.any() and not step.vector.any() and step.derivative.any()


def test_step_after_a_slip_tells_nothing():
    track, noise, calibration = driven()
    tr.track_of(track).slack[:] = tk.SLIP_LEFT
    _, row = match_of(track, np.zeros(3), [1e5, 1e5, 1e5], np.zeros(3))
    record, scale = np.full(tr.RECORD_SIZE, 7.0), noise.copy()
    tk.record_step(track, noise, calibration, row, record)
    tk.learn_noise(track, noise, np.zeros(3), row)
    step = tr.record_of(record)
    assert not step.information.any() and not step.vector.any() and not step.derivative.any()
    assert (noise == scale).all()


def test_step_along_a_plain_wall_depends_on_the_calibration():
    """As far as the scan does not observe it."""
    track, noise, calibration = driven((0.3, 0.0, 0.0))
    record, jacobian = np.zeros(tr.RECORD_SIZE), tr.track_of(track).jacobian
    _, row = match_of(track, np.zeros(3), [0.0, 1e9, 1e9], np.zeros(3))
    tk.record_step(track, noise, calibration, row, record)
    derivative = tr.record_of(record).derivative
    assert derivative[0] == pytest.approx(jacobian[0]) and np.abs(derivative[1:]).max() < 1e-3
    assert derivative[0, tr.DISTANCE] == pytest.approx(0.9, rel=0.05)


def test_match_cost_is_beam_cost_plus_odometry_prior():
    row, expected, variances = np.zeros(mk.RESULT_SIZE), np.array([1.0, 2.0, 3.1]), np.array([0.01, 0.04, 0.0025])
    row[:3], row[mk.COST] = compose(expected, [0.1, -0.4, 0.1]), 30.0
    cost, pull = tk.cost_of(row, expected, variances)
    assert pull == pytest.approx(1.0 + 4.0 + 4.0) and cost == pytest.approx(3.0 + 4.5)
