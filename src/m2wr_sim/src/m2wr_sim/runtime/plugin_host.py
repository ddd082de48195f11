# SPDX-License-Identifier: BSD-3-Clause
"""Starts, calls and stops plugins; one that raises an exception is switched off, and the simulation continues."""
from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Callable, Iterator, List, Optional, Set, Tuple, Type

from m2wr_sim.errors import SimError
from m2wr_sim.model.types import SECOND_AXIS, PluginSpec
from m2wr_sim.plugins.base import PluginReader
from m2wr_sim.plugins.unsupported import UnsupportedPlugins
from m2wr_sim.runtime.context import ModelContext
from m2wr_sim.runtime.event_queue import EventQueue
from m2wr_sim.runtime.schedule import misfit

if TYPE_CHECKING:
    from m2wr_sim.model.types import Model, Sensor
    from m2wr_sim.plugins.base import Plugin, Shared
    from m2wr_sim.runtime.entities import LiveModel
    from m2wr_sim.runtime.event_queue import Entry
    from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)

_ACTOR_SCRIPT = "builtin actor script"
_JOINT_STATES = "builtin joint states"
_RATE_TAGS = ("updaterate", "updateratehz", "update_rate")


class PluginHost:
    """The plugins of all models, and those of the world itself.

    Parameters
    ----------
    simulator : Simulator
    catch_up : callable
        Makes the engine catch up with the simulated time, before a plugin reads its state.

    Attributes
    ----------
    event_queue : EventQueue
        When the plugins want to be called.
    observers : list of Entry
        Plugins of the world itself: state publishers and the like.
    unsupported : UnsupportedPlugins
    """

    def __init__(self, simulator: Simulator, catch_up: Callable[[], None]) -> None:
        self._simulator = simulator
        self.event_queue = EventQueue(self._failed, catch_up)
        self.observers: List[Entry] = []
        self.unsupported = UnsupportedPlugins()
        self._active: List[Entry] = []          # of all models, in load order
        self._misfits: Set[str] = set()         # logged messages about rates that do not fit into the steps

    def entries(self) -> List[Entry]:
        """Return all plugins that are called: those of the models in load order, then those of the world."""
        return self._active + self.observers

    def add_observer(self, plugin: Plugin, label: str) -> None:
        """Add a plugin of the world, which takes part in every step; it must be configured already.

        Parameters
        ----------
        plugin : Plugin
        label : str
            Name for messages.
        """
        self.observers.append((plugin, None, label))
        self.event_queue.stale = True

    def shared(self, plugin_class: Type[Shared]) -> Shared:
        """Return the only plugin of a class that plugins of many models use together; the first call adds it."""
        for plugin, _, _ in self._active:
            if type(plugin) is plugin_class:
                return plugin
        plugin = plugin_class()
        self._active.append((plugin, None, "the world: %s" % plugin_class.__name__))
        self.event_queue.stale = True
        return plugin

    def start_all(self, model: LiveModel, namespace: Optional[str]) -> None:
        """Start the plugins of a model; one that cannot be configured is logged and omitted.

        Parameters
        ----------
        model : LiveModel
        namespace : str, optional
            ROS namespace of plugins that do not define one; default: that of the plugin.
        """
        for spec, sensor, link in self._specs(model.record):
            self._start(model, spec, sensor, link, namespace)

    def _specs(self, record: Model) -> Iterator[Tuple[PluginSpec, Optional[Sensor], Optional[str]]]:
        """Yield ``(spec, sensor, link name)`` of a model's plugins; adds joint states if no plugin publishes them."""
        if record.script is not None:
            yield PluginSpec(_ACTOR_SCRIPT, "libm2wr_actor_script.so", where=record.name + ": script"), None, None
        for spec in record.plugins:
            yield spec, None, None
        for link in record.links:
            for sensor in link.sensors:
                for spec in sensor.plugins:
                    yield spec, sensor, link.name
        config = self._simulator.config
        moving = [joint.name + suffix for joint in record.joints
                  for suffix in ("", SECOND_AXIS)[:len(joint.axes())]]
        given = any("joint_state" in spec.filename or "gazebo_ros_control" in spec.filename
                    or spec.find("publishWheelJointState") in ("true", "1")
                    for spec in record.plugins)
        if config.joint_states and record.plugins and moving and not given and not record.static:
            parameters = (("jointName", ",".join(moving)), ("updateRate", str(config.joint_state_rate)))
            library = "libgazebo_ros_joint_state_publisher.so"
            yield PluginSpec(_JOINT_STATES, library, parameters, where=_JOINT_STATES), None, None

    def _start(self, model: LiveModel, spec: PluginSpec, sensor: Optional[Sensor], link: Optional[str],
               namespace: Optional[str]) -> None:
        plugin_class = self._simulator.plugin_class(spec.filename)
        if plugin_class is None:
            self.unsupported.report(model.name, spec, namespace)
            return
        if namespace and spec.find("robotNamespace") is None:
            spec = replace(spec, parameters=spec.parameters + (("robotNamespace", namespace),))
        plugin, reader = plugin_class(), PluginReader(spec)
        context = ModelContext(self._simulator, model, spec, sensor, link)
        label = "%s: plugin %s (%s)" % (model.name, spec.name, spec.filename)
        try:
            plugin.configure(reader, context)
        except SimError as error:
            context.close()
            log.error("%s. This plugin will not run.", error)
            return
        except Exception:
            context.close()
            log.exception("%s failed to start and will not run", label)
            return
        self._simulator.config.once_logger.log_parameters(model.name, label, reader)
        self._log_misfits(label, spec, sensor)
        entry = (plugin, context, label)
        model.plugins.append(entry)
        self._active.append(entry)
        self.event_queue.stale = True

    def _log_misfits(self, label: str, spec: PluginSpec, sensor: Optional[Sensor]) -> None:
        """Log the intervals of each rate that does not fit into whole steps, once."""
        rates: List[Any] = [text for tag, text in spec.parameters if tag.lower() in _RATE_TAGS]
        for rate in rates + ([] if sensor is None else [sensor.update_rate]):
            try:
                message = misfit(float(rate), self._simulator.step_ns)
            except (ValueError, OverflowError):         # not a rate, which the plugin has logged
                continue
            if message is not None and message not in self._misfits:
                self._misfits.add(message)
                log.info("%s: %s", label, message)

    def stop(self, entry: Entry) -> None:
        """Close a plugin, unless it was closed when it was switched off."""
        if entry not in self._active:
            return
        self._active.remove(entry)
        self.event_queue.stale = True
        plugin, context, label = entry
        try:
            plugin.close()
        except Exception:
            log.exception("%s failed while closing", label)
        if context is not None:         # of a plugin of one model
            context.close()

    def stop_all(self) -> None:
        """Close the plugins of all models; those of the world end without a call."""
        for entry in list(self._active):
            self.stop(entry)
        self.observers = []
        self.event_queue.stale = True

    def restart_all(self, now_ns: int, rewound: bool) -> None:
        """Let all plugins discard the past.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        rewound : bool
            Whether simulated time was set back to zero.
        """
        for entry in self.entries():
            self._call(entry, entry[0].reset, now_ns, rewound)

    def hand_over(self, context: ModelContext, function: Callable[[Any], object], message: Any) -> None:
        """Pass a message to a plugin.

        Parameters
        ----------
        context : ModelContext
            Context of the plugin.
        function : callable
            Its callback.
        message : object
        """
        for entry in self._active:
            if entry[1] is context:
                self._call(entry, function, message)
                break

    def switched_off(self) -> List[str]:
        """Return the labels of plugins that were switched off after an exception."""
        return [entry[2] for model in self._simulator.models.values() for entry in model.plugins
                if entry not in self._active]

    def _call(self, entry: Entry, function: Callable[..., object], *arguments: Any) -> None:
        try:
            function(*arguments)
        except Exception:
            self._failed(entry)

    def _failed(self, entry: Entry) -> None:
        log.exception("%s failed and is switched off", entry[2])
        self.event_queue.stale = True
        self.event_queue.valid_ns = 0       # query all others
        if entry in self.observers:
            self.observers.remove(entry)
        else:
            self.stop(entry)
