# SPDX-License-Identifier: BSD-3-Clause
"""Contents of messages as arrays and back: clouds of points, layers of grid maps, meshes.  Messages are untrusted."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

MOST_POINTS = 500000        # of a cloud
ROBOT = 0.7                 # m around the middle of another robot in which points may be on it
_FLOATS = {7: "<f4", 8: "<f8"}      # of sensor_msgs/PointField


def points_of(cloud: Any) -> Values:
    """Return the points (n, 3) of a sensor_msgs/PointCloud2.

    Raises
    ------
    ValueError
        If it is too large, has no fields x, y and z of floats, or less data than it says.
    """
    count = int(cloud.width) * int(cloud.height)
    if count > MOST_POINTS:
        raise ValueError("{} points; expected at most {}".format(count, MOST_POINTS))
    if cloud.is_bigendian:
        raise ValueError("big-endian numbers; expected little-endian ones")
    if cloud.point_step <= 0 or len(cloud.data) < count * cloud.point_step:
        raise ValueError("{} bytes for {} points of {} bytes".format(len(cloud.data), count, cloud.point_step))
    if not count:
        return np.zeros((0, 3))
    fields = {field.name: field for field in cloud.fields}
    columns = []
    for name in "xyz":
        field = fields.get(name)
        kind = _FLOATS.get(field.datatype) if field is not None else None
        if field is None or kind is None or field.offset + int(kind[-1]) > cloud.point_step:
            raise ValueError("no field {} of type FLOAT32 or FLOAT64 within a point".format(name))
        column: NDArray[Any] = np.ndarray((count,), kind, bytes(cloud.data), field.offset, (cloud.point_step,))
        columns.append(column.astype(np.float64))
    return np.column_stack(columns)


def layer_data(layer: Values) -> "NDArray[np.float32]":
    """Return the numbers of a layer in the order of grid_map_msgs: from the greatest x and y on, column by column.

    Parameters
    ----------
    layer : (rows along y, columns along x) float64
    """
    return np.ascontiguousarray(layer[::-1, ::-1], np.float32).ravel()


def occupancy(traversability: Values) -> "NDArray[np.int8]":
    """Return costs of a nav_msgs/OccupancyGrid: 0 level, 99 nearly forbidden, 100 forbidden, -1 unknown.

    Parameters
    ----------
    traversability : (rows, columns) float64
    """
    cost = np.where(traversability <= 0.0, 100.0, np.round(99.0 * (1.0 - traversability)))
    return np.where(np.isnan(cost), -1.0, cost).astype(np.int8)


def surface(height: Values, traversability: Values, corner: Tuple[float, float], cell: float,
            most: int = 20000) -> Tuple[Values, Values]:
    """Return corners (n, 3) [m] and colours (n, 3) of triangles over all known cells, three corners each.

    Parameters
    ----------
    height, traversability : (rows, columns) float64
    corner : (float, float)
        Least x and y [m].
    cell : float
        [m]
    most : int
        Triangles; cells are left out evenly until there are no more.

    Returns
    -------
    (n, 3) float64, (n, 3) float64
        Red is forbidden, green level, grey unknown traversability.
    """
    step = 1
    while 2 * (height.shape[0] // step) * (height.shape[1] // step) > most:
        step += 1
    height, good = height[::step, ::step], traversability[::step, ::step]
    rows, columns = height.shape
    x = corner[0] + (np.arange(columns) * step + 0.5) * cell
    y = corner[1] + (np.arange(rows) * step + 0.5) * cell
    points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], height), axis=2).reshape(-1, 3)
    share = np.nan_to_num(good.ravel(), nan=0.5)[:, None]
    colours = np.clip(np.where(np.isnan(good.ravel())[:, None], 0.5,
                               share * (0.1, 0.7, 0.3) + (1.0 - share) * (0.85, 0.2, 0.1)), 0.0, 1.0)
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    triangles = np.concatenate((np.stack((a, b, d), axis=1), np.stack((a, d, c), axis=1)))
    chosen = triangles[np.isfinite(points[triangles][..., 2]).all(axis=1)].ravel()
    return points[chosen], colours[chosen]


def without(points: Values, rotation: Values, position: Values, places: Sequence[Tuple[float, float]]) -> Values:
    """Return a cloud with the points on other robots as nan.

    Parameters
    ----------
    points : (n, 3) float64
        In the frame of the sensor [m].
    rotation, position : (3, 3), (3,) float64
        Of the sensor in the map.
    places : sequence of (float, float)
        Of the robots in the map [m].
    """
    x, y = points @ rotation[0] + position[0], points @ rotation[1] + position[1]
    near = np.zeros(len(points), bool)
    for place in places:
        near |= (x - place[0]) ** 2 + (y - place[1]) ** 2 < ROBOT ** 2
    return np.where(near[:, None], np.nan, points)
