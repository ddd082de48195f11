# SPDX-License-Identifier: BSD-3-Clause
"""Measure a scan: ``python3 -m m2wr_tools.benchmark.rays`` prints microseconds and the ratio to the plain method.

The plain method casts every beam against every obstacle, with the same arithmetic for one ray.  The worlds are a walled
square of 24 m with boxes and cylinders, larger squares of the same density, boxes of triangles, and heightmaps.  The
robot is level, or tilted by 2 degrees; the result is the median over many places.
"""
from __future__ import annotations

import math
import random
import sys
import timeit
from functools import partial
from typing import TYPE_CHECKING, Callable, List, Optional, Union

import numpy as np

from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Box, Cylinder, Heightmap, Mesh, Noise, Plane, RayScan
from m2wr_sim.sensors import ray_kernels as kernels
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.range_kernels import sweep
from m2wr_sim.sensors.ray_scene import RayScene

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

SCAN = RayScan(samples=720, min_angle=-0.5 * math.pi, max_angle=0.5 * math.pi, range_min=0.1, range_max=10.0,
               noise=Noise(kind="gaussian", stddev=0.01))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
WORLDS = (("60 obstacles, 24 m", 60, 24.0, None), ("600, 76 m", 600, 76.0, None), ("2000, 139 m", 2000, 139.0, None),
          ("2000 pillars of 5 cm, 24 m", 2000, 24.0, 0.05))     # name, obstacles, side [m], radius of pillars [m]


_BOX_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_BOX_FACES = np.array(((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6),
                       (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)), np.int32)


def make_scene(obstacles: int, side: float, pillar: Optional[float] = None, seed: int = 1) -> RayScene:
    """Return a walled square on a ground plane, with boxes and cylinders, or thin pillars only.

    Parameters
    ----------
    obstacles : int
        Number of obstacles, the four walls included.
    side : float
        Length of a side of the square [m].
    pillar : float, optional
        Radius of the pillars [m].
    seed : int
        Of the random places and sizes.
    """
    draw, scene = random.Random(seed), RayScene(obstacles + 1)
    scene.add(Plane(), ((0.0, 0.0, 0.0), UPRIGHT), "ground")
    half = 0.5 * side
    for x, y, size in ((half, 0.0, (0.2, side, 2.0)), (-half, 0.0, (0.2, side, 2.0)),
                       (0.0, half, (side, 0.2, 2.0)), (0.0, -half, (side, 0.2, 2.0))):
        scene.add(Box(size), ((x, y, 1.0), UPRIGHT), "wall")
    for k in range(obstacles - 4):
        place = (draw.uniform(-half, half), draw.uniform(-half, half), 0.5)
        yaw = quaternion_from_rpy(0.0, 0.0, draw.uniform(-math.pi, math.pi))
        shape: Union[Box, Cylinder]
        if pillar is not None:
            shape = Cylinder(pillar, 1.0)
        elif k % 2:
            shape = Cylinder(draw.uniform(0.1, 0.5), 1.0)
        else:
            shape = Box((draw.uniform(0.2, 1.5), draw.uniform(0.2, 1.5), 1.0))
        scene.add(shape, (place, yaw), k)
    return scene


def make_house(boxes: int, seed: int = 1) -> RayScene:
    """Return one mesh of boxes in a square of 24 m, like a building with all walls in one file.

    Parameters
    ----------
    boxes : int
        Number of boxes.
    seed : int
        Of the random places and sizes.
    """
    draw, corners, faces = random.Random(seed), [], []
    for index in range(boxes):
        yaw = draw.choice((0.0, 0.5 * math.pi, draw.uniform(-math.pi, math.pi)))
        size = draw.uniform(0.2, 3.0), draw.uniform(0.1, 0.3), 1.5
        place = draw.uniform(-11.0, 11.0), draw.uniform(-11.0, 11.0)
        turn = np.array(((math.cos(yaw), -math.sin(yaw), 0.0), (math.sin(yaw), math.cos(yaw), 0.0), (0.0, 0.0, 1.0)))
        corners.append((_BOX_CORNERS * size) @ turn.T + (place[0], place[1], 0.7))
        faces.append(_BOX_FACES + 8 * index)
    scene = RayScene()
    scene.add(Mesh(np.concatenate(corners), np.concatenate(faces)), ((0.0, 0.0, 0.0), UPRIGHT), "house")
    return scene


def make_hills(samples: int) -> RayScene:
    """Return a heightmap of 24 m, up to 1.1 m high, that beams at half a metre hit often."""
    ticks = np.linspace(-12.0, 12.0, samples)
    heights = 0.5 + 0.6 * np.sin(0.9 * ticks)[None, :] * np.cos(0.7 * ticks)[:, None]
    scene = RayScene()
    scene.add(Heightmap(heights, (24.0, 24.0)), ((0.0, 0.0, 0.0), UPRIGHT), "hills")
    return scene


@kernels.kernel
def cast_all(ranges: FloatArray, beams: FloatArray, frame: FloatArray, spheres: FloatArray, shapes: FloatArray) -> None:
    """Cast each beam of a single row against each obstacle.

    Parameters
    ----------
    ranges : (n,) float64
        Result [m].
    beams, frame, spheres, shapes : float64 arrays
        As for :func:`m2wr_sim.sensors.ray_kernels.cast_rays`.
    """
    sensor = kernels.rotation(frame[3], frame[4], frame[5], frame[6])
    nearest = frame[kernels.RANGE_MIN]
    ranges[:] = frame[kernels.RANGE_MAX]
    for row in range(int(frame[kernels.COUNT])):
        b = shapes[row]
        a, half = kernels.product(b, sensor), (b[9], b[10], b[11])
        cx, cy, cz = spheres[0, row] - frame[0], spheres[1, row] - frame[1], spheres[2, row] - frame[2]
        x = (a[0], a[1], 0.0, -(b[0] * cx + b[3] * cy + b[6] * cz))
        y = (a[3], a[4], 0.0, -(b[1] * cx + b[4] * cy + b[7] * cz))
        z = (a[6], a[7], 0.0, -(b[2] * cx + b[5] * cy + b[8] * cz))
        if b[kernels.KIND] != kernels.PLANE:        # the ground, which these beams do not reach
            sweep(int(b[kernels.KIND]), False, ranges, beams[0], beams[1], x, y, z, half, nearest)


def median_time(function: Callable[[], object], repeats: int) -> float:
    """Return the median time of one call [us].

    Parameters
    ----------
    function : callable
        Without arguments.
    repeats : int
        Number of measurements of 5 calls.
    """
    function()
    times = sorted(timeit.repeat(function, number=5, repeat=repeats))
    return times[len(times) // 2] / 5 * 1e6


def measure(scene: RayScene, side: float, tilt: float, places: int = 15, seed: int = 2) -> List[float]:
    """Return the median times [us] of the whole scan, of its kernel and of the plain kernel.

    Parameters
    ----------
    scene : m2wr_sim.sensors.ray_scene.RayScene
        The world.
    side : float
        Length of a side of the square [m].
    tilt : float
        Roll and pitch of the robot [rad].
    places : int
        Number of random places of the robot.
    seed : int
        Of the random places and sizes.
    """
    draw, times = random.Random(seed), []
    sensor = LaserSensor(SCAN, np.random.default_rng(seed))
    frame, distances = sensor._frame, sensor._distances
    for _ in range(places):
        reach = 0.5 * side - 1.0
        pose = ((draw.uniform(-reach, reach), draw.uniform(-reach, reach), 0.5),
                quaternion_from_rpy(tilt, tilt, draw.uniform(-math.pi, math.pi)))
        whole = median_time(partial(sensor.cast, scene, pose), 41)
        kernel = median_time(lambda: kernels.cast_rays(distances, sensor._no_hits, sensor._beams, sensor._rows, frame,
                                                       scene.spheres, scene.shapes, scene.order, sensor._near), 41)
        plain = median_time(lambda: cast_all(distances, sensor._beams, frame, scene.spheres, scene.shapes), 1)
        times.append((whole, kernel, plain))
    return [sorted(column)[places // 2] for column in zip(*times)]


def measure_whole(scene: RayScene, tilt: float, side: float = 24.0, places: int = 15, seed: int = 2) -> float:
    """Return the median time of the whole scan [us].

    Parameters
    ----------
    scene : m2wr_sim.sensors.ray_scene.RayScene
        The world.
    tilt : float
        Roll and pitch of the robot [rad].
    side : float
        Length of a side of the square [m].
    places : int
        Number of random places of the robot.
    seed : int
        Of the random places and sizes.
    """
    draw, times = random.Random(seed), []
    sensor, reach = LaserSensor(SCAN, np.random.default_rng(seed)), 0.5 * side - 1.0
    for _ in range(places):
        pose = ((draw.uniform(-reach, reach), draw.uniform(-reach, reach), 0.5),
                quaternion_from_rpy(tilt, tilt, draw.uniform(-math.pi, math.pi)))
        times.append(median_time(partial(sensor.cast, scene, pose), 11))
    return sorted(times)[places // 2]


MESHES = (("60 boxes in one mesh", make_house, 60), ("300 boxes in one mesh", make_house, 300),
          ("hills of 129 x 129", make_hills, 129), ("hills of 513 x 513", make_hills, 513))


def main() -> None:
    """Print the table."""
    if not kernels.HAVE_NUMBA:
        sys.exit("bench: numba is not installed, there is no fast kernel to time")
    lines = ["%-38s %10s %10s %10s %8s" % ("world", "scan us", "kernel us", "plain us", "ratio")]
    for name, count, side, pillar in WORLDS:
        scene = make_scene(count, side, pillar)
        for posture, tilt in (("level", 0.0), ("tilted", math.radians(2.0))):
            whole, kernel, plain = measure(scene, side, tilt)
            lines.append("%-38s %10.1f %10.1f %10.0f %8.0f"
                         % (name + ", " + posture, whole, kernel, plain, plain / kernel))
    for name, make, count in MESHES:
        scene = make(count)
        for posture, tilt in (("level", 0.0), ("tilted", math.radians(2.0))):
            lines.append("%-38s %10.1f" % (name + ", " + posture, measure_whole(scene, tilt)))
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
