# SPDX-License-Identifier: BSD-3-Clause
"""Base classes of plugins, access to their tags, and the context in which they run.

A plugin may run at two points of a simulation step. ``before_step`` runs when simulated time has advanced but the
bodies have not moved yet. There commands become motor targets and odometry is published, as in Gazebo's model plugins.
``after_step`` runs on the state that the step produced. There sensors measure. The engine asks a plugin in advance when
it wants to run next; until then it steps without calling the plugin.
"""
from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Sequence, Tuple, Type, TypeVar

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Pose, Quaternion, Vector
from m2wr_sim.plugins.tags import PluginReader

if TYPE_CHECKING:
    import logging

    import numpy as np
    from numpy.random import Generator
    from numpy.typing import NDArray

    from m2wr_sim.model.types import ActorScript, Joint, Link
    from m2wr_sim.physics.engine import Engine, LinkState
    from m2wr_sim.rendering.picture_scene import PictureScene

__all__ = ["NEVER", "LazySensor", "Plugin", "PluginContext", "PluginReader", "driven_joint"]

NEVER = None

Shared = TypeVar("Shared", bound="Plugin")


class Plugin(abc.ABC):
    """Base of all plugins; see the module docstring for the order of calls."""

    places_model = False        # whether it alone moves the model: forces and contacts do not

    @abc.abstractmethod
    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        """Read parameters and set up what the plugin uses of its context.

        Parameters
        ----------
        spec : PluginReader
            The plugin's tags.
        ctx : PluginContext
            The plugin's model, the physics, and its topics and services.

        Raises
        ------
        PluginError
            If the plugin cannot work; the simulation continues without it.
        """

    def next_before(self, now_ns: int) -> Optional[int]:
        """Return the time [ns] of the next step that needs ``before_step``, or NEVER."""
        return NEVER

    def before_step(self, now_ns: int) -> None:
        """Act at the beginning of the step that ends at ``now_ns``."""

    def next_after(self, now_ns: int) -> Optional[int]:
        """Return the time [ns], later than ``now_ns``, of the next ``after_step``, or NEVER."""
        return NEVER

    def after_step(self, now_ns: int) -> None:
        """Act on the state at ``now_ns``."""

    def period_ns(self) -> Optional[int]:
        """Return the simulated time [ns] between two messages: 0 for every step, NEVER if there is no fixed period."""
        return getattr(getattr(self, "_schedule", None), "period_ns", NEVER)

    def reset(self, now_ns: int, rewound: bool) -> None:
        """Discard all state that depends on the past.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        rewound : bool
            Whether simulated time was set back to zero.
        """

    def close(self) -> None:
        """Release all resources; called before the model is removed."""


class LazySensor(Plugin):
    """A sensor that measures only while it has subscribers, and restarts when the first one connects.

    A subclass defines whether there are subscribers (:meth:`wanted`), what a restart does (:meth:`wake`), and when the
    next reading is due. Its ``after_step`` does nothing unless it is ``awake``.
    """

    awake = False

    @abc.abstractmethod
    def wanted(self) -> bool:
        """Return whether there are subscribers."""

    @abc.abstractmethod
    def wake(self, now_ns: int) -> None:
        """Discard what was measured before the subscribers left."""

    @abc.abstractmethod
    def next_reading(self, now_ns: int) -> int:
        """Return the time [ns], later than ``now_ns``, of the next reading."""

    def next_after(self, now_ns: int) -> Optional[int]:
        """Return the time [ns] of the next reading, or NEVER without subscribers."""
        if not self.wanted():
            self.awake = False
            return NEVER
        if not self.awake:
            self.awake = True
            self.wake(now_ns)
        return self.next_reading(now_ns)


def driven_joint(ctx: PluginContext, spec: PluginReader, name: str) -> int:
    """Return the engine's number of a joint that a motor will drive.

    Parameters
    ----------
    ctx : PluginContext
    spec : PluginReader
        The plugin, for error messages.
    name : str
        Name of the joint.

    Raises
    ------
    PluginError
        If there is no such joint, or a motor cannot drive it.
    """
    number, kind = ctx.joint(name), ctx.joint_record(name).kind
    if kind in ("fixed", "ball"):
        raise PluginError("%s: joint \"%s\" of type %s cannot be driven; expected a joint with an axis"
                          % (spec.spec.where, name, kind))
    return number


class PluginContext(abc.ABC):
    """What a plugin can use: its model, the physics, random numbers, topics and services."""

    model_name: str = ""
    sensor: Any = None                  # model.types.Sensor, for sensor plugins
    sensor_link: Any = None             # engine's number of the link that carries the sensor
    sensor_collisions: Tuple[str, ...] = ()     # names of that link's collisions, without model and link
    script: Optional[ActorScript] = None    # of an actor
    now_ns: int = 0                     # simulated time at configuration
    physics: Engine
    scene: Any = None                   # what rays can hit
    log: logging.Logger
    wheel_convention: str = "noetic"
    command_timeout_ns: int = 0         # 0: a command stays active until the next one, as in Gazebo

    @property
    @abc.abstractmethod
    def step_ns(self) -> int:
        """The present step size [ns]; a service may change it."""

    @property
    @abc.abstractmethod
    def time_ns(self) -> int:
        """The present simulated time [ns]."""

    @abc.abstractmethod
    def parameter(self, name: str) -> Any:
        """Return the value of a parameter, which may be a mapping of parameters, or None if it is not set.

        Parameters
        ----------
        name : str
            With a leading slash.
        """

    def log_once(self, level: int, text: str, *values: object) -> None:
        """Log a message about the configuration, unless it was logged for another model of this description.

        Parameters
        ----------
        level : int
            Level of the logging module.
        text : str
            Format of the message.
        *values : object
            Values for the format.
        """
        self.log.log(level, text, *values)

    @abc.abstractmethod
    def link(self, name: str) -> int:
        """Return the engine's number of a link of this model; a PluginError lists the links that exist."""

    @abc.abstractmethod
    def first_link(self) -> str:
        """Return the name of the model's first link."""

    @abc.abstractmethod
    def find_sensor(self, name: str, kind: str) -> Tuple[Any, int, Tuple[str, ...]]:
        """Find a sensor of this model.

        Parameters
        ----------
        name : str
        kind : str
            ``ray`` stands for gpu_ray, too.

        Returns
        -------
        sensor : m2wr_sim.model.types.Sensor
        link : int
            The engine's number of the link that carries it.
        collisions : tuple of str
            ``model::link::collision`` names of the collisions that a contact sensor names.

        Raises
        ------
        PluginError
            If there is none; the message lists those that exist.
        """

    @abc.abstractmethod
    def joint(self, name: str) -> int:
        """Return the engine's number of a joint of this model; a PluginError lists the joints that exist."""

    @abc.abstractmethod
    def join(self, joint: Joint) -> int:
        """Add a joint to this model and return the engine's number of it.

        Parameters
        ----------
        joint : m2wr_sim.model.types.Joint
            Of links as the description names them; the parent may be ``world``.

        Raises
        ------
        PluginError
            If a link does not exist, or the model cannot have this joint.
        """

    @abc.abstractmethod
    def joint_record(self, name: str) -> Joint:
        """Return the :class:`~m2wr_sim.model.types.Joint` of that name."""

    @abc.abstractmethod
    def joint_above(self, link: str) -> Optional[Joint]:
        """Return the joint whose child a link is, or None."""

    @abc.abstractmethod
    def joint_position(self, name: str) -> Vector:
        """Return the position [m] of a joint's anchor in the model frame, in the initial configuration."""

    @abc.abstractmethod
    def model_state(self) -> LinkState:
        """Return pose and velocity of the frame of the model's canonical link in the world frame."""

    @abc.abstractmethod
    def motion_reader(self, motion: NDArray[np.float64]) -> Callable[[], None]:
        """Return a function that writes what :meth:`model_state` returns, faster.

        Parameters
        ----------
        motion : (13,) float64
            Written by the function: position x y z [m], orientation x y z w, linear [m/s] and angular velocity [rad/s].
        """

    @abc.abstractmethod
    def pose_in_model(self, link: int) -> Pose:
        """Return the present ``(position, orientation)`` of a link in the model frame."""

    @abc.abstractmethod
    def link_record(self, name: str) -> Link:
        """Return the :class:`~m2wr_sim.model.types.Link` of that name, with the mass and inertia in effect."""

    @abc.abstractmethod
    def collision_name(self, name: str) -> str:
        """Return the ``model::link::collision`` name of a collision of the sensor's link."""

    @abc.abstractmethod
    def set_motion(self, linear: Vector, angular: Vector) -> None:
        """Set the velocity of the whole model.

        Each link gets the velocity of a rigid motion of the model. Rotations about joints are kept.

        Parameters
        ----------
        linear : (3,) float
            Velocity [m/s] of the origin of the model frame, in world axes.
        angular : (3,) float
            Angular velocity [rad/s], in world axes.
        """

    @abc.abstractmethod
    def link_places(self) -> List[Tuple[int, Pose, Vector]]:
        """Return the engine's numbers of all links of the whole model.

        Returns
        -------
        list of (int, pose, (3,) float)
            With the initial pose in the model frame, and the centre of mass in the link frame [m].
        """

    @abc.abstractmethod
    def shared(self, plugin_class: Type[Shared]) -> Shared:
        """Return the world's only plugin of a class, which plugins of many models use together.

        The first call makes it, without arguments; it is not configured. It is called before the plugin that asked
        first, and stays until the world ends.

        Parameters
        ----------
        plugin_class : type
        """

    @abc.abstractmethod
    def hand_over(self, function: Callable[[Any], object], message: Any) -> None:
        """Call a function as a part of this plugin: if it raises an exception, this plugin is switched off.

        Parameters
        ----------
        function : callable
        message : object
            Its argument.
        """

    @abc.abstractmethod
    def refresh_scene(self) -> None:
        """Update the poses of all moving obstacles in ``scene``."""

    @abc.abstractmethod
    def refresh_pictures(self) -> PictureScene:
        """Return what cameras see, with the poses of all models up to date."""

    @abc.abstractmethod
    def rng(self, name: str) -> Generator:
        """Return a random generator for this plugin only, made from the seed and ``name``."""

    @abc.abstractmethod
    def moment(self, now_ns: int) -> Any:
        """Return the time stamp of a message."""

    @abc.abstractmethod
    def frame(self, name: str, namespace: str = "") -> str:
        """Return a frame name with the tf prefix that applies in the plugin's namespace.

        Parameters
        ----------
        name : str
            Frame name of the description.
        namespace : str
            ROS namespace of the plugin.
        """

    @abc.abstractmethod
    def advertise(self, topic: str, message_class: type, queue_size: int = 10, namespace: Optional[str] = None) -> Any:
        """Return a port with ``publish(message)`` and ``wanted()``, which returns whether there are subscribers.

        Parameters
        ----------
        topic : str
        message_class : type
        queue_size : int
            Number of messages to keep for each slow subscriber.
        namespace : str, optional
            ROS namespace of the topic.
        """

    @abc.abstractmethod
    def subscribe(self, topic: str, message_class: type, callback: Callable[[Any], object],
                  namespace: Optional[str] = None, keep: int = 1) -> Any:
        """Deliver messages to a callback between two steps, in the thread of the simulation.

        Parameters
        ----------
        topic : str
        message_class : type
        callback : callable
            Gets the message.
        namespace : str, optional
            ROS namespace of the topic.
        keep : int
            Number of messages to keep between two deliveries, the newest ones.

        Returns
        -------
        object
            For :meth:`release`; its ``publishers()`` returns how many nodes publish the topic.
        """

    @abc.abstractmethod
    def serve(self, name: str, service_class: type, handler: Callable[[Any], Any],
              namespace: Optional[str] = None) -> Any:
        """Offer a service.

        Parameters
        ----------
        name : str
        service_class : type
        handler : callable
            Gets the request and returns the response, in the thread of the simulation.
        namespace : str, optional
            ROS namespace of the service.

        Returns
        -------
        object
            For :meth:`release`.
        """

    @abc.abstractmethod
    def release(self, port: Any) -> None:
        """Close a topic or service before the plugin ends."""

    @abc.abstractmethod
    def send_transform(self, stamp: Any, parent: str, child: str, position: Sequence[float],
                       orientation: Quaternion) -> None:
        """Publish one transform on ``/tf``.

        Parameters
        ----------
        stamp : time stamp of a message
        parent, child : str
            Frame names.
        position : (3,) float
            Origin [m] of the child frame in the parent frame.
        orientation : (4,) float
            Quaternion x y z w of the child frame in the parent frame.
        """
