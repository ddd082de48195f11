# SPDX-License-Identifier: BSD-3-Clause
"""Cells that beams cross, beside the same by arrays."""
import math

import numpy as np

from m2wr_sim.sensors.coverage_kernels import mark_crossed


def test_cells_on_drawn_beams():
    known, parts = np.zeros((4, 8), bool), np.zeros((2, 2), np.int64)
    along = np.array([(1.0, 0.0), (0.0, -1.0)])         # a cell is 1 m: to the right, and out of the grid
    assert mark_crossed(np.array([2.9, 5.0]), along, 1.0, np.array([0.4, 1.2]), known, parts) == 4
    assert known.nonzero()[0].tolist() == [0, 1, 1, 1] and known[1, :3].all() and known[0, 0]
    assert parts.tolist() == [[4, 0], [0, 0]]


def test_random_beams_mark_the_cells_of_their_points():
    random = np.random.default_rng(4)
    known, parts, expected = np.zeros((32, 48), bool), np.zeros((16, 16), np.int64), np.zeros((32, 48), bool)
    for _ in range(20):
        ranges, angles = random.uniform(0.0, 9.0, 30), random.uniform(-math.pi, math.pi, 30)
        along, start = 3.0 * np.column_stack((np.cos(angles), np.sin(angles))), random.uniform(0.0, 30.0, 2)
        before = np.count_nonzero(expected)
        for length, beam in zip(ranges, along):
            for share in np.arange(0.05, length, 0.1):
                column, row = share * beam + start
                if 0 <= row < 32 and 0 <= column < 48:
                    expected[int(row), int(column)] = True
        assert mark_crossed(ranges, along, 0.1, start, known, parts) == np.count_nonzero(expected) - before
    assert np.array_equal(known, expected)
    assert np.array_equal(parts, expected.reshape(16, 2, 16, 3).sum(axis=(1, 3)))


def test_beams_without_length_mark_nothing():
    known, parts = np.zeros((2, 2), bool), np.zeros((1, 1), np.int64)
    assert mark_crossed(np.array([0.0, np.nan]), np.ones((2, 2)), 1.0, np.zeros(2), known, parts) == 0
