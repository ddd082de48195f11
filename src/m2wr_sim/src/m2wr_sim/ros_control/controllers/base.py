# SPDX-License-Identifier: BSD-3-Clause
"""Base class of controllers, and what a controller can use: its parameters, topics, services and joints."""
from __future__ import annotations

import abc
import math
from typing import TYPE_CHECKING, Any, Callable, List, NoReturn, Optional, Sequence, Tuple

from m2wr_sim.errors import PluginError

if TYPE_CHECKING:
    from m2wr_sim.plugins.base import PluginContext
    from m2wr_sim.ros_control.description import RobotDescription
    from m2wr_sim.ros_control.hardware import JointHandle, RobotHardware


class Controller(abc.ABC):
    """A controller: it is configured once, then started and stopped any number of times."""

    #: Hardware interface whose joints it claims, see :mod:`m2wr_sim.ros_control.hardware`.
    interface: str = ""

    def __init__(self) -> None:
        self.joints: List[JointHandle] = []

    @abc.abstractmethod
    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        """Read parameters, and set :attr:`joints` to the joints that it claims.

        Parameters
        ----------
        node : ControllerNode
        hardware : RobotHardware

        Raises
        ------
        PluginError
            If the controller cannot work.
        """

    def starting(self, now_ns: int) -> None:
        """Begin to control; the first :meth:`update` follows in the next control cycle."""

    @abc.abstractmethod
    def update(self, now_ns: int, dt: float) -> None:
        """Compute the commands; ``dt`` [s] is the time since the last control cycle.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        dt : float
            Time since the last call [s].
        """

    def stopping(self, now_ns: int) -> None:
        """End to control."""


class ControllerNode:
    """Parameters, topics and services of a controller, below ``ROBOT_NAMESPACE/NAME``.

    Parameters
    ----------
    ctx : PluginContext
        Of the plugin that runs the controllers.
    robot : str
        Namespace of the robot, with a leading slash.
    name : str
        Name of the controller.
    values : dict
        Its parameters.
    description : RobotDescription
    """

    def __init__(self, ctx: PluginContext, robot: str, name: str, values: Any, description: RobotDescription) -> None:
        self._ctx, self.robot, self.name = ctx, robot.rstrip("/"), name
        self.namespace = "%s/%s" % (self.robot, name.strip("/"))
        self._values, self.description = values, description
        self.log = ctx.log
        self._ports: List[Any] = []
        self.send_transform = ctx.send_transform
        self.moment = ctx.moment

    @property
    def now_ns(self) -> int:
        """Simulated time [ns]."""
        return self._ctx.time_ns

    # ---- parameters ---------------------------------------------------------------------------------------------

    def value(self, name: str, default: Any = None) -> Any:
        """Return a parameter of any type; ``name`` may have slashes.

        Parameters
        ----------
        name : str
        default : object, optional
        """
        found = self._values
        for part in name.split("/"):
            if not isinstance(found, dict) or part not in found:
                return default
            found = found[part]
        return found

    def fail(self, name: str, expected: str) -> NoReturn:
        """Raise the error about a parameter with an invalid value.

        Parameters
        ----------
        name : str
        expected : str
            What a valid value is.

        Returns
        -------
        NoReturn

        Raises
        ------
        PluginError
            For any other value.
        """
        raise PluginError("%s/%s: read %r; expected %s" % (self.namespace, name, self.value(name), expected))

    def number(self, name: str, default: Optional[float] = None, least: float = -math.inf) -> float:
        """Return a finite number.

        Parameters
        ----------
        name : str
        default : float, optional
            Of a missing parameter.
        least : float
            Least valid value.

        Raises
        ------
        PluginError
            For any other value, and if the parameter is missing and there is no default.
        """
        value = self.value(name, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value < least:
            self.fail(name, "a finite number" + ("" if least == -math.inf else " of at least %g" % least))
        return float(value)

    def numbers(self, name: str, count: int) -> List[float]:
        """Return a list of finite numbers; PluginError for anything else.

        Parameters
        ----------
        name : str
        count : int
        """
        values = self.value(name)
        if not isinstance(values, (list, tuple)) or len(values) != count or not all(
                isinstance(value, (int, float)) and math.isfinite(value) for value in values):
            self.fail(name, "a list of %d finite numbers" % count)
        return [float(value) for value in values]

    def flag(self, name: str, default: bool) -> bool:
        """Return a boolean; PluginError for anything else.

        Parameters
        ----------
        name : str
        default : object, optional
        """
        value = self.value(name, default)
        if not isinstance(value, (bool, int)):
            self.fail(name, "true or false")
        return bool(value)

    def names(self, name: str) -> List[str]:
        """Return a list of texts, which may be written as one text; PluginError for anything else."""
        values = self.value(name)
        values = [values] if isinstance(values, str) else values
        if not isinstance(values, (list, tuple)) or not values or not all(
                isinstance(value, str) and value for value in values):
            self.fail(name, "a name or a list of names")
        if len(set(values)) != len(values):
            self.fail(name, "each name once")
        return list(values)

    # ---- topics and services ------------------------------------------------------------------------------------

    def advertise(self, topic: str, message_class: type, queue_size: int = 10, of_robot: bool = False) -> Any:
        """Open a topic for publishing, below the namespace of the controller or, if ``of_robot``, of the robot.

        Parameters
        ----------
        topic : str
        message_class : type
        queue_size : int
        of_robot : bool

        Returns
        -------
        object
        """
        port = self._ctx.advertise(topic, message_class, queue_size, self.robot or "/" if of_robot else self.namespace)
        self._ports.append(port)
        return port

    def subscribe(self, topic: str, message_class: type, callback: Callable[[Any], object], keep: int = 1) -> Any:
        """Subscribe to a topic; of more than ``keep`` messages between two steps the oldest are dropped.

        Parameters
        ----------
        topic : str
        message_class : type
        callback : callable
        keep : int

        Returns
        -------
        object
            Its ``publishers()`` returns how many nodes publish the topic.
        """
        port = self._ctx.subscribe(topic, message_class, callback, self.namespace, keep)
        self._ports.append(port)
        return port

    def serve(self, name: str, service_class: type, handler: Callable[[Any], Any]) -> None:
        """Offer a service below the namespace of the controller.

        Parameters
        ----------
        name : str
        service_class : type
        handler : callable
            ``handler(request)`` returns the response.
        """
        self._ports.append(self._ctx.serve(name, service_class, handler, self.namespace))

    def close(self) -> None:
        """Close all topics and services of the controller."""
        for port in self._ports:
            self._ctx.release(port)
        self._ports = []


class Due:
    """Rule of ros_control's publishers: due when more than a period has passed; then one period later, without drift.

    Parameters
    ----------
    rate : float
        [Hz], above 0.
    """

    def __init__(self, rate: float) -> None:
        self.period_ns = int(round(1e9 / rate))
        self._last_ns = 0

    def restart(self, now_ns: int, at_once: bool = False) -> None:
        """Count from now, or let the next call be due.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        at_once : bool
        """
        self._last_ns = now_ns - (self.period_ns + 1 if at_once else 0)

    def due(self, now_ns: int) -> bool:
        """Return whether it is due, and if so count the call."""
        if now_ns - self._last_ns <= self.period_ns:
            return False
        self._last_ns += self.period_ns
        return True


def covariance(node: ControllerNode, name: str) -> List[float]:
    """Return a covariance matrix of 36 numbers from the parameter of its diagonal.

    Parameters
    ----------
    node : ControllerNode
    name : str
    """
    matrix = [0.0] * 36
    matrix[::7] = node.numbers(name, 6)
    return matrix


def read_joints(node: ControllerNode, hardware: RobotHardware, interface: str,
                names: Sequence[str]) -> Tuple[JointHandle, ...]:
    """Return the joints of a controller; PluginError if the robot does not have one of them.

    Parameters
    ----------
    node : ControllerNode
    hardware : RobotHardware
    interface : str
    names : sequence of str
    """
    return tuple(hardware.handle(name, interface) for name in names)
