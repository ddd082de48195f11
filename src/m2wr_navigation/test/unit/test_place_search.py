# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

import localization_room
from localization_room import room, scan, settings
from m2wr_maps.se2 import compose
from m2wr_navigation.localization.localizer import Localizer
from m2wr_navigation.localization.place_search import COPIES, DROPPED, PlaceSearch

TRUE = np.array([1.2, 1.6, 0.7])
IMAGE = np.array([6.0 - 1.2, 4.0 - 1.6, 0.7 - np.pi])       # after half a turn about the middle of the room
WALLS = localization_room.BOXES[:4]
PILLAR = np.array([(4.2, 0.8, 4.5, 1.1)])                   # the only thing that differs after half a turn


@pytest.fixture
def bare(monkeypatch):
    """The room with its walls only."""
    monkeypatch.setattr(localization_room, "BOXES", WALLS)


@pytest.fixture
def pillar(monkeypatch):
    """The room with its walls and a pillar."""
    monkeypatch.setattr(localization_room, "BOXES", np.concatenate([WALLS, PILLAR]))


def near(pose, other):
    return np.hypot(*(pose - other)[:2]) < 0.1 and abs((pose[2] - other[2] + np.pi) % (2.0 * np.pi) - np.pi) < 0.05


def looked(count, particles=None):
    """A search that has looked at scans from one place."""
    search, grid = PlaceSearch(), room()
    particles = np.array([TRUE + 0.1, IMAGE - 0.1, (3.0, 3.0, 0.0)]) if particles is None else particles
    for _ in range(count):
        if search.decided:
            break
        search.look(particles, np.zeros(len(particles)), scan(TRUE), grid, settings())
    return search


def test_places_that_look_the_same_are_all_kept(bare):
    search = looked(40)
    assert len(search.poses) == 2 and not search.decided
    assert any(near(pose, TRUE) for pose in search.poses) and any(near(pose, IMAGE) for pose in search.poses)
    assert search.probabilities.min() > 0.1


def test_a_pillar_decides_after_a_while(pillar):
    assert not looked(1).decided
    search = looked(200)
    assert search.decided and near(search.poses[0], TRUE)


def test_a_place_that_does_not_fit_is_dropped_at_once():
    search = looked(1)
    assert not any(near(pose, np.array([3.0, 3.0, 0.0])) for pose in search.poses)
    assert search.evidence.max() == 0.0 and search.evidence.min() >= -DROPPED


def test_a_place_that_appears_late_can_win(pillar):
    search = looked(1, np.array([IMAGE]))
    for _ in range(40):
        search.look(np.array([TRUE, IMAGE]), np.zeros(2), scan(TRUE), room(), settings())
    assert near(search.poses[0], TRUE) and search.probabilities[0] > 0.9


def test_places_move_with_the_robot(bare):
    search = looked(1)
    before = search.poses.copy()
    search.move(np.array([5.0, 5.0, 1.0]), compose([5.0, 5.0, 1.0], [0.3, 0.0, 0.2]))
    np.testing.assert_allclose(search.poses, compose(before, [0.3, 0.0, 0.2]), atol=1e-9)


def test_a_place_without_particles_gets_some(bare):
    search = looked(1)
    particles = np.concatenate([np.tile(TRUE, (50, 1)), np.tile((3.0, 3.0, 0.0), (50, 1))])
    found, weights = search.share_out(particles, np.full(100, 0.01), np.random.default_rng(0))
    assert len(found) == 100 + COPIES and weights.sum() == pytest.approx(1.0)
    at_image = np.hypot(*(found - IMAGE)[:, :2].T) < 0.5
    assert at_image.sum() == COPIES and 0.1 < weights[at_image].sum() < 0.9
    assert weights[50:100].sum() == pytest.approx(0.01, rel=0.02)       # in no place


def test_a_robot_in_one_of_two_equal_places_is_not_certain(bare):
    found = Localizer(room(), settings(), np.random.default_rng(1))
    found.start_anywhere()
    pose = TRUE
    for _ in range(25):
        outcome = found.process("laser", scan(pose), pose)
        pose = compose(pose, [0.06, 0.0, 0.1])
    assert found.filter.search is not None and not found.filter.certain
    assert outcome.weight < 0.95 and not found.calibration.errors.any()


def test_a_start_at_a_pose_ends_the_search(bare):
    found = Localizer(room(), settings(), np.random.default_rng(1))
    found.start_anywhere()
    found.process("laser", scan(TRUE), TRUE)
    found.start_at(TRUE, np.diag([0.01, 0.01, 0.01]))
    assert found.filter.search is None
