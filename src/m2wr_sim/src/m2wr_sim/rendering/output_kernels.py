# SPDX-License-Identifier: BSD-3-Clause
"""From colour and depth to what messages hold: noise, lens distortion, depth images, point clouds."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_sim.sensors.base_kernels import kernel

POINT_STEP = 8          # float32 words of a point: x, y, z, unused, colour, unused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Depths = NDArray[np.float32]
    Numbers = NDArray[np.int32]


@kernel
def add_noise(values: Bytes, normals: Depths, start: int, mean: float, stddev: float) -> None:
    """Add Gaussian noise to each value, and clip.

    Parameters
    ----------
    values : (n,) uint8
        Changed.
    normals : (M,) float32
        Standard normal draws, used round and round.
    start : int
        Index of the first draw.
    mean, stddev : float
        In units of the full range of 255.
    """
    shift, scale, place = np.float32(255.0 * mean + 0.5), np.float32(255.0 * stddev), start
    done = 0
    while done < values.shape[0]:
        count = min(values.shape[0] - done, normals.shape[0] - place)
        for k in range(count):
            value = np.float32(values[done + k]) + shift + scale * normals[place + k]
            value = min(max(value, np.float32(0.0)), np.float32(255.0))
            values[done + k] = np.uint8(value)
        done, place = done + count, 0


@kernel
def warp(out: Bytes, picture: Bytes, sources: Numbers, weights: Depths) -> None:
    """Distort a picture: each pixel is interpolated between four of the source.

    Parameters
    ----------
    out : (n, 3) uint8
        Written.
    picture : (height, width, 3) uint8
    sources : (n, 2) int32
        Row and column of the upper left of the four; negative: the pixel becomes black.
    weights : (n, 2) float32
        Of the lower and of the right ones.
    """
    for k in range(out.shape[0]):
        j, i = sources[k, 0], sources[k, 1]
        for channel in range(3):
            if j < 0:
                out[k, channel] = 0
                continue
            fy, fx = weights[k, 0], weights[k, 1]
            upper = picture[j, i, channel] * (1.0 - fx) + picture[j, i + 1, channel] * fx
            lower = picture[j + 1, i, channel] * (1.0 - fx) + picture[j + 1, i + 1, channel] * fx
            out[k, channel] = np.uint8(upper * (1.0 - fy) + lower * fy + 0.5)


@kernel
def metres(out: Depths, depth: Depths, least: float, most: float) -> None:
    """Write depths [m], NaN unless strictly between two limits.

    Parameters
    ----------
    out, depth : (n,) float32
    least, most : float
        [m].
    """
    for k in range(depth.shape[0]):
        z = depth[k]
        out[k] = z if least < z < most else np.float32(np.nan)


@kernel
def millimetres(out: NDArray[np.uint16], depth: Depths, least: float, most: float) -> None:
    """Write depths in whole millimetres, cut off; 0 unless strictly between two limits [m] and below 65.536 m.

    Parameters
    ----------
    out : (n,) uint16
    depth : (n,) float32
    least, most : float
        [m].
    """
    for k in range(depth.shape[0]):
        z = depth[k]
        out[k] = np.uint16(z * 1000.0) if least < z < most and z < 65.535 else np.uint16(0)


@kernel
def cloud(out: Depths, depth: Depths, colour: Bytes, focal: float, least: float, most: float) -> int:
    """Write an organised point cloud in optical axes.

    Parameters
    ----------
    out : (height, width, 8) float32
        x, y, z [m] or NaN; word 4 holds the bytes blue, green, red, 0.
    depth : (height, width) float32
    colour : (height, width, 3) uint8
        Red, green, blue.
    focal : float
        Focal length [px].
    least, most : float
        A point is valid if its depth [m] is strictly between.

    Returns
    -------
    int
        Number of invalid points.
    """
    height, width = depth.shape
    packed = out.view(np.uint32)
    invalid = 0
    step = 1.0 / focal
    for j in range(height):
        v = (j - 0.5 * (height - 1)) * step
        for i in range(width):
            z = depth[j, i]
            if least < z < most:
                out[j, i, 0] = z * ((i - 0.5 * (width - 1)) * step)
                out[j, i, 1] = z * v
                out[j, i, 2] = z
            else:
                out[j, i, 0] = out[j, i, 1] = out[j, i, 2] = np.float32(np.nan)
                invalid += 1
            out[j, i, 3] = 0.0
            packed[j, i, 4] = (np.uint32(colour[j, i, 0]) << np.uint32(16)) | (
                np.uint32(colour[j, i, 1]) << np.uint32(8)) | np.uint32(colour[j, i, 2])
            out[j, i, 5] = out[j, i, 6] = out[j, i, 7] = 0.0
    return invalid
