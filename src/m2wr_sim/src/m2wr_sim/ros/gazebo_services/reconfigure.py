# SPDX-License-Identifier: BSD-3-Clause
"""The physics as dynamic parameters (``~set_parameters``, ``rqt_reconfigure``), with Gazebo's names and ranges."""
import logging
import threading
from types import SimpleNamespace
from typing import Any, Dict, Optional, Tuple, Union

from m2wr_sim.errors import ParameterError
from m2wr_sim.model.types import Physics
from m2wr_sim.ros.gazebo_services.physics import PhysicsApi
from m2wr_sim.ros.loop import Loop, ShuttingDown
from m2wr_sim.runtime.simulator import Simulator

try:
    from dynamic_reconfigure.server import Server
except ImportError:                 # optional: the services set the same values
    Server = None

log = logging.getLogger(__name__)

# name: (type, minimum, maximum, field of Physics, description); for gravity the field is an index of its vector
PARAMETERS: Dict[str, Tuple[type, Any, Any, Union[str, int, None], str]] = {
    "time_step": (float, 0.0, 10.0, "max_step_size", "physics step [s]; 0: unchanged"),
    "max_update_rate": (float, 0.0, 1000.0, "real_time_update_rate",
                        "steps per second of wall time; 0: as fast as possible"),
    "gravity_x": (float, -100.0, 100.0, 0, "gravity along x [m/s^2]"),
    "gravity_y": (float, -100.0, 100.0, 1, "gravity along y [m/s^2]"),
    "gravity_z": (float, -100.0, 100.0, 2, "gravity along z [m/s^2]"),
    "auto_disable_bodies": (bool, False, True, None, "has no effect, as in Gazebo"),
    "sor_pgs_precon_iters": (int, 0, 10000, "precon_iters", "has no effect here"),
    "sor_pgs_iters": (int, 0, 10000, "iters", "iterations of the quick solver"),
    "sor_pgs_w": (float, 0.0, 5.0, "sor", "has no effect here"),
    "sor_pgs_rms_error_tol": (float, -1.0, 10000.0, None, "has no effect, as in Gazebo"),
    "cfm": (float, 0.0, 10.0, "cfm", "has no effect here"),
    "erp": (float, 0.0, 10.0, "erp", "error reduction of joints; limited to 0.2 to 0.8"),
    "contact_surface_layer": (float, 0.0, 10.0, "contact_surface_layer", "has no effect here"),
    "contact_max_correcting_vel": (float, 0.0, 1e7, "contact_max_correcting_vel", "has no effect here"),
    "max_contacts": (int, 0, 10000000, "max_contacts", "greatest number of contacts of a pair of shapes"),
}
_TYPE_NAMES = {float: "double", int: "int", bool: "bool"}


def description(values: Dict[str, Any]) -> SimpleNamespace:
    """Return what dynamic_reconfigure's generator makes of :data:`PARAMETERS`, with ``values`` as defaults."""
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "groups": [],
             "parameters": [{"name": name, "type": _TYPE_NAMES[kind], "level": 1, "description": text,
                             "edit_method": ""} for name, (kind, _, _, _, text) in PARAMETERS.items()]}
    return SimpleNamespace(config_description=group, defaults=dict(values),
                           min={name: kind(least) for name, (kind, least, _, _, _) in PARAMETERS.items()},
                           max={name: kind(most) for name, (kind, _, most, _, _) in PARAMETERS.items()})


def values_of(physics: Physics) -> Dict[str, Any]:
    """Return the parameters' values in a Physics; those without a field are false or zero, as in Gazebo."""
    values = {}
    for name, (kind, _, _, field, _) in PARAMETERS.items():
        if field is None:
            values[name] = kind(0)
        else:
            values[name] = kind(physics.gravity[field] if isinstance(field, int) else getattr(physics, field))
    return values


def fields_of(values: Dict[str, Any]) -> Dict[str, Any]:
    """Return the fields of Physics that belong to parameter values."""
    fields = {"gravity": tuple(values["gravity_" + axis] for axis in "xyz")}
    fields.update((field, values[name]) for name, (_, _, _, field, _) in PARAMETERS.items() if isinstance(field, str))
    return fields


class Reconfigure:
    """The dynamic parameters of the node; created before the loop runs."""

    def __init__(self, simulator: Simulator, loop: Loop, physics_api: PhysicsApi) -> None:
        self._simulator, self._loop, self._physics_api = simulator, loop, physics_api
        self._started, self._notifying = False, threading.local()
        self._server = Server(description(values_of(simulator.physics)), self._change)
        self._started = True

    def _change(self, config: Any, _: int) -> Any:
        """Apply a change and return the values that hold then; the first call, and :meth:`notify`, only read them.

        The server's values may be older than those that a service has just set. So only values are applied that differ
        from what the server published last. The server clamps each value to its range. A value outside its range that
        was not changed stays as it is.
        """
        if not self._started or getattr(self._notifying, "now", False):
            config.update(values_of(self._simulator.physics))
            return config
        published = self._server.config
        changed = {name: config[name] for name, (_, least, most, _, _) in PARAMETERS.items()
                   if config[name] != min(max(published[name], least), most)}
        try:
            config.update(self._loop.call(lambda: self._apply(changed)))
        except ShuttingDown:
            log.debug("a change of parameters was ignored: the simulation shuts down")
        return config

    def _apply(self, changed: Dict[str, Any]) -> Dict[str, Any]:
        now = values_of(self._simulator.physics)
        wanted = dict(now, **changed)
        if any(wanted[name] != now[name] for name, entry in PARAMETERS.items() if entry[3] is not None):
            try:
                self._physics_api.change(fields_of(wanted))
                log.info("physics dynamics reconfigure update complete")
            except ParameterError as error:
                log.error("set_parameters: %s", error)
        log.info("physics dynamics reconfigure complete")
        return values_of(self._simulator.physics)

    def notify(self) -> None:
        """Publish values that a service has changed; this sets nothing, even if clients set parameters meanwhile."""
        self._notifying.now = True
        try:
            self._server.update_configuration({})
        finally:
            self._notifying.now = False


def make_reconfigure(simulator: Simulator, loop: Loop, physics_api: PhysicsApi) -> Optional[Reconfigure]:
    """Return the :class:`Reconfigure`, or None with a warning if the package dynamic_reconfigure is missing.

    Parameters
    ----------
    simulator : Simulator
    loop : Loop
        Applies the changes in its thread.
    physics_api : PhysicsApi
        Sets the values.
    """
    if Server is None:
        log.warning("the Python package dynamic_reconfigure is not installed: ~set_parameters is missing; the service "
                    "~set_physics_properties sets the same values")
        return None
    reconfigure = Reconfigure(simulator, loop, physics_api)
    log.info("Physics dynamic reconfigure ready.")
    return reconfigure
