# SPDX-License-Identifier: BSD-3-Clause
"""The context of a plugin: its model, the physics, its random numbers, and the ports for topics and services."""
from __future__ import annotations

import logging
import zlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Callable, List, Mapping, Optional, Sequence, Tuple, Type

import numpy as np

from m2wr_sim.errors import ModelError, PluginError
from m2wr_sim.geometry import compose, cross, invert
from m2wr_sim.plugins.base import PluginContext

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose, Quaternion, Vector
    from m2wr_sim.model.types import Joint, Link, PluginSpec, Sensor
    from m2wr_sim.physics.engine import LinkState
    from m2wr_sim.plugins.base import Shared
    from m2wr_sim.rendering.picture_scene import PictureScene
    from m2wr_sim.runtime.entities import LiveModel
    from m2wr_sim.runtime.simulator import Simulator


class ModelContext(PluginContext):
    """The :class:`~m2wr_sim.plugins.base.PluginContext` of one plugin of one model.

    Parameters
    ----------
    simulator : Simulator
    model : LiveModel
    spec : PluginSpec
    sensor : Sensor, optional
        The sensor to which the plugin belongs.
    sensor_link : str, optional
        Name of the link that carries the sensor.
    """

    def __init__(self, simulator: Simulator, model: LiveModel, spec: PluginSpec, sensor: Optional[Sensor] = None,
                 sensor_link: Optional[str] = None) -> None:
        self._simulator, self._model, self._spec = simulator, model, spec
        self._ports = simulator.ports
        self._open: List[Any] = []              # ports, subscriptions, services
        self.model_name, self.sensor = spec.scope.rpartition("::")[2] or model.name, sensor
        self.sensor_link = None if sensor_link is None else model.handle.links[sensor_link]
        self._sensor_link_name = sensor_link
        if sensor_link is not None:
            self.sensor_collisions = tuple(shape.name for shape in self.link_record(sensor_link).collisions)
        self.script = model.record.script
        self.now_ns, self.measurements = simulator.now_ns, 0    # how often a ray sensor has measured
        self.physics, self.scene = simulator.engine, simulator.scene
        self.log = logging.getLogger("m2wr_sim.plugins")
        self.wheel_convention = simulator.config.wheel_convention_of(model.name, spec.find("wheelConvention"))
        self.command_timeout_ns = simulator.config.command_timeout_ns

    def log_once(self, level: int, text: str, *values: object) -> None:
        self._simulator.config.once_logger.log(level, self._model.name, text, *values)

    @property
    def step_ns(self) -> int:
        return self._simulator.step_ns

    @property
    def time_ns(self) -> int:
        return self._simulator.now_ns

    def parameter(self, name: str) -> Any:
        return self._ports.parameter(name)

    def link(self, name: str) -> int:
        return self._number(self._model.handle.links, "link", name)

    def first_link(self) -> str:
        return self._first.name if self._spec.scope else self._model.record.links[0].name

    def find_sensor(self, name: str, kind: str) -> Tuple[Sensor, int, Tuple[str, ...]]:
        sensors = [(sensor, link.name) for link in self._model.record.links for sensor in link.sensors]
        for sensor, link in sensors:
            if sensor.name == name and sensor.kind in (kind, "gpu_" + kind):
                return sensor, self._model.handle.links[link], tuple(
                    "%s::%s::%s" % (self._model.name, link, collision) for collision in sensor.contact_collisions)
        raise PluginError("%s: \"%s\" is no sensor of type %s of %s (it has %s)" % (
            self._spec.where, name, kind, self.model_name,
            ", ".join("%s: %s" % (sensor.name, sensor.kind) for sensor, _ in sensors) or "none"))

    def joint(self, name: str) -> int:
        return self._number(self._model.handle.joints, "joint", name)

    def join(self, joint: Joint) -> int:
        for end in (joint.child,) if joint.parent == "world" else (joint.child, joint.parent):
            self.link(end)
        links, scope = self._model.handle.links, self._spec.scope
        parent = "world" if joint.parent == "world" else self._own(links, joint.parent)
        name = scope + "::" + joint.name if scope else joint.name
        try:
            return self.physics.join(self._model.handle, replace(
                joint, name=name, parent=parent, child=self._own(links, joint.child)))
        except ModelError as error:
            raise PluginError("%s: %s" % (self._spec.where, error)) from None

    def _own(self, table: Mapping[str, int], name: str) -> str:
        """Return the name of a link or joint in the model; the given name may begin with that of the model.

        For a plugin of a nested model, the names of the nested model take precedence.
        """
        prefix, scope = self._model.name + "::", self._spec.scope
        plain = name[len(prefix):] if name.startswith(prefix) and name not in table else name
        return scope + "::" + plain if scope and scope + "::" + plain in table else plain

    def _number(self, table: Mapping[str, int], kind: str, name: str) -> int:
        name = self._own(table, name)
        for lumped, carrier, _ in self._model.record.lumped:
            if kind == "link" and name == lumped:
                raise PluginError("%s: link \"%s\" was merged into \"%s\" over a fixed joint, as Gazebo does; name "
                                  "that one, or keep the link with <preserveFixedJoint> on the joint"
                                  % (self._spec.where, name, carrier))
        if name not in table:
            raise PluginError("%s: \"%s\" is no %s of %s (it has %s)"
                              % (self._spec.where, name, kind, self.model_name, ", ".join(sorted(table)) or "none"))
        return table[name]

    def joint_record(self, name: str) -> Joint:
        self.joint(name)
        name = self._own(self._model.handle.joints, name)
        return self._model.joint_record(name)

    def joint_above(self, link: str) -> Optional[Joint]:
        name = self._own(self._model.handle.links, link)
        return next((joint for joint in self._model.record.joints if joint.child == name), None)

    def joint_position(self, name: str) -> Vector:
        joint = self.joint_record(name)
        child = next(link for link in self._model.record.links if link.name == joint.child)
        return compose(child.pose, joint.pose)[0]

    def model_state(self) -> LinkState:
        if not self._spec.scope:
            return self._model.state(self.physics)
        state = self.physics.link_state(self._model.handle.links[self._first.name])
        position, orientation = compose((state.position, state.orientation),
                                        compose(invert(self._first.pose), self._spec.frame))
        return state._replace(position=position, orientation=orientation)

    def motion_reader(self, motion: NDArray[np.float64]) -> Callable[[], None]:
        links = self._model.handle.links
        if not self._spec.scope:
            return self.physics.motion_reader(self._model.root, invert(self._model.record.links[0].pose), motion)
        return self.physics.motion_reader(links[self._first.name],
                                          compose(invert(self._first.pose), self._spec.frame), motion)

    @property
    def _first(self) -> Link:
        """The record of the first link of the plugin's nested model."""
        prefix = self._spec.scope + "::"
        return next(link for link in self._model.record.links if link.name.startswith(prefix))

    def pose_in_model(self, link: int) -> Pose:
        state = self.model_state()
        return compose(invert((state.position, state.orientation)), self.physics.link_pose(link))

    def link_record(self, name: str) -> Link:
        self.link(name)
        name = self._own(self._model.handle.links, name)
        return replace(self._model.link_record(name), inertial=self._model.acting_inertial(name))

    def collision_name(self, name: str) -> str:
        return "%s::%s::%s" % (self._model.name, self._sensor_link_name, name)

    def set_motion(self, linear: Vector, angular: Vector) -> None:
        engine, links = self.physics, self._model.handle.links
        origin = self._model.pose(engine)[0]
        turning = engine.link_state(self._model.root).angular_velocity
        for record in self._model.record.links:
            state = engine.link_state(links[record.name])
            centre = compose((state.position, state.orientation), self._model.acting_inertial(record.name).pose)[0]
            carried = cross(angular, tuple(a - b for a, b in zip(centre, origin)))
            engine.set_link_velocity(
                links[record.name], tuple(a + b for a, b in zip(linear, carried)),
                tuple(a + b - c for a, b, c in zip(angular, state.angular_velocity, turning)))

    def link_places(self) -> List[Tuple[int, Pose, Vector]]:
        links = self._model.handle.links
        return [(links[link.name], link.pose, link.inertial.pose[0]) for link in self._model.record.links]

    def shared(self, plugin_class: Type[Shared]) -> Shared:
        return self._simulator.plugins.shared(plugin_class)

    def hand_over(self, function: Callable[[Any], object], message: Any) -> None:
        self._simulator.plugins.hand_over(self, function, message)

    def refresh_scene(self) -> None:
        self.measurements += 1
        self._simulator.refresh_scene()

    def refresh_pictures(self) -> PictureScene:
        return self._simulator.refresh_pictures()

    def rng(self, name: str) -> np.random.Generator:
        key = "%s/%s/%s" % (self.model_name, self._spec.name, name)
        return np.random.default_rng([self._simulator.config.seed, zlib.crc32(key.encode())])

    def moment(self, now_ns: int) -> Any:
        return self._ports.moment(now_ns)

    def frame(self, name: str, namespace: str = "") -> str:
        return self._ports.frame(name, namespace)

    def advertise(self, topic: str, message_class: type, queue_size: int = 10, namespace: Optional[str] = None) -> Any:
        port = self._ports.advertise(topic, message_class, queue_size, namespace or "")
        self._open.append(port)
        return port

    def subscribe(self, topic: str, message_class: type, callback: Callable[[Any], object],
                  namespace: Optional[str] = None, keep: int = 1) -> Any:
        port = self._ports.subscribe(
            topic, message_class, lambda message: self.hand_over(callback, message),
            namespace or "", keep)
        self._open.append(port)
        return port

    def serve(self, name: str, service_class: type, handler: Callable[[Any], Any],
              namespace: Optional[str] = None) -> Any:
        port = self._ports.serve(name, service_class, handler, namespace or "")
        self._open.append(port)
        return port

    def release(self, port: Any) -> None:
        self._open = [other for other in self._open if other is not port]
        port.close()

    def send_transform(self, stamp: Any, parent: str, child: str, position: Sequence[float],
                       orientation: Quaternion) -> None:
        self._ports.transform(stamp, parent, child, position, orientation)

    def topics(self) -> List[str]:
        """Return the names of the topics on which the plugin publishes, as far as the ports have names."""
        return [port.topic for port in self._open if hasattr(port, "topic")]

    def close(self) -> None:
        """Close all ports of the plugin."""
        for port in self._open:
            port.close()
        self._open = []
