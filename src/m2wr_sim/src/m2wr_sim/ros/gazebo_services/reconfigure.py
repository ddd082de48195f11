# SPDX-License-Identifier: BSD-3-Clause
"""The physics as dynamic parameters (``~set_parameters``, ``rqt_reconfigure``), with Gazebo's names and ranges."""
import logging
import threading
from types import SimpleNamespace

from m2wr_sim.errors import ParameterError
from m2wr_sim.ros.loop import ShuttingDown

try:
    from dynamic_reconfigure.server import Server
except ImportError:                 # an optional package: the services change the same numbers
    Server = None

log = logging.getLogger(__name__)

# name: (kind, least, greatest, field of Physics, description); gravity's fields are indices of its vector
PARAMETERS = {
    "time_step": (float, 0.0, 10.0, "max_step_size", "physics step [s]; 0 leaves it as it is"),
    "max_update_rate": (float, 0.0, 1000.0, "real_time_update_rate",
                        "steps per second of wall time; 0: as fast as it can"),
    "gravity_x": (float, -100.0, 100.0, 0, "gravity along x [m/s^2]"),
    "gravity_y": (float, -100.0, 100.0, 1, "gravity along y [m/s^2]"),
    "gravity_z": (float, -100.0, 100.0, 2, "gravity along z [m/s^2]"),
    "auto_disable_bodies": (bool, False, True, None, "has no effect, as in Gazebo"),
    "sor_pgs_precon_iters": (int, 0, 10000, "precon_iters", "has no effect here"),
    "sor_pgs_iters": (int, 0, 10000, "iters", "iterations of the solver quick"),
    "sor_pgs_w": (float, 0.0, 5.0, "sor", "has no effect here"),
    "sor_pgs_rms_error_tol": (float, -1.0, 10000.0, None, "has no effect, as in Gazebo"),
    "cfm": (float, 0.0, 10.0, "cfm", "has no effect here"),
    "erp": (float, 0.0, 10.0, "erp", "error reduction of joints; taken between 0.2 and 0.8"),
    "contact_surface_layer": (float, 0.0, 10.0, "contact_surface_layer", "has no effect here"),
    "contact_max_correcting_vel": (float, 0.0, 1e7, "contact_max_correcting_vel", "has no effect here"),
    "max_contacts": (int, 0, 10000000, "max_contacts", "contacts of a pair of shapes at most"),
}
_TYPE_NAMES = {float: "double", int: "int", bool: "bool"}


def description(values):
    """Return what dynamic_reconfigure's generator would make of :data:`PARAMETERS`, with present values as defaults."""
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "groups": [],
             "parameters": [{"name": name, "type": _TYPE_NAMES[kind], "level": 1, "description": text,
                             "edit_method": ""} for name, (kind, _, _, _, text) in PARAMETERS.items()]}
    return SimpleNamespace(config_description=group, defaults=dict(values),
                           min={name: kind(least) for name, (kind, least, _, _, _) in PARAMETERS.items()},
                           max={name: kind(most) for name, (kind, _, most, _, _) in PARAMETERS.items()})


def values_of(physics):
    """Return the parameters' values in a Physics; those without a field are false or zero, as Gazebo reports them."""
    values = {}
    for name, (kind, _, _, field, _) in PARAMETERS.items():
        if field is None:
            values[name] = kind(0)
        else:
            values[name] = kind(physics.gravity[field] if isinstance(field, int) else getattr(physics, field))
    return values


def fields_of(values):
    """Return the fields of Physics that parameter values stand for."""
    fields = {"gravity": tuple(values["gravity_" + axis] for axis in "xyz")}
    fields.update((field, values[name]) for name, (_, _, _, field, _) in PARAMETERS.items() if isinstance(field, str))
    return fields


class Reconfigure:
    """The dynamic parameters of the node; made before the loop runs."""

    def __init__(self, simulator, loop, physics_api):
        self._simulator, self._loop, self._physics_api = simulator, loop, physics_api
        self._started, self._telling = False, threading.local()
        self._server = Server(description(values_of(simulator.physics)), self._change)
        self._started = True

    def _change(self, config, _):
        """Take a change and answer with what is true then; the first call, and :meth:`tell`, only learn that.

        Of the server's numbers, which may be older than what a service has just set, only those count that differ from
        what it last told.  It brings every one into its range; what is beyond that and was not touched stays as it is.
        """
        if not self._started or getattr(self._telling, "now", False):
            config.update(values_of(self._simulator.physics))
            return config
        told = self._server.config
        touched = {name: config[name] for name, (_, least, most, _, _) in PARAMETERS.items()
                   if config[name] != min(max(told[name], least), most)}
        try:
            config.update(self._loop.call(lambda: self._take(touched)))
        except ShuttingDown:
            log.debug("a change of parameters came too late: the simulation ends")
        return config

    def _take(self, touched):
        now = values_of(self._simulator.physics)
        wanted = dict(now, **touched)
        if any(wanted[name] != now[name] for name, entry in PARAMETERS.items() if entry[3] is not None):
            try:
                self._physics_api.change(fields_of(wanted))
                log.info("physics dynamics reconfigure update complete")
            except ParameterError as error:
                log.error("set_parameters: %s", error)
        log.info("physics dynamics reconfigure complete")
        return values_of(self._simulator.physics)

    def tell(self):
        """Let the watchers know of numbers that a service has changed; nothing is set, whatever others do meanwhile."""
        self._telling.now = True
        try:
            self._server.update_configuration({})
        finally:
            self._telling.now = False


def make_reconfigure(simulator, loop, physics_api):
    """Return the :class:`Reconfigure`, or None, said once, where the package dynamic_reconfigure is missing."""
    if Server is None:
        log.warning("the Python package dynamic_reconfigure is not installed: there is no ~set_parameters; the service "
                    "~set_physics_properties changes the same numbers")
        return None
    reconfigure = Reconfigure(simulator, loop, physics_api)
    log.info("Physics dynamic reconfigure ready.")
    return reconfigure
