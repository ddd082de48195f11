# SPDX-License-Identifier: BSD-3-Clause
"""The learned policy: what its network sees, the file of its weights, and drives by it."""
import math
import subprocess
import sys

import numpy as np
import pytest

from m2wr_navigation import registry
from m2wr_navigation.compare.drive import drive_method
from m2wr_navigation.methods import learned
from m2wr_navigation.methods.learned import FEATURES, SECTORS, SIGHT, features, network, read_policy, scaled, sectors
from m2wr_navigation.methods.method import REACHED
from m2wr_navigation.parameters import read
from m2wr_sim.api import read_world

BEAMS = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 720)


def write(path, shapes, value=0.0, **more):
    arrays = {}
    for number, (outputs, inputs) in enumerate(shapes):
        arrays["weights_%d" % number] = np.full((outputs, inputs), value, np.float32)
        arrays["offsets_%d" % number] = np.zeros(outputs, np.float32)
    arrays.update(more)
    np.savez(str(path), **arrays)
    return str(path)


def method(**given):
    kind = registry.find(registry.METHODS, "learned")
    return kind(read(kind.PARAMETERS, given, "~learned")[0])


@pytest.mark.parametrize("start, goal", [((0.0, 8.0, -1.57), (2.0, 4.0)), ((0.0, 8.0, 1.57), (-3.0, 6.0))])
def test_it_reaches_a_goal_in_a_world_it_has_not_seen(start, goal):
    run = drive_method(read_world("world02"), start, goal, method(), 60.0)
    assert run.outcome == REACHED and run.contacts == 0, run.reason


def test_a_sector_has_its_least_reading():
    ranges = np.full(720, 5.0)
    ranges[[0, 359, 719]] = 0.5, 1.0, 2.0
    found = sectors(ranges, BEAMS[0], BEAMS[1] - BEAMS[0])
    assert found.shape == (SECTORS,) and (found[0], found[17], found[35]) == (0.5, 1.0, 2.0)
    assert np.count_nonzero(found == 5.0) == SECTORS - 3


def test_sectors_leave_out_what_is_no_reading_or_behind():
    assert np.isinf(sectors([math.nan, -math.inf, 0.0, -1.0, math.inf], -1.0, 0.5)).all()
    assert np.isinf(sectors(np.ones(10), 1.6, 0.1)).all()
    whole = sectors(np.ones(720), -math.pi, 2.0 * math.pi / 720)
    assert (whole == 1.0).all() and (sectors(np.ones(720), 0.0, 2.0 * math.pi / 720) == 1.0).all()


def test_features_are_bounded_and_mirror():
    scan = np.concatenate((np.full(18, 1.0), np.full(18, np.inf)))
    seen = features(np.array([scan, scan[::-1]]), np.array([(30.0, 40.0), (30.0, -40.0)]),
                    np.array([(0.5, 1.0), (0.5, -1.0)]))
    assert seen.shape == (2, FEATURES) and seen.dtype == np.float32
    assert seen[0, :SECTORS].tolist() == [1.0 - 1.0 / SIGHT] * 18 + [0.0] * 18
    assert seen[0, SECTORS:] == pytest.approx([1.0, 0.6, 0.8, 1.0, 1.0])
    assert seen[1, SECTORS:] == pytest.approx([1.0, 0.6, -0.8, 1.0, -1.0])
    assert np.isfinite(features(scan[None], np.zeros((1, 2)), np.array([(1e300, -1e300)]))).all()


def test_actions_are_clipped_to_the_commands():
    assert scaled(np.array([(-1.0, -1.0), (0.0, 0.0), (1.0, 1.0), (9.0, -9.0)])).tolist() == [
        [0.0, -1.0], [0.25, 0.0], [0.5, 1.0], [0.5, -1.0]]


def test_a_network_is_what_its_arrays_say(tmp_path):
    path = write(tmp_path / "a.npz", [(3, FEATURES), (2, 3)], 0.1)
    seen = np.ones((1, FEATURES), np.float32)
    assert network(read_policy(path), seen) == pytest.approx(np.full((1, 2), 0.3 * math.tanh(0.1 * FEATURES)))


def test_the_greatest_speeds_limit_its_commands(tmp_path):
    path = write(tmp_path / "fast.npz", [(2, FEATURES)], 100.0)
    made = method(policy=path, max_vel_x=0.2, max_vel_theta=0.3)
    run = drive_method(read_world("world02"), (0.0, 8.0, 0.0), (5.0, 8.0), made, 2.0)
    assert 0.0 < run.length < 0.41 and run.poses[-1, 2] > 0.3


@pytest.mark.parametrize("shapes, more, said", [
    ([(3, FEATURES + 1), (2, 3)], {}, "a layer from 41 values"),
    ([(3, FEATURES), (1, 3)], {}, "ends with 1 values"),
    ([(2, FEATURES)], {"weights_0": np.full((2, FEATURES), np.nan)}, "not finite"),
    ([(2, FEATURES)], {"offsets_0": np.array([None, None])}, "allow_pickle"),
    ([(2000, FEATURES), (2, 2000)], {}, "a layer from 41 values"),
    ([(2, FEATURES)], {"offsets_0": np.float32(0.0)}, "unsized"),
    ([(2, FEATURES)], {"weights_0": np.array([["a"] * FEATURES] * 2)}, "not numbers"),
    ([], {}, "ends with 41 values"),
    ([], {"other": np.zeros(2), "one": np.zeros(2)}, "weights_0"),
    ([(2, FEATURES)], {"much": np.zeros(2 ** 21)}, "more than"),
])
def test_a_file_that_is_no_policy_is_refused(tmp_path, shapes, more, said):
    path = write(tmp_path / "bad.npz", shapes, **more)
    with pytest.raises(ValueError, match="bad.npz: .*{}.*; expected layers".format(said)):
        method(policy=path)


def test_text_and_a_missing_file_are_refused(tmp_path):
    path = tmp_path / "text.npz"
    path.write_text("no weights")
    for name in (path, tmp_path / "none.npz"):
        with pytest.raises(ValueError, match="npz: .*expected layers"):
            method(policy=str(name))


def test_driving_needs_no_library_of_learning():
    code = ("import sys; from m2wr_navigation.methods import learned; learned.read_policy(learned._WEIGHTS); "
            "assert not {'torch', 'stable_baselines3', 'gymnasium'} & set(sys.modules)")
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_the_shipped_weights_are_small():
    layers = read_policy(learned._WEIGHTS)
    assert sum(layer.weights.size + layer.offsets.size for layer in layers) < 10000
