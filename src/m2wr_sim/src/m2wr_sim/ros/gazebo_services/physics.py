# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services about the physics of the world, and pausing; the methods answer the services of their names."""
import logging
from dataclasses import replace

from std_srvs.srv import EmptyResponse

from gazebo_msgs.srv import GetPhysicsPropertiesResponse, SetPhysicsPropertiesResponse
from m2wr_sim.errors import ParameterError
from m2wr_sim.ros.convert import read_vector
from m2wr_sim.runtime.changes import set_physics

log = logging.getLogger(__name__)


class PhysicsApi:
    """The services about the world's physics; all run in the loop's thread.

    Parameters
    ----------
    simulator : Simulator
    set_factor : callable
        Takes the real-time factor that the update rate asks for; 0 is as fast as it goes.
    """

    def __init__(self, simulator, set_factor):
        self._simulator, self._set_factor = simulator, set_factor

    def get_physics_properties(self, _):
        """Return the numbers as they were last set; the engine takes some of them only within limits."""
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

    def set_physics_properties(self, request):
        """Set all numbers: what a request leaves out becomes zero, as in Gazebo, except a time step of zero."""
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

    def change(self, values):
        """Change fields of the world's Physics; a step of zero leaves the step as it is.

        Raises
        ------
        ParameterError
            If a number cannot be used.
        """
        simulator = self._simulator
        old = simulator.physics
        new = replace(old, **values)
        if new.max_step_size == 0.0:
            log.warning("set_physics_properties: time_step is 0, which would stop time; it stays %g s",
                        old.max_step_size)
            new = replace(new, max_step_size=old.max_step_size)
        set_physics(simulator, new)
        pace = [physics.real_time_update_rate * physics.max_step_size for physics in (old, new)]
        if pace[0] != pace[1]:
            self._set_factor(max(0.0, pace[1]))

    def pause_physics(self, _):
        """Stop time; services go on."""
        self._simulator.paused = True
        return EmptyResponse()

    def unpause_physics(self, _):
        """Let time go on."""
        self._simulator.paused = False
        return EmptyResponse()
