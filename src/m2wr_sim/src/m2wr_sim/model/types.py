# SPDX-License-Identifier: BSD-3-Clause
"""Immutable records of a world: both URDF and SDF are converted to them.

Poses are pairs ``((x, y, z), (x, y, z, w))`` in metres and unit quaternions; see :mod:`m2wr_sim.geometry`.
"""
from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Optional, Tuple, Union

import numpy as np

from m2wr_sim.geometry import IDENTITY, Pose, Vector

if TYPE_CHECKING:
    import numpy.typing as npt


@dataclass(frozen=True)
class Box:
    """A box centred on its frame; ``size`` holds the full edge lengths [m]."""

    size: Vector


@dataclass(frozen=True)
class Sphere:
    """A sphere centred on its frame; radius [m]."""

    radius: float


@dataclass(frozen=True)
class Cylinder:
    """A cylinder centred on its frame along its z axis; radius and full length [m]."""

    radius: float
    length: float


@dataclass(frozen=True)
class Plane:
    """The boundary of an infinite half space; ``normal`` in world axes, its offset is in the collision's pose."""

    normal: Vector = (0.0, 0.0, 1.0)
    size: Tuple[float, float] = (1.0, 1.0)   # only for drawing


class _Arrays:
    """Compares records with arrays by the values of the arrays."""

    source: str

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(np.array_equal(mine, others) for mine, others in zip(vars(self).values(), vars(other).values()))

    def __hash__(self) -> int:
        return hash((type(self).__name__, self.source))


@dataclass(frozen=True, eq=False)
class Mesh(_Arrays):
    """Triangles in the collision's frame, counter-clockwise seen from outside; scale and units are applied.

    ``vertices`` is (n, 3) float64 [m], ``triangles`` (m, 3) int32; both are read-only.  ``source`` is the
    file or element they come from, for messages.
    """

    vertices: npt.NDArray[np.float64]
    triangles: npt.NDArray[np.int32]
    source: str = ""


@dataclass(frozen=True, eq=False)
class Heightmap(_Arrays):
    """Terrain over a rectangle around its frame; it is always static.

    ``heights`` is (rows, columns) float64 [m], columns along x and rows *against* y, as in an image; each cell is
    split along the diagonal from least x, least y to greatest x, greatest y.  ``size`` is the extent in x and y [m],
    ``position`` the centre at height 0 in the collision's frame.
    """

    heights: npt.NDArray[np.float64]
    size: Tuple[float, float] = (1.0, 1.0)
    position: Vector = (0.0, 0.0, 0.0)
    source: str = ""


#: Library of the plugin that makes a joint follow another one.
MIMIC_LIBRARY = "libm2wr_mimic.so"

#: After the name of a joint with two axes: its second axis, which can be driven and read like a joint.
SECOND_AXIS = "::axis2"

#: The shape of a collision.
Geometry = Union[Box, Sphere, Cylinder, Plane, Mesh, Heightmap]


@dataclass(frozen=True)
class MeshFile:
    """The mesh of a visual; the file is read when a camera first sees it.

    ``path`` is empty if the file was not found; ``uri`` is what the element names.  ``submesh`` is a part of the file,
    moved to the origin if ``centred``.
    """

    path: str
    uri: str = ""
    scale: Vector = (1.0, 1.0, 1.0)
    submesh: Optional[str] = None
    centred: bool = False


#: The shape of a visual.
VisualGeometry = Union[Geometry, MeshFile]


@dataclass(frozen=True)
class Surface:
    """Contact behaviour of one collision; names and defaults as in SDF."""

    mu: float = 1.0
    mu2: float = 1.0
    fdir1: Vector = (0.0, 0.0, 0.0)
    slip1: float = 0.0
    slip2: float = 0.0
    restitution: float = 0.0
    restitution_threshold: float = 1e5
    kp: float = 1e12
    kd: float = 1.0
    max_vel: float = 0.01
    min_depth: float = 0.0
    collide_bitmask: int = 0xffff
    collide_without_contact: bool = False


@dataclass(frozen=True)
class Collision:
    """A shape that collides and is hit by laser rays; ``pose`` in the link frame."""

    name: str
    geometry: Geometry
    pose: Pose = IDENTITY
    surface: Surface = Surface()
    laser_retro: float = 0.0
    max_contacts: int = 10


@dataclass(frozen=True)
class Visual:
    """A shape for cameras and viewers; ``pose`` in the link frame, ``rgba`` or None, ``material`` script name or None.

    ``scripts`` are files and folders in which the material may be defined.  ``transparency`` is from 0 to 1.
    """

    name: str
    geometry: VisualGeometry
    pose: Pose = IDENTITY
    rgba: Optional[Tuple[float, float, float, float]] = None
    material: Optional[str] = None
    scripts: Tuple[str, ...] = ()
    transparency: float = 0.0
    cast_shadows: bool = True


@dataclass(frozen=True)
class Inertial:
    """Mass [kg], pose of the centre of mass frame in the link frame, tensor in that frame [kg m^2]."""

    mass: float = 1.0
    pose: Pose = IDENTITY
    inertia: Tuple[float, float, float, float, float, float] = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)  # xx xy xz yy yz zz


@dataclass(frozen=True)
class Noise:
    """Sensor noise; ``kind`` is ``none``, ``gaussian`` or ``gaussian_quantized``."""

    kind: str = "none"
    mean: float = 0.0
    stddev: float = 0.0
    bias_mean: float = 0.0
    bias_stddev: float = 0.0
    precision: float = 0.0
    dynamic_bias_stddev: float = 0.0            # of a bias that changes; 0: constant
    dynamic_bias_correlation_time: float = 0.0  # s, of the changing bias


@dataclass(frozen=True)
class RayScan:
    """Geometry of a ray sensor: counts, angles [rad], ranges [m]; names and defaults as in SDF."""

    samples: int = 640
    resolution: float = 1.0
    min_angle: float = 0.0
    max_angle: float = 0.0
    vertical_samples: int = 1
    vertical_resolution: float = 1.0
    vertical_min_angle: float = 0.0
    vertical_max_angle: float = 0.0
    range_min: float = 0.0
    range_max: float = 0.0
    range_resolution: float = 0.0   # has no effect, as in Gazebo
    noise: Noise = Noise()


@dataclass(frozen=True)
class CameraView:
    """One ``<camera>`` of a sensor; names and defaults as in SDF, values as they are written.

    ``pose`` in the sensor's frame; ``field_of_view`` is horizontal [rad]; ``distortion`` holds k1 k2 k3 p1 p2 and its
    centre in x and y as shares of the picture.
    """

    name: str = ""
    pose: Pose = IDENTITY
    width: int = 320
    height: int = 240
    encoding: str = "R8G8B8"
    field_of_view: float = 1.047
    near: float = 0.1
    far: float = 100.0
    noise: Noise = Noise()
    distortion: Tuple[float, float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5)


@dataclass(frozen=True)
class Sensor:
    """A sensor fixed to a link; ``pose`` in that (carrying) link's frame."""

    name: str
    kind: str                       # ray, gpu_ray, imu, contact, camera, ...
    pose: Pose = IDENTITY
    update_rate: float = 0.0        # Hz, 0: every step
    always_on: bool = False
    visualize: bool = False
    ray: Optional[RayScan] = None
    imu_noise: Tuple[Noise, ...] = ()   # empty, or of angular velocity x y z and linear acceleration x y z
    contact_collisions: Tuple[str, ...] = ()    # of a contact sensor: names of collisions of its link
    cameras: Tuple[CameraView, ...] = ()
    plugins: Tuple[PluginSpec, ...] = ()


@dataclass(frozen=True)
class Link:
    """A rigid body; ``pose`` in the model frame, at the model's initial configuration."""

    name: str
    pose: Pose = IDENTITY
    inertial: Inertial = Inertial()
    collisions: Tuple[Collision, ...] = ()
    visuals: Tuple[Visual, ...] = ()
    sensors: Tuple[Sensor, ...] = ()
    gravity: bool = True
    self_collide: bool = False
    kinematic: bool = False
    linear_damping: float = 0.0     # SDF velocity_decay
    angular_damping: float = 0.0


@dataclass(frozen=True)
class Axis:
    """One degree of freedom: direction in the joint frame, damping [N m s/rad], friction [N m], limits, spring.

    ``spring_stiffness`` [N m/rad or N/m] pulls towards the position ``spring_reference`` [rad or m].  ``fudge_factor``,
    from 0 to 1, scales the force of a motor that moves away from a stop; None: the solver's value, 1.
    """

    xyz: Vector = (0.0, 0.0, 1.0)
    damping: float = 0.0
    friction: float = 0.0
    lower: float = -1e16
    upper: float = 1e16
    effort: float = -1.0            # negative: no limit
    velocity: float = -1.0
    stop_erp: float = 0.2
    stop_cfm: float = 0.0
    spring_stiffness: float = 0.0
    spring_reference: float = 0.0
    fudge_factor: Optional[float] = None


@dataclass(frozen=True)
class Joint:
    """A joint between two links; ``pose`` is the joint frame in the child link's frame.

    ``parent`` may be ``world``.  Kinds: revolute (also continuous, with limits of 1e16), prismatic, fixed, ball,
    universal (the only kind with a second axis), and screw: it rotates about its axis and slides along it, its position
    is the angle.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose = IDENTITY
    axis: Axis = Axis()
    axis2: Optional[Axis] = None
    pitch: float = 0.0              # m/rad, of a screw: way along the axis by angle about it

    def axes(self) -> Tuple[Axis, ...]:
        """Return the axes of the joint, the parent's first."""
        if self.kind == "universal":
            x, y, z = self.axis.xyz
            return (self.axis, self.axis2 or Axis(xyz=(y, z, x)))
        return (self.axis,) if self.kind in ("revolute", "prismatic", "screw") else ()

    def along_second(self) -> Joint:
        """Return the second axis as a joint of its own."""
        return replace(self, name=self.name + SECOND_AXIS, kind="revolute", axis=self.axes()[1], axis2=None)


@dataclass(frozen=True)
class PluginSpec:
    """One ``<plugin>`` element.

    ``parameters`` holds (tag, text) pairs in document order; a tag's text comes from the element's text or its
    ``value`` attribute.  ``reference`` names the link a sensor plugin belongs to (None for a model plugin).
    ``where`` is the file and element, for error messages.  For a plugin of a nested model, ``scope`` is that model's
    name, ``inner`` or ``inner::innermost``, and ``frame`` its pose in the outermost model.
    """

    name: str
    filename: str
    parameters: Tuple[Tuple[str, str], ...] = ()
    reference: Optional[str] = None
    where: str = ""
    scope: str = ""
    frame: Pose = IDENTITY

    def find(self, tag: str) -> Optional[str]:
        """Return the stripped text of the first ``tag``, or None if it is missing."""
        for name, text in self.parameters:
            if name == tag:
                return text
        return None


@dataclass(frozen=True)
class Trajectory:
    """Way points of an ``<actor>``: ascending times [s] and poses in world, ``tension`` of the spline from 0 to 1."""

    kind: str
    times: Tuple[float, ...]
    poses: Tuple[Pose, ...]
    tension: float = 0.0


@dataclass(frozen=True)
class ActorScript:
    """The ``<script>`` of an actor: trajectories one after the other; ``delay`` [s] is waited before each cycle."""

    trajectories: Tuple[Trajectory, ...] = ()
    loop: bool = True
    delay: float = 0.0
    auto_start: bool = True


@dataclass(frozen=True)
class Model:
    """A model: links, joints and plugins.  Links of nested models are flattened with scoped names ``inner::link``.

    ``script`` moves an actor.  ``lumped`` maps the name of a link that was merged over a fixed joint to
    ``(carrying link, pose of the merged link's frame in the carrying link's frame)``.
    """

    name: str
    links: Tuple[Link, ...]
    joints: Tuple[Joint, ...] = ()
    pose: Pose = IDENTITY
    static: bool = False
    plugins: Tuple[PluginSpec, ...] = ()
    nested: Tuple[str, ...] = ()                     # names of nested models
    lumped: Tuple[Tuple[str, str, Pose], ...] = ()
    allow_auto_disable: bool = True
    script: Optional[ActorScript] = None
    notes: Tuple[str, ...] = ()                      # warnings about elements that are ignored, one sentence each
    remarks: Tuple[str, ...] = ()                    # elements without effect, for level info


@dataclass(frozen=True)
class Physics:
    """World physics; names and defaults as in SDF."""

    max_step_size: float = 0.001
    real_time_update_rate: float = 1000.0
    gravity: Vector = (0.0, 0.0, -9.8)
    max_contacts: int = 20
    solver: str = "quick"
    iters: int = 50
    precon_iters: int = 0
    sor: float = 1.3
    cfm: float = 0.0
    erp: float = 0.2
    contact_max_correcting_vel: float = 100.0
    contact_surface_layer: float = 0.001


@dataclass(frozen=True)
class ModelStateEntry:
    """The stored state of one model: pose in world, link poses and velocities in world (None where absent)."""

    name: str
    pose: Optional[Pose] = None
    links: Tuple[Tuple[str, Optional[Pose], Optional[Tuple[Vector, Vector]]], ...] = ()  # name, pose, (linear, angular)


@dataclass(frozen=True)
class WorldState:
    """The first ``<state>`` of a world file."""

    sim_time_ns: int = 0
    models: Tuple[ModelStateEntry, ...] = ()


@dataclass(frozen=True)
class Scene:
    """What cameras see besides models: light from everywhere, background, shadows; colours as in :class:`Light`."""

    ambient: Tuple[float, float, float, float] = (0.4, 0.4, 0.4, 1.0)
    background: Tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)
    sky: bool = False
    shadows: bool = True


@dataclass(frozen=True)
class Light:
    """A light, for cameras and the services about lights; colours are red, green, blue, alpha from 0 to 1.

    ``attenuation`` is constant [-], linear [1/m] and quadratic [1/m^2].
    """

    name: str
    kind: str = "point"             # point, spot, directional
    pose: Pose = IDENTITY
    diffuse: Tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    specular: Tuple[float, float, float, float] = (0.1, 0.1, 0.1, 1.0)
    attenuation: Vector = (1.0, 0.0, 0.0)
    direction: Vector = (0.0, 0.0, -1.0)
    cast_shadows: bool = False


@dataclass(frozen=True)
class World:
    """A world: models in load order, physics, lights, optional stored state."""

    name: str = "default"
    models: Tuple[Model, ...] = ()
    physics: Physics = Physics()
    lights: Tuple[Light, ...] = ()
    scene: Scene = Scene()
    plugins: Tuple[PluginSpec, ...] = ()
    state: Optional[WorldState] = None
    notes: Tuple[str, ...] = field(default=())
    remarks: Tuple[str, ...] = ()
