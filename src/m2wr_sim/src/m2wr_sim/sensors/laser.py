# SPDX-License-Identifier: BSD-3-Clause
"""Laser scanner: geometry of the beams, range readings, noise.

Follows Gazebo's CPU ray sensor.  Rays start at the shortest range and hit every collision shape, including those of the
robot itself.  A ray without a hit reads +inf.  Only hits get noise, and are clipped to the range limits.  Nothing reads
-inf, because shapes nearer than the shortest range are not seen.
"""
from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Hashable, Optional, Tuple

import numpy as np

from m2wr_sim.geometry import IDENTITY
from m2wr_sim.model.types import Heightmap, Mesh, RayScan, Sphere
from m2wr_sim.sensors import height_ray_kernels, listing_kernels, mesh_kernels, reading_kernels
from m2wr_sim.sensors import packed_kernels as packed
from m2wr_sim.sensors import ray_kernels as kernels
from m2wr_sim.sensors.noise import NoiseModel
from m2wr_sim.sensors.ray_scene import RayScene
from m2wr_sim.sensors.rays_numpy import cast_heights_numpy, cast_meshes_numpy, cast_rays_numpy

_cast_rays = kernels.cast_rays if kernels.HAVE_NUMBA else cast_rays_numpy
_cast_meshes = mesh_kernels.cast_meshes if kernels.HAVE_NUMBA else cast_meshes_numpy
_cast_heights = height_ray_kernels.cast_heights if kernels.HAVE_NUMBA else cast_heights_numpy
_FEW_SHAPES = 500         # up to so many, looking at all of them in each scan is faster than keeping a list
_MARGIN = 2.0             # m: a list of the shapes nearby serves until the sensor has moved so far
FARTHEST_ANGLE = 1e4      # rad; beyond, the float32 of a message does not resolve a milliradian

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose

    Floats = NDArray[np.float64]
    Ranges = NDArray[np.float32]
    #: For each reading the rays before and after it, and the weight of the latter.
    Neighbours = Tuple[NDArray[np.int64], NDArray[np.int64], Floats]


class LaserSensor:
    """A laser scanner with one row of beams, or several rows above one another.

    Parameters
    ----------
    ray : m2wr_sim.model.types.RayScan
        Numbers of samples, angles [rad], ranges [m] and noise.
    rng : numpy.random.Generator
        Source of the noise.

    Attributes
    ----------
    count, vertical_count : int
        Readings in a row, and number of rows: samples times resolution, rounded down.
    angle_min, angle_max, range_min, range_max : float
        As in ``ray`` [rad, m].
    angle_increment : float
        Angle between readings [rad], (max - min) / (count - 1).  For a single reading it is nan or inf, as in Gazebo's
        messages.
    angles : (count,) float64
        Azimuth of each reading [rad].  A single sample has azimuth 0, whatever the limits are.
    pose : (1, 7) float64
        Pose of the sensor in the world, position x y z [m] and quaternion x y z w.  To be written by the caller, see
        :meth:`cast`.

    Raises
    ------
    ValueError
        If a number of samples is below 1, or an angle or a range is invalid.
    """

    def __init__(self, ray: RayScan, rng: np.random.Generator) -> None:
        self.count = _checked_count("horizontal", ray.samples, ray.resolution)
        self.vertical_count = _checked_count("vertical", ray.vertical_samples, ray.vertical_resolution)
        for name in ('min_angle', 'max_angle', 'vertical_min_angle', 'vertical_max_angle'):
            if not abs(getattr(ray, name)) <= FARTHEST_ANGLE:
                raise ValueError("ray sensor: %s %r: expected a number of at most %g rad either way"
                                 % (name, getattr(ray, name), FARTHEST_ANGLE))
        for name in ('range_min', 'range_max'):
            if not getattr(ray, name) >= 0.0:
                raise ValueError("ray sensor: %s %r: expected a number not below 0" % (name, getattr(ray, name)))
        self.angle_min, self.angle_max = float(ray.min_angle), float(ray.max_angle)
        self.range_min, self.range_max = float(ray.range_min), float(ray.range_max)
        with np.errstate(all='ignore'):
            self.angle_increment = float(np.float64(self.angle_max - self.angle_min) / (self.count - 1))
        azimuths, self._beams = _directions(ray.min_angle, ray.max_angle, ray.samples)
        elevations, upward = _directions(ray.vertical_min_angle, ray.vertical_max_angle, ray.vertical_samples)
        self._rows = np.ascontiguousarray(upward.T)
        self._blend: Optional[Tuple[Neighbours, Neighbours]] = None
        if (self.count, self.vertical_count) != (ray.samples, ray.vertical_samples):
            self._blend = _neighbours(ray.samples, self.count), _neighbours(ray.vertical_samples, self.vertical_count)
        self.angles = azimuths if self.count == ray.samples else np.interp(
            np.linspace(0.0, ray.samples - 1.0, self.count), np.arange(ray.samples), azimuths)

        self._noise = NoiseModel(ray.noise, rng, self.count * self.vertical_count, lazily=True)
        self._distances = np.empty(azimuths.size * elevations.size)
        self._hits, self._no_hits = np.empty(self._distances.size, np.int64), np.empty(0, np.int64)
        self._near = np.empty(0, np.int32)      # rows of the scene to look at; empty: all
        self._listed: Optional[Tuple[RayScene, int, float, float, float]] = None    # scene, version, place of the list
        self._ranges = np.empty(self.count * self.vertical_count, np.float32)
        self._intensities, self._lit = np.zeros_like(self._ranges), False
        self._frame = np.zeros(kernels.FRAME_SIZE)
        self.pose = self._frame[None, :7]
        self._frame[kernels.RANGE_MIN:kernels.COUNT] = (
            self.range_min, self.range_max, azimuths[0], azimuths[1] - azimuths[0] if azimuths.size > 1 else 0.0)
        self._settings = np.array([self.range_min, self.range_max, self._noise.shift, self._noise.stddev,
                                   self._noise.precision, 0.0])
        self._block = np.zeros(packed.SCAN_WORDS, np.uint64) if packed.COMPILED and self._blend is None else None
        self._spheres: Optional[Floats] = None          # tables of the scene whose addresses are in the block
        self._shapes: Optional[Floats] = None

    def cast(self, scene: RayScene, sensor_pose: Optional[Pose] = None,
             ignore_owner: Optional[Hashable] = None) -> Tuple[Ranges, Ranges]:
        """Take a scan.

        Parameters
        ----------
        scene : RayScene
            Shapes that can be hit.
        sensor_pose : ((x, y, z), (x, y, z, w)), optional
            Pose of the sensor in the world; the beam of angle 0 is along its x axis, its z axis is up.  With a pose
            that is not finite nothing is hit.  Default: the pose in the attribute ``pose``.
        ignore_owner : hashable, optional
            Owner in ``scene`` whose shapes are ignored.  Gazebo has no such option.

        Returns
        -------
        ranges : (vertical_count * count,) float32
            Row after row, beginning at the lowest angle: +inf or within [range_min, range_max] [m].
        intensities : (vertical_count * count,) float32
            laser_retro of the shape that is hit, 0 for none.

        Notes
        -----
        The next call overwrites both arrays.
        """
        frame = self._frame
        if sensor_pose is not None:
            frame[0], frame[1], frame[2] = sensor_pose[0]
            frame[3], frame[4], frame[5], frame[6] = sensor_pose[1]
        frame[kernels.COUNT] = scene.count
        frame[kernels.IGNORED] = -1 if ignore_owner is None else scene.owner_id(ignore_owner)
        self._settings[5] = self._noise.advance(self._ranges.size)
        if self._shapes is not scene.shapes:
            self._prepare(scene)
        if scene.count > _FEW_SHAPES:
            self._list_near(scene)
        if self._block is None or scene.has_retro or scene.forest or scene.grounds:
            self._cast_in_steps(scene)
        else:
            packed.scan(self._block)
        if scene.has_retro:
            self._set_intensities(scene.shapes[:, kernels.RETRO])
        elif self._lit:
            self._intensities[:], self._lit = 0.0, False
        return self._ranges, self._intensities

    def packed_scan(self, scene: RayScene) -> Optional[NDArray[np.uint64]]:
        """Return the arguments of :func:`m2wr_sim.sensors.packed_kernels.scan`, for scans by other compiled code.

        Before each of them :meth:`begin_scan` must be called.  They serve as long as no shape is added or removed.

        Parameters
        ----------
        scene : RayScene
            Shapes that can be hit.

        Returns
        -------
        (SCAN_WORDS,) uint64 or None
            None if a scan takes more than this kernel.
        """
        if self._block is None or scene.has_retro or scene.forest or scene.grounds or scene.count > _FEW_SHAPES:
            return None
        self._frame[kernels.COUNT], self._frame[kernels.IGNORED] = scene.count, -1
        if self._shapes is not scene.shapes:
            self._prepare(scene)
        return self._block

    def begin_scan(self) -> None:
        """Choose the noise of the next scan that other compiled code takes."""
        self._settings[5] = self._noise.advance(self._ranges.size)

    def _prepare(self, scene: RayScene) -> None:
        """Prepare for the tables of a scene, which are replaced when they grow."""
        spheres, shapes = self._spheres, self._shapes = scene.spheres, scene.shapes
        self._near, self._listed = self._near[:0], None
        if self._block is not None:
            address = [values.ctypes.data for values in (
                self._distances, self._ranges, self._beams, self._rows, self._frame, spheres, shapes,
                scene.order, self._noise.normals, self._settings, self._near)]
            self._block[:] = (address[:3] + [self._beams.shape[1], address[3], self._rows.shape[0]] + address[4:7]
                              + [shapes.shape[0]] + address[7:9] + [self._noise.normals.size] + address[9:] + [0])

    def _list_near(self, scene: RayScene) -> None:
        """List the shapes to look at, if the sensor or a resting shape has moved too far since the last list."""
        x, y, z = self._frame[:3].tolist()
        if self._listed is not None:
            listed, version, a, b, c = self._listed
            if listed is scene and version == scene.resting_version and (
                    (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2 <= _MARGIN ** 2):
                return
        rows = np.empty(scene.count, np.int32)
        found = listing_kernels.list_near(rows, self._frame, scene.spheres, scene.moves, _MARGIN * (1.0 + 1e-9))
        self._near, self._listed = rows[:found].copy(), (scene, scene.resting_version, x, y, z)
        if self._block is not None:
            self._block[packed.S_NEAR], self._block[packed.S_NEAR_COUNT] = self._near.ctypes.data, found

    def _cast_in_steps(self, scene: RayScene) -> None:
        """Take a scan with separate kernels: for meshes, heightmaps, reflecting shapes, or readings between rays."""
        frame, hits = self._frame, self._hits if scene.has_retro else self._no_hits
        found = _cast_rays(self._distances, hits, self._beams, self._rows, frame, scene.spheres, scene.shapes,
                           scene.order, self._near)
        if scene.forest:
            forest = scene.forest.pack()
            _cast_meshes(self._distances, hits, self._beams, self._rows, frame, scene.spheres, scene.shapes,
                         scene.order, found, forest.nodes, forest.triangles, forest.trees)
        for row, ground in scene.grounds.items():
            _cast_heights(self._distances, hits, row, self._beams, self._rows, frame, scene.spheres[:, row],
                          scene.shapes[row], ground.heights, ground.blocks, ground.levels, ground.frame)
        distances = self._distances if self._blend is None else self._blended(self._distances)
        reading_kernels.finish_ranges(self._ranges, distances, self._noise.normals, self._settings)

    def reset(self, rng: np.random.Generator) -> None:
        """Restart the noise from ``rng``; see :meth:`NoiseModel.reset`."""
        self._noise.reset(rng)

    def restart(self, rng: np.random.Generator) -> None:
        """Restart the noise from ``rng`` and draw its bias, as a new sensor would do."""
        self._noise.restart(rng)
        self._settings[2] = self._noise.shift

    def _corners(self, values: Floats) -> Tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
        """Return the four neighbouring rays of the readings, each (vertical_count, count), and the two weights."""
        assert self._blend is not None
        (left, right, across), (low, high, up) = self._blend
        grid = values.reshape(self._rows.shape[0], -1)
        below, above = grid[low], grid[high]
        return below[:, left], below[:, right], above[:, left], above[:, right], across, up[:, None]

    def _blended(self, distances: Floats) -> Floats:
        """Interpolate between rays. A miss counts as the longest range, as in Gazebo."""
        low_left, low_right, high_left, high_right, across, up = self._corners(distances)
        low = low_left + across * (low_right - low_left)        # exact if both ends are equal
        high = high_left + across * (high_right - high_left)
        return np.ascontiguousarray((low + up * (high - low)).ravel())

    def _set_intensities(self, retro: Floats) -> None:
        values = np.where(self._hits >= 0, retro[self._hits], 0.0)
        if self._blend is not None:
            values = np.ravel(0.25 * sum(self._corners(values)[:4]))
        self._intensities[:], self._lit = values, True


def warm_up(rng: np.random.Generator) -> None:
    """Compile the kernels, or load them from their cache, before the first scan."""
    scene, sensor = RayScene(2), LaserSensor(RayScan(samples=2, range_max=2.0), rng)
    row = scene.add(Sphere(1.0), IDENTITY, "warm_up")
    scene.mover(np.array([row], np.int64), np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]))()
    sensor.cast(scene, IDENTITY)
    sensor._list_near(scene)
    scene.add(Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32)), IDENTITY, "warm_up")
    scene.add(Heightmap(np.zeros((2, 2))), IDENTITY, "warm_up")
    sensor.cast(scene, IDENTITY)


def _checked_count(direction: str, samples: int, resolution: float) -> int:
    readings = samples * resolution
    if samples < 1 or not 1.0 <= readings < math.inf:
        raise ValueError("ray sensor: %s samples %r, resolution %r: expected at least one sample and one reading"
                         % (direction, samples, resolution))
    return int(readings)


@lru_cache(maxsize=64)
def _directions(least: float, most: float, samples: int) -> Tuple[Floats, Floats]:
    """Return the angles [rad] of rays, (samples,), and their cosines and sines, (2, samples), not to be changed."""
    angles = _ray_angles(least, most, samples)
    directions = np.ascontiguousarray([np.cos(angles), np.sin(angles)])
    angles.flags.writeable = False
    return angles, directions


def _ray_angles(least: float, most: float, samples: int) -> Floats:
    if samples == 1:
        return np.zeros(1)
    return np.arange(samples) * ((most - least) / (samples - 1)) + least


def _neighbours(rays: int, readings: int) -> Neighbours:
    """Return, for each reading, the rays before and after it and the weight of the latter."""
    place = np.arange(readings) * ((rays - 1) / (readings - 1)) if readings > 1 else np.zeros(1)
    before = np.minimum(place.astype(np.int64), rays - 1)
    return before, np.minimum(before + 1, rays - 1), place - before
