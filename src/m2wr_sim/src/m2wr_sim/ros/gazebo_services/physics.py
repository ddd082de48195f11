# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services for the physics of the world and for pausing; each method answers the service of its name."""
import logging
from dataclasses import replace
from typing import Any, Callable, Dict

from std_srvs.srv import EmptyResponse

from gazebo_msgs.srv import GetPhysicsPropertiesResponse, SetPhysicsPropertiesResponse
from m2wr_sim.errors import ParameterError
from m2wr_sim.ros.convert import read_vector
from m2wr_sim.runtime.changes import set_physics
from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)


class PhysicsApi:
    """The services for the physics of the world; all run in the loop's thread.

    Parameters
    ----------
    simulator : Simulator
    set_factor : callable
        Called with the real-time factor that follows from the update rate; 0: as fast as possible.
    """

    def __init__(self, simulator: Simulator, set_factor: Callable[[float], None]) -> None:
        self._simulator, self._set_factor = simulator, set_factor

    def get_physics_properties(self, _: Any) -> GetPhysicsPropertiesResponse:
        """Return the values as they were last set; the engine limits some of them."""
        physics = self._simulator.physics
        response = GetPhysicsPropertiesResponse(
            time_step=physics.max_step_size, pause=self._simulator.paused,
            max_update_rate=physics.real_time_update_rate, success=True,
            status_message="GetPhysicsProperties: got properties")
        response.gravity.x, response.gravity.y, response.gravity.z = physics.gravity
        ode = response.ode_config
        ode.sor_pgs_precon_iters, ode.sor_pgs_iters, ode.sor_pgs_w = physics.precon_iters, physics.iters, physics.sor
        ode.contact_surface_layer = physics.contact_surface_layer
        ode.contact_max_correcting_vel = physics.contact_max_correcting_vel
        ode.cfm, ode.erp, ode.max_contacts = physics.cfm, physics.erp, physics.max_contacts
        return response

    def set_physics_properties(self, request: Any) -> SetPhysicsPropertiesResponse:
        """Set all values; what a request omits becomes zero, as in Gazebo, except a time step of zero."""
        ode = request.ode_config
        values = {"max_step_size": request.time_step, "real_time_update_rate": request.max_update_rate,
                  "gravity": read_vector(request.gravity), "precon_iters": ode.sor_pgs_precon_iters,
                  "iters": ode.sor_pgs_iters, "sor": ode.sor_pgs_w, "cfm": ode.cfm, "erp": ode.erp,
                  "contact_surface_layer": ode.contact_surface_layer,
                  "contact_max_correcting_vel": ode.contact_max_correcting_vel, "max_contacts": ode.max_contacts}
        try:
            self.change(values)
        except ParameterError as error:
            log.error("set_physics_properties: %s", error)
            return SetPhysicsPropertiesResponse(False, "SetPhysicsProperties: %s" % error)
        return SetPhysicsPropertiesResponse(True, "physics engine updated")

    def change(self, values: Dict[str, Any]) -> None:
        """Set fields of the world's Physics; a time step of zero leaves the step unchanged.

        Raises
        ------
        ParameterError
            If a value is invalid.
        """
        simulator = self._simulator
        old = simulator.physics
        new = replace(old, **values)
        if new.max_step_size == 0.0:
            log.warning("set_physics_properties: time_step is 0, which would pause the simulation; it stays %g s",
                        old.max_step_size)
            new = replace(new, max_step_size=old.max_step_size)
        set_physics(simulator, new)
        factors = [physics.real_time_update_rate * physics.max_step_size for physics in (old, new)]
        if factors[0] != factors[1]:
            self._set_factor(max(0.0, factors[1]))

    def pause_physics(self, _: Any) -> EmptyResponse:
        """Pause the simulation; services still answer."""
        self._simulator.paused = True
        return EmptyResponse()

    def unpause_physics(self, _: Any) -> EmptyResponse:
        """Continue the simulation."""
        self._simulator.paused = False
        return EmptyResponse()
