# SPDX-License-Identifier: BSD-3-Clause
"""A camera without a lens: takes pictures of a :class:`~m2wr_sim.rendering.picture_scene.PictureScene`."""
from __future__ import annotations

import math

import numpy as np

from m2wr_sim.model.mesh.surfaces import Surface
from m2wr_sim.model.mesh.textures import Texture
from m2wr_sim.rendering import output_kernels, raster_kernels, shade_kernels, shadow_kernels
from m2wr_sim.rendering import picture_layout as layout
from m2wr_sim.rendering.picture_scene import Lighting, Part, PictureScene

MOST_PIXELS = 8192              # in a row or column
MOST_IN_ALL = 16 * 2 ** 20      # pixels of a picture
LEAST_VIEW, WIDEST_VIEW = 0.01, 3.1     # rad; outside of this, a flat picture has no use
FARTHEST = 1e6                  # m

#: World-from-optical for a camera whose frame is that of the world: x of the picture is -y, y is -z, depth is x.
_OPTICAL = np.array(((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))


class Camera:
    """A pinhole camera with square pixels.

    Parameters
    ----------
    width, height : int
        [px].
    field_of_view : float
        Horizontal [rad].
    near, far : float
        Limits of the depth [m]; nothing outside is seen.

    Attributes
    ----------
    focal : float
        Focal length [px].
    colour : (height, width, 3) uint8
        The last picture: red, green, blue.
    depth : (height, width) float32
        Distance along the optical axis [m]; ``far`` where nothing is seen.
    pose : (1, 7) float64
        Pose in the world, position x y z [m] and quaternion x y z w; the camera looks along its x axis, its z axis is
        up.  To be written by the caller, see :meth:`take`.

    Raises
    ------
    ValueError
        If a value is outside of its limits.
    """

    def __init__(self, width: int, height: int, field_of_view: float, near: float, far: float) -> None:
        for name, value in (("width", width), ("height", height)):
            if not 1 <= value <= MOST_PIXELS:
                raise ValueError("camera: image %s %r: expected 1 to %d pixels" % (name, value, MOST_PIXELS))
        if width * height > MOST_IN_ALL:
            raise ValueError("camera: image of %d x %d pixels: expected at most %d in all"
                             % (width, height, MOST_IN_ALL))
        if not LEAST_VIEW <= field_of_view <= WIDEST_VIEW:
            raise ValueError("camera: horizontal_fov %r: expected %g to %g rad"
                             % (field_of_view, LEAST_VIEW, WIDEST_VIEW))
        if not 0.0 < near < far <= FARTHEST:
            raise ValueError("camera: clip near %r, far %r: expected 0 < near < far <= %g m" % (near, far, FARTHEST))
        self.width, self.height, self.near, self.far = int(width), int(height), float(near), float(far)
        self.focal = width / (2.0 * math.tan(0.5 * field_of_view))
        self.colour = np.zeros((height, width, 3), np.uint8)
        self.depth = np.full((height, width), far, np.float32)
        self.pose = np.zeros((1, 7))
        self.pose[0, 6] = 1.0
        self._owner, self._faces = np.empty((height, width), np.int32), np.empty((height, width), np.int32)
        self._lit = np.empty((height, width), np.uint8)
        self._tiles = np.empty((-(-height // layout.TILE), -(-width // layout.TILE)), np.float32)
        self._view = np.zeros(layout.VIEW_SIZE)
        self._view[layout.V_FOCAL:layout.VIEW_SIZE] = (
            self.focal, 0.5 * (width - 1), 0.5 * (height - 1), self.near, self.far)

    def take(self, scene: PictureScene, colour: bool = True) -> None:
        """Take a picture at ``pose`` and write it to ``depth`` and ``colour``.

        With a pose that is not finite nothing is seen.

        Parameters
        ----------
        scene : PictureScene
        colour : bool
            Whether colours are needed; otherwise only ``depth`` is written.
        """
        scene.prepare()
        self._place()
        self.visits = self._find_surfaces(scene)
        if not colour:
            return
        lighting = scene.lighting
        shadowed, self.rays = lighting.shadowed, 0
        if shadowed >= 0:
            self.rays = shadow_kernels.find_shadows(
                self._lit, self.depth, self._owner, self._faces, self._view, lighting.lights[shadowed], scene.parts,
                np.stack((scene.resting.row, scene.moving.row)), scene.resting.nodes, scene.resting.order,
                scene.moving.nodes, scene.moving.order, scene.meshes, scene.mesh_nodes, scene.triangles,
                scene.looks)
        shade_kernels.shade(
            self.colour, self.depth, self._owner, self._faces, self._lit, shadowed, self._view, scene.parts,
            scene.triangles, scene.looks, scene.images, scene.texels, lighting.lights, lighting.ambient, lighting.sky)

    def _place(self) -> None:
        x, y, z, w = self.pose[0, 3:]
        norm = x * x + y * y + z * z + w * w
        s = 2.0 / norm if norm > 1e-24 else 0.0
        turn = np.array(((1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
                         (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
                         (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y))))
        self._view[layout.V_POSITION:layout.V_POSITION + 3] = self.pose[0, :3]
        self._view[layout.V_ROTATION:layout.V_ROTATION + 9] = (turn @ _OPTICAL).ravel()

    def _find_surfaces(self, scene: PictureScene) -> int:
        """Find the nearest surface of each pixel; returns how many boxes of the trees were visited."""
        self.depth.fill(self.far)
        self._owner.fill(-1)
        self._tiles.fill(self.far)
        if not np.all(np.isfinite(self._view)):
            return 0
        return sum(raster_kernels.draw_tree(
            self.depth, self._owner, self._faces, self._tiles, self._view, scene.parts, tree.row, tree.nodes,
            tree.order, scene.meshes, scene.mesh_nodes, scene.triangles)
            for tree in (scene.moving, scene.resting, scene.ground))


def warm_up() -> None:
    """Compile the kernels, or load them from their cache, before the first picture."""
    scene, camera = PictureScene(), Camera(16, 16, 1.0, 0.1, 10.0)
    texture = Texture(np.zeros((2, 2, 3), np.uint8))
    corners = np.array((((2.0, 1.0, -1.0), (2.0, -1.0, -1.0), (2.0, 0.0, 1.0)),))
    surface = Surface(corners, np.ones((1, 3)), np.zeros((1, 3, 2)), (texture,), np.zeros(1, np.int64))
    here = ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    scene.add_all([Part(layout.BOX, (0.1, 0.1, 0.1), (1.0, 1.0, 1.0), texture)], [here], "warm_up", False)
    scene.add_all([Part(layout.MESH, surface)], [here], "warm_up", True)
    lights = np.zeros((1, layout.LIGHT_SIZE))
    lights[0, layout.L_DIRECTIONAL], lights[0, layout.L_PLACE + 2], lights[0, layout.L_SHADOW] = 1.0, 1.0, 1.0
    scene.lighting = Lighting(lights)
    camera.take(scene)
    values = camera.depth.ravel()
    output_kernels.add_noise(camera.colour.reshape(-1), np.zeros(8, np.float32), 0, 0.0, 0.1)
    output_kernels.metres(np.empty_like(values), values, 0.1, 10.0)
    output_kernels.millimetres(np.empty(values.size, np.uint16), values, 0.1, 10.0)
    output_kernels.cloud(np.empty((16, 16, output_kernels.POINT_STEP), np.float32), camera.depth, camera.colour,
                         camera.focal, 0.1, 10.0)
    output_kernels.warp(np.empty((4, 3), np.uint8), camera.colour, np.zeros((4, 2), np.int32),
                        np.zeros((4, 2), np.float32))
