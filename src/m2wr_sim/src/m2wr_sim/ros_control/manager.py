# SPDX-License-Identifier: BSD-3-Clause
"""The controller manager: loads, starts, stops and updates controllers; its services are in the plugin."""
from __future__ import annotations

import logging
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Sequence, Set

from m2wr_sim.errors import PluginError
from m2wr_sim.ros_control.controllers.registry import CONTROLLERS, find_controller, nearest
from m2wr_sim.ros_control.hardware import STATE

if TYPE_CHECKING:
    from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode
    from m2wr_sim.ros_control.hardware import RobotHardware

BEST_EFFORT, STRICT = 1, 2
INITIALIZED, RUNNING, STOPPED = "initialized", "running", "stopped"

MOST_CONTROLLERS = 1000         # of one robot; each has topics


@dataclass
class Loaded:
    """A controller with its name, its type, and its state: initialized, running or stopped."""

    name: str
    kind: str
    controller: Controller
    node: ControllerNode
    state: str = INITIALIZED

    def claims(self) -> Dict[str, List[str]]:
        """Return the joints that it claims, by hardware interface."""
        found: Dict[str, List[str]] = OrderedDict()
        if self.controller.interface != STATE:
            for joint in self.controller.joints:
                found.setdefault(joint.interface, []).append(joint.name)
        return found


class ControllerManager:
    """Runs the controllers of one robot.

    Parameters
    ----------
    namespace : str
        Of the robot.
    hardware : RobotHardware
    make_node : callable
        ``make_node(name, parameters)`` returns the :class:`ControllerNode` of a controller.
    parameters_of : callable
        ``parameters_of(name)`` returns the parameters of a controller: a dict, or None if there are none.
    log : logging.Logger
    """

    def __init__(self, namespace: str, hardware: RobotHardware, make_node: Callable[[str, Any], ControllerNode],
                 parameters_of: Callable[[str], Any], log: logging.Logger) -> None:
        self._namespace, self._hardware, self._log = namespace.rstrip("/"), hardware, log
        self._make_node, self._parameters_of = make_node, parameters_of
        self.loaded: Dict[str, Loaded] = OrderedDict()
        self._running: List[Loaded] = []

    @property
    def running(self) -> bool:
        """Whether a controller is running."""
        return bool(self._running)

    def load(self, name: str) -> bool:
        """Load a controller; a failure is logged with its reason."""
        if name in self.loaded:
            self._log.error("A controller named '%s' was already loaded inside the controller manager", name)
            return False
        if not name or len(self.loaded) >= MOST_CONTROLLERS:
            self._log.error("Could not load controller '%s': expected a name, and at most %d controllers", name,
                            MOST_CONTROLLERS)
            return False
        values = self._parameters_of(name)
        kind = values.get("type") if isinstance(values, dict) else None
        if not isinstance(kind, str):
            self._log.error("Could not load controller '%s' because the type was not specified. Did you load the "
                            "controller configuration on the parameter server (namespace: '%s/%s')?", name,
                            self._namespace, name)
            return False
        maker = find_controller(kind)
        if maker is None:
            near = nearest(kind)
            self._log.error("Could not load controller '%s' because controller type '%s' does not exist.%s", name, kind,
                            " Did you mean %s?" % near if near else "")
            self._log.error("Use 'rosservice call %s/controller_manager/list_controller_types' to get the available "
                            "types", self._namespace)
            return False
        node = self._make_node(name, values)
        try:
            controller = maker()
            controller.configure(node, self._hardware)
        except Exception as error:
            node.close()
            text = str(error) if isinstance(error, PluginError) else "%s: %s" % (type(error).__name__, error)
            self._log.error("Initializing controller '%s' failed: %s", name, text,
                            exc_info=not isinstance(error, PluginError))
            return False
        self.loaded[name] = Loaded(name, kind, controller, node)
        return True

    def unload(self, name: str) -> bool:
        """Unload a controller that is not running; a failure is logged with its reason."""
        entry = self.loaded.get(name)
        if entry is None:
            self._log.error("Could not unload controller with name '%s' because no controller with this name exists",
                            name)
            return False
        if entry.state == RUNNING:
            self._log.error("Could not unload controller with name '%s' because it is still running", name)
            return False
        del self.loaded[name]
        entry.node.close()
        return True

    def switch(self, start: Sequence[str], stop: Sequence[str], strict: bool, now_ns: int) -> bool:
        """Stop and start controllers at once, between two steps.

        Parameters
        ----------
        start, stop : sequence of str
            Names.
        strict : bool
            Whether nothing happens if one of them is not possible; otherwise that one is left out.
        now_ns : int
            Simulated time [ns].

        Returns
        -------
        bool
            Whether it was done; a failure is logged with its reason.
        """
        chosen: Dict[str, List[Loaded]] = {}
        for word, names, state in (("stop", stop, True), ("start", start, False)):
            chosen[word] = []
            for name in OrderedDict.fromkeys(names):
                entry = self.loaded.get(name)
                if entry is not None and (entry.state == RUNNING) == state:
                    chosen[word].append(entry)
                    continue
                if entry is not None and not state and name in stop:
                    chosen[word].append(entry)          # a restart
                    continue
                problem = ("Could not %s controller with name '%s' because no controller with this name exists"
                           % (word, name) if entry is None else
                           "Could not stop controller with name '%s' since it is not running" % name if state else
                           "Controller '%s' is already running" % name)
                self._log.log(logging.ERROR if strict else logging.DEBUG, "%s", problem)
                if strict:
                    return False
        if not self._free(chosen["start"], chosen["stop"]):
            return False
        for entry in chosen["stop"]:
            self._stop(entry, now_ns)
        self._hardware.read()
        return all([self._start(entry, now_ns) for entry in chosen["start"]])

    def _start(self, entry: Loaded, now_ns: int) -> bool:
        """Start a controller; return whether it did."""
        try:
            entry.controller.starting(now_ns)
        except Exception:
            self._log.exception("controller '%s' failed when it was started", entry.name)
            entry.state = STOPPED
            return False
        entry.state = RUNNING
        self._running.append(entry)
        return True

    def _free(self, start: Sequence[Loaded], stop: Sequence[Loaded]) -> bool:
        """Return whether no joint would have two controllers."""
        owner: Dict[str, str] = {}
        remaining = [entry for entry in self._running if entry not in stop and entry not in start]
        for entry in [*remaining, *start]:
            for name in sorted({joint for joints in entry.claims().values() for joint in joints}):
                if name in owner:
                    self._log.error("Could not switch controllers, due to resource conflict: joint '%s' would belong "
                                    "to '%s' and '%s'", name, owner[name], entry.name)
                    return False
                owner[name] = entry.name
        return True

    def _stop(self, entry: Loaded, now_ns: int) -> None:
        entry.controller.stopping(now_ns)
        entry.state = STOPPED
        self._running = [other for other in self._running if other is not entry]

    def update(self, now_ns: int, dt: float) -> None:
        """Run one control cycle; a controller that raises is stopped, and the others continue.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        dt : float
            Time since the last call [s].
        """
        for entry in self._running:
            try:
                entry.controller.update(now_ns, dt)
            except Exception:
                self._log.exception("controller '%s' failed and is stopped", entry.name)
                self._stop(entry, now_ns)

    def restart(self, now_ns: int) -> None:
        """Let all running controllers begin again, as after a reset of the world or an emergency stop."""
        self._hardware.hold()
        for entry in self._running:
            entry.controller.stopping(now_ns)
            entry.controller.starting(now_ns)

    def close(self) -> None:
        """Close the topics and services of all controllers."""
        for entry in self.loaded.values():
            entry.node.close()

    @staticmethod
    def types() -> List[str]:
        """Return the names of all controller types."""
        return sorted(CONTROLLERS)

    def names(self) -> Set[str]:
        """Return the names of all loaded controllers."""
        return set(self.loaded)
