# SPDX-License-Identifier: BSD-3-Clause
"""Columns of a VoxelGrid are read as the original writes them, and refused with a reason."""
import numpy as np
import pytest

from m2wr_navigation.costmap.voxel_columns import VoxelError, centres

SIDES = (0.1, 0.2, 0.5)


def test_bits_are_cells_and_their_centres_have_the_right_places():
    columns = [0, 1 << 1, 0, (1 << 2) | (1 << 18), 0, (1 << 16) - 1]        # free, unknown, marked, all unknown
    marked, unknown = centres(columns, (3, 2, 3), (-1.0, 2.0, 0.0), SIDES)
    assert marked.tolist() == [pytest.approx([-0.95, 2.3, 1.25])]
    assert len(unknown) == 4                                                # bits above the size are no cells
    assert unknown[1] == pytest.approx([-0.85, 2.1, 0.75])
    assert sorted(unknown[unknown[:, 0] > -0.8, 2]) == pytest.approx([0.25, 0.75, 1.25])


@pytest.mark.parametrize("count, size, origin, sides", [
    (5, (3, 2, 3), (0.0, 0.0, 0.0), SIDES), (6, (3, 2, 17), (0.0, 0.0, 0.0), SIDES),
    (6, (3, 2, 0), (0.0, 0.0, 0.0), SIDES), (6, (3, 2, 3), (np.nan, 0.0, 0.0), SIDES),
    (6, (3, 2, 3), (0.0, 0.0, 0.0), (0.1, 0.0, 0.1)), (6, (0, 0, 3), (0.0, 0.0, 0.0), SIDES)])
def test_grids_that_do_not_fit_are_refused(count, size, origin, sides):
    with pytest.raises(VoxelError, match="expected"):
        centres([0] * count, size, origin, sides)
