# SPDX-License-Identifier: BSD-3-Clause
"""A room with a known map, for tests of localization: what a laser sees there, in closed form."""
import numpy as np

from m2wr_navigation.localization.amcl_parameters import PARAMETERS
from m2wr_navigation.localization.beams import Beams, ScanGeometry
from m2wr_navigation.localization.localization_map import LocalizationMap

CELL = 0.05
#: Boxes x0, y0, x1, y1 [m] in a room of 6 x 4 m; no symmetry.
BOXES = np.array([(0.0, 0.0, 6.0, 0.2), (0.0, 3.8, 6.0, 4.0), (0.0, 0.0, 0.2, 4.0), (5.8, 0.0, 6.0, 4.0),
                  (2.0, 0.2, 2.6, 1.0), (4.4, 2.8, 5.0, 3.8)])
GEOMETRY = ScanGeometry(-np.pi, 2.0 * np.pi / 180.0, 0.05, 8.0)
MOUNT = ((0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))


def room(turn=0.0, origin=(0.0, 0.0)):
    """The map of the room, its grid turned by an angle and moved; poses in the room stay poses of the room's frame."""
    cells = np.zeros((80, 120), np.int8)
    for x0, y0, x1, y1 in np.rint(BOXES / CELL).astype(int):
        cells[y0:y1, x0:x1] = 100
    return LocalizationMap.from_message(cells.ravel(), 120, 80, CELL, (origin[0], origin[1], turn))


def ranges(pose, geometry=GEOMETRY, mount=MOUNT, count=180):
    """Ranges (count,) that a laser measures from a pose of the base."""
    x = pose[0] + np.cos(pose[2]) * mount[0][0] - np.sin(pose[2]) * mount[0][1]
    y = pose[1] + np.sin(pose[2]) * mount[0][0] + np.cos(pose[2]) * mount[0][1]
    angles = pose[2] + geometry.angle_min + geometry.angle_increment * np.arange(count)
    nearest = np.full(count, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for x0, y0, x1, y1 in BOXES:
            a, b = (x0 - x) / np.cos(angles), (x1 - x) / np.cos(angles)
            c, d = (y0 - y) / np.sin(angles), (y1 - y) / np.sin(angles)
            near = np.maximum(np.minimum(a, b), np.minimum(c, d))
            far = np.minimum(np.maximum(a, b), np.maximum(c, d))
            nearest = np.where((near <= far) & (near > 0.0), np.minimum(nearest, near), nearest)
    return nearest


def scan(pose):
    """The beams of a scan from a pose."""
    return Beams.from_scan(ranges(pose), GEOMETRY, MOUNT)


def settings(**others):
    """All parameters of amcl, some with other values than their defaults."""
    values = {name: parameter.default for name, parameter in PARAMETERS.items()}
    assert set(others) <= set(values)
    return dict(values, **others)
