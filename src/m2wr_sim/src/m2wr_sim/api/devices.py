# SPDX-License-Identifier: BSD-3-Clause
"""A robot's drive, lasers and cameras with records instead of messages; times and numbers are those of the plugins."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Sequence, Tuple, Type, TypeVar

import numpy as np

from m2wr_sim.api.records import Odometry, Picture, Scan
from m2wr_sim.control.diff_drive import wheel_speeds
from m2wr_sim.geometry import Quaternion, Vector
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader
from m2wr_sim.plugins.camera import Camera
from m2wr_sim.plugins.depth_camera import DepthCamera, OpenniKinect
from m2wr_sim.plugins.diff_drive import DiffDrive
from m2wr_sim.plugins.laser import Laser
from m2wr_sim.runtime.ports import Ports
from m2wr_sim.runtime.simulator import Simulator

if TYPE_CHECKING:
    import numpy.typing as npt

    from m2wr_sim.sensors.laser import LaserSensor

#: When a robot senses: at the rates of its description, at the end of each step, or (lasers) not at all.
SENSING = ("due", "now", "off")


class DirectDrive(DiffDrive):
    """The differential drive: :meth:`command` sets the velocity, ``odometry`` holds the newest measurement.

    Attributes
    ----------
    odometry : Odometry or None
        The newest.
    timely : bool
        Whether it measures at its rate even without callbacks.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self.odometry: Optional[Odometry] = None
        self.callbacks: List[Callable[[Odometry], object]] = []
        self.timely = True
        super().configure(spec, ctx)

    @property
    def wheel_radius(self) -> float:
        """Radius by which commands become wheel speeds [m]."""
        return self._radius

    @property
    def steady(self) -> bool:
        """Whether its updates only set its motors, to the same as long as the command is the same."""
        return not (self._encoder is not None or self._acceleration > 0.0 or self._command.expires or self.timely
                    or self.callbacks)

    def skip_updates(self, end_ns: int) -> None:
        """Leave out all updates up to a time [ns]."""
        self._schedule.skip(end_ns)

    @property
    def joints(self) -> Tuple[int, int]:
        """The engine's numbers of the joints that it drives as left and right."""
        return self._left, self._right

    def wheel_rates(self, now_ns: int) -> Tuple[float, float]:
        """Return the rates of both wheels by the command in effect, without a limit of acceleration.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].

        Returns
        -------
        (float, float)
            Left and right [rad/s].
        """
        linear, _, angular = self._command.at(now_ns)
        left, right = wheel_speeds(linear, angular, self._separation, self._swapped)
        return left / self._radius, right / self._radius

    def motion_reader(self, motion: npt.NDArray[np.float64]) -> Callable[[], None]:
        """Return a function that writes the true pose and velocity of the robot into a (13,) array.

        See :meth:`m2wr_sim.plugins.base.PluginContext.motion_reader`.
        """
        return self._ctx.motion_reader(motion)

    def measure_now(self, now_ns: int) -> Odometry:
        """Measure and return the odometry at ``now_ns`` [ns], also between two updates."""
        self.odometry = Odometry(now_ns / 1e9, *self._values())
        return self.odometry

    def _values(self) -> Tuple[Vector, Quaternion, float, float, float]:
        position, orientation, twist = self.measure()
        return position, orientation, twist[0], twist[1], twist[2]

    def _send_odometry(self, stamp: int) -> None:
        if not (self.timely or self.callbacks):
            return
        self.odometry = Odometry(stamp / 1e9, *self._values())
        for callback in self.callbacks:
            callback(self.odometry)

    def reset(self, now_ns: int, rewound: bool) -> None:
        """Restore the initial state; unlike in Gazebo the motors stop too.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        rewound : bool
            Whether simulated time was set back to zero.
        """
        super().reset(now_ns, rewound)
        self.odometry = None
        if rewound:
            self._instructed = (0.0, 0.0)
            self.turn_wheels(0.0, 0.0)


class DirectLaser(Laser):
    """A laser that always measures at its rate, also without subscribers.

    Attributes
    ----------
    scan : Scan or None
        The newest.
    enabled : bool
        Whether it measures at its rate.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self.scan: Optional[Scan] = None
        self.enabled = True
        self.callbacks: List[Callable[[Optional[Scan]], object]] = []
        super().configure(spec, ctx)

    @property
    def name(self) -> str:
        """The sensor's name in the robot description."""
        return self._ctx.sensor.name

    @property
    def sensor(self) -> LaserSensor:
        """The laser itself."""
        return self._laser

    @property
    def pose_reader(self) -> Callable[[], None]:
        """The function that writes the pose of the laser, see :meth:`m2wr_sim.physics.engine.Engine.pose_reader`."""
        return self._update_pose

    @property
    def angles(self) -> npt.NDArray[np.float64]:
        """Direction of each beam of a row in the laser's frame [rad]."""
        return self._laser.angles

    @property
    def count(self) -> int:
        """Number of readings in a scan, all rows together."""
        return self._laser.count * self._laser.vertical_count

    @property
    def range_max(self) -> float:
        """Longest range [m]."""
        return self._laser.range_max

    def wanted(self) -> bool:
        return self.enabled

    def after_step(self, now_ns: int) -> None:
        if self.awake and self._schedule.due(now_ns):
            self.measure_now(now_ns)
            for callback in self.callbacks:
                callback(self.scan)

    def measure_now(self, now_ns: int) -> Scan:
        """Measure and return a scan at ``now_ns`` [ns]; it draws from the noise as any other scan."""
        laser = self._laser
        ranges, intensities = self.measure()
        self.scan = Scan(now_ns / 1e9, ranges.copy(), intensities.copy(), laser.angles, laser.angle_min,
                         laser.angle_max, laser.angle_increment, laser.range_min, laser.range_max)
        return self.scan

    def reset(self, now_ns: int, rewound: bool) -> None:
        self.scan = None
        if rewound:
            self._schedule.restart()
            self._laser.restart(self._ctx.rng("noise"))     # its bias depends on the seed


class DirectCamera(Camera):
    """A camera, or the colour and depth of a depth camera, that takes pictures on demand.

    Attributes
    ----------
    callbacks : list of callable
        Each gets every Picture; while there is one, pictures are taken at the rate of the description.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self.callbacks: List[Callable[[Picture], object]] = []
        super().configure(spec, ctx)

    @property
    def name(self) -> str:
        """The sensor's name in the robot description."""
        return self._ctx.sensor.name

    def wanted(self) -> bool:
        return bool(self.callbacks)

    def after_step(self, now_ns: int) -> None:
        if self.awake and self._sensed.due(now_ns) and self._sent.due(now_ns):
            picture = self.measure_now(now_ns)
            for callback in self.callbacks:
                callback(picture)

    def measure_now(self, now_ns: int) -> Picture:
        """Take and return a picture at ``now_ns`` [ns]; it draws from the noise as any other."""
        colour, depth = self.measure()
        pinhole = self._eye.pinhole
        return Picture(now_ns / 1e9, colour.copy(), np.where(depth < pinhole.far, depth, np.float32(np.inf)),
                       pinhole.focal)


_Device = TypeVar("_Device", bound=Plugin)
_DIRECT: Dict[Type[Plugin], Type[Plugin]] = {DiffDrive: DirectDrive, Laser: DirectLaser, Camera: DirectCamera,
                                             DepthCamera: DirectCamera, OpenniKinect: DirectCamera}


class DirectSimulator(Simulator):
    """The simulator with these devices instead of the plugins that use messages."""

    @staticmethod
    def plugin_class(filename: str) -> Optional[Type[Plugin]]:
        found = Simulator.plugin_class(filename)
        return found if found is None else _DIRECT.get(found, found)

    def devices(self, name: str, kind: Type[_Device]) -> List[_Device]:
        """Return the devices of one kind of a model, in the order of its description.

        Parameters
        ----------
        name : str
            Name of the model.
        kind : type
            :class:`DirectDrive`, :class:`DirectLaser` or :class:`DirectCamera`.
        """
        return [plugin for plugin, _, _ in self.models[name].plugins if isinstance(plugin, kind)]


class _SilentPort:
    """A topic without subscribers."""

    @staticmethod
    def publish(message: Any) -> None:
        """Drop the message."""

    @staticmethod
    def wanted() -> bool:
        """Return False: there are no subscribers, so sensors do not measure."""
        return False

    @staticmethod
    def publishers() -> int:
        """Return 0: there are no publishers."""
        return 0

    @staticmethod
    def close() -> None:
        """Do nothing."""


class SilentPorts(Ports):
    """Ports without topics, transforms and clock, for all other plugins."""

    def advertise(self, topic: str, message_class: type, queue_size: int, namespace: str) -> Any:
        return _SilentPort()

    def subscribe(self, topic: str, message_class: type, callback: Callable[[Any], object], namespace: str,
                  keep: int = 1) -> Any:
        return _SilentPort()

    def serve(self, name: str, service_class: type, handler: Callable[[Any], Any], namespace: str) -> Any:
        return _SilentPort()

    def deliver(self) -> None:
        pass

    def transform(self, stamp: Any, parent: str, child: str, position: Sequence[float],
                  orientation: Sequence[float]) -> None:
        pass

    def moment(self, now_ns: int) -> int:
        return now_ns

    def frame(self, name: str, namespace: str) -> str:
        return name.lstrip("/")

    def clock(self, now_ns: int) -> None:
        pass
