# SPDX-License-Identifier: BSD-3-Clause
"""Writes ground as a world in SDF, with a picture of its heights or with meshes, one for each friction."""
from __future__ import annotations

import os
import struct
from typing import TYPE_CHECKING, List, Sequence

import numpy as np
from PIL import Image

from m2wr_campaign.terrain.relief import PATCHES, patch_cells, triangles_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_campaign.terrain.relief import Grid

    Array = NDArray[np.float64]

WORLD = "terrain.world"
_COLOURS = {"ground": "0.45 0.40 0.32", "sand": "0.85 0.75 0.50", "mud": "0.30 0.20 0.12", "ice": "0.80 0.90 0.95"}
_WORLD = """<?xml version="1.0"?>
<sdf version="1.6">
  <world name="terrain">
    <include><uri>model://sun</uri></include>
    <model name="terrain">
      <static>true</static>
      <link name="ground">
{parts}
      </link>
    </model>
  </world>
</sdf>
"""
_PART = """        <collision name="{name}">
          <geometry>{geometry}</geometry>
          <surface><friction><ode><mu>{mu:g}</mu><mu2>{mu:g}</mu2></ode></friction></surface>
        </collision>
        <visual name="{name}_visual">
          <geometry>{geometry}</geometry>
          <material><ambient>{colour} 1</ambient><diffuse>{colour} 1</diffuse></material>
        </visual>"""


def write_heightmap(folder: str, grid: Grid, heights: Array, bits: int) -> List[str]:
    """Write a world with a heightmap.

    Parameters
    ----------
    folder : str
        Exists.
    grid : Grid
    heights : (samples, samples) float64
        [m]
    bits : int
        16, or 8: of the picture.

    Returns
    -------
    list of str
        The paths of the files, the world first.
    """
    low, high = float(heights.min()), float(heights.max())
    span, most = max(high - low, 1e-3), 2 ** bits - 1
    levels = np.round((heights - low) / span * most).astype(np.uint16 if bits == 16 else np.uint8)
    if levels.max() < most:                 # level ground: the brightest pixel has the height of <size>
        span *= max(float(levels.max()), 1.0) / most
    picture = os.path.abspath(os.path.join(folder, "heights.png"))
    Image.fromarray(levels).save(picture)
    geometry = "<heightmap><uri>file://{}</uri><size>{:g} {:g} {:.6g}</size><pos>0 0 {:.6g}</pos>" \
        "<sampling>1</sampling></heightmap>".format(picture, grid.size, grid.size, span, low)
    part = _PART.format(name="ground", geometry=geometry, mu=PATCHES["ground"], colour=_COLOURS["ground"])
    return [_write_world(folder, [part]), picture]


def write_meshes(folder: str, grid: Grid, heights: Array, which: NDArray[np.int64], names: Sequence[str]) -> List[str]:
    """Write a world with one mesh for each patch, as binary STL, whose collisions have friction of their own.

    Parameters
    ----------
    folder : str
        Exists.
    grid : Grid
    heights : (samples, samples) float64
        [m]
    which : (samples - 1, samples - 1) int64
        See :func:`m2wr_campaign.terrain.relief.patches_of`.
    names : sequence of str
        Of the patches from 1 on.

    Returns
    -------
    list of str
        The paths of the files, the world first.
    """
    x, y = grid.places
    points = np.stack((x, y, heights), -1)
    parts, paths = [], []
    for name, chosen in patch_cells(which, names):
        path = os.path.abspath(os.path.join(folder, name + ".stl"))
        _write_stl(path, points, chosen)
        paths.append(path)
        geometry = "<mesh><uri>file://{}</uri></mesh>".format(path)
        parts.append(_PART.format(name=name, geometry=geometry, mu=PATCHES[name], colour=_COLOURS[name]))
    return [_write_world(folder, parts), *paths]


def _write_stl(path: str, points: Array, chosen: NDArray[np.bool_]) -> None:
    """Write the two triangles of each chosen cell, split along the same diagonal as a heightmap."""
    corners = triangles_of(points, chosen)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows = np.zeros(len(corners), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]))
    rows["normal"] = normals / np.linalg.norm(normals, axis=1)[:, None]
    rows["corners"] = corners
    with open(path, "wb") as file:
        file.write(b"terrain".ljust(80) + struct.pack("<I", len(rows)) + rows.tobytes())


def _write_world(folder: str, parts: List[str]) -> str:
    path = os.path.abspath(os.path.join(folder, WORLD))
    with open(path, "w", encoding="utf-8") as file:
        file.write(_WORLD.format(parts="\n".join(parts)))
    return path


def picture(grid: Grid, heights: Array, which: NDArray[np.int64], names: Sequence[str]) -> Image.Image:
    """Return a shaded picture of the ground from above, light from the upper left, patches in their colours.

    Parameters
    ----------
    grid : Grid
    heights : (samples, samples) float64
        [m]
    which : (samples - 1, samples - 1) int64
    names : sequence of str
        Of the patches from 1 on.

    Returns
    -------
    PIL.Image.Image
        768 pixels a side.
    """
    along = (heights[:-1, 1:] - heights[:-1, :-1]) / grid.cell
    up = (heights[:-1, :-1] - heights[1:, :-1]) / grid.cell
    light = np.array((-1.0, 1.0, 1.2)) / np.sqrt(3.44)
    bright = (light[2] - light[0] * along - light[1] * up) / np.sqrt(1.0 + along ** 2 + up ** 2)
    middle = heights[:-1, :-1]
    level = (middle - middle.min()) / max(float(np.ptp(middle)), 1e-9)
    colours = np.array([[float(part) for part in _COLOURS[name].split()] for name in ["ground", *names]])
    shaded = colours[which] * (0.35 + 0.75 * np.clip(bright, 0.0, 1.0) + 0.35 * level)[..., None]
    image = Image.fromarray((255.0 * np.clip(shaded, 0.0, 1.0)).astype(np.uint8))
    return image.resize((768, 768), Image.BILINEAR)
