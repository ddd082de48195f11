# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services and command topics under ``~``, mapped to calls of the simulator; status texts are Gazebo's.

This module has the services of models and of the world, and puts all services together. The other modules of this
folder have the rest.
"""
import functools
import logging
import time
from typing import Any, Callable, Dict, List, Tuple

import rospy
from std_srvs.srv import EmptyResponse, TriggerResponse

from gazebo_msgs.msg import LinkState, ModelState
from gazebo_msgs.srv import (
    DeleteModelResponse,
    GetModelPropertiesResponse,
    GetModelStateResponse,
    GetWorldPropertiesResponse,
    SetModelConfigurationResponse,
    SetModelStateResponse,
)
from m2wr_sim.errors import ModelError, NotFoundError
from m2wr_sim.physics.engine import FARTHEST
from m2wr_sim.ros.convert import all_finite, read_pose, read_vector, stamp_of, write_pose
from m2wr_sim.ros.gazebo_services.joints import JointApi
from m2wr_sim.ros.gazebo_services.lights import LightApi
from m2wr_sim.ros.gazebo_services.links import LinkApi
from m2wr_sim.ros.gazebo_services.physics import PhysicsApi
from m2wr_sim.ros.gazebo_services.reconfigure import make_reconfigure
from m2wr_sim.ros.gazebo_services.spawning import Spawner
from m2wr_sim.ros.gazebo_services.table import SERVICES
from m2wr_sim.ros.loop import Loop, ShuttingDown
from m2wr_sim.runtime.entities import list_names
from m2wr_sim.runtime.forces import Forces
from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)

_DRAIN = 0.2            # s of wall time between the last message before a reset and the clock's jump back to zero
_NO_SCOPED_FRAME = ("reference relative_entity_name not found, did you forget to scope the body by model name?")


class _CountedState(GetModelStateResponse):
    """A response that keeps its ``header.seq``; in others rospy overwrites it with the number of the call."""

    _has_header = False


class GazeboApi:
    """The services. Everything that accesses the world runs in the loop's thread.

    Parameters
    ----------
    simulator : Simulator
    loop : Loop
    spawner : Spawner
    as_gazebo : bool
        Reproduce the known faults of Gazebo's services.
    set_factor : callable
        Called with a new real-time factor; 0: as fast as possible.
    """

    def __init__(self, simulator: Simulator, loop: Loop, spawner: Spawner, as_gazebo: bool,
                 set_factor: Callable[[float], None]) -> None:
        self._simulator, self._loop = simulator, loop
        self._sequence: Dict[str, int] = {}
        forces = Forces(simulator)
        simulator.add_observer(forces, "applied forces")
        self._links, self._physics = LinkApi(simulator, forces, as_gazebo), PhysicsApi(simulator, set_factor)
        parts = (self, self._links, self._physics, JointApi(simulator, forces), LightApi(simulator), spawner)
        spawner.in_loop = self._call
        self._services: List[Any] = []
        for name, kind in SERVICES.items():
            handler = next(getattr(part, name) for part in parts if hasattr(part, name))
            if not name.startswith("spawn_"):       # these parse the text first and enter the loop with the result
                handler = functools.partial(self._in_loop, handler)
            if name == "set_physics_properties":
                handler = functools.partial(self._set_physics, handler)
            self._services.append(rospy.Service("~" + name, kind, handler))
        self._commands = [
            rospy.Subscriber("~set_model_state", ModelState, self._on_message, self._put_model, queue_size=10),
            rospy.Subscriber("~set_link_state", LinkState, self._on_message, self._links.put_link, queue_size=10)]
        log.info("Finished loading Gazebo ROS API Plugin.")         # scripts wait for this line
        self._reconfigure = make_reconfigure(simulator, loop, self._physics)

    def _call(self, function: Callable[[], Any]) -> Any:
        try:
            return self._loop.call(function)
        except ShuttingDown as error:
            raise rospy.ServiceException(str(error)) from error

    def _in_loop(self, handler: Callable[[Any], Any], request: Any) -> Any:
        return self._call(lambda: handler(request))

    def _set_physics(self, handler: Callable[[Any], Any], request: Any) -> Any:
        """Set the physics, then notify clients of the dynamic parameters (outside the loop: this calls the master)."""
        response = handler(request)
        if response.success and self._reconfigure is not None:
            self._reconfigure.notify()
        return response

    def _on_message(self, message: Any, handler: Callable[[Any], Any]) -> None:
        try:
            self._loop.call(lambda: handler(message))
        except ShuttingDown:
            pass

    def close(self) -> None:
        """Withdraw the services."""
        for service in self._services:
            service.shutdown("the simulation ends")

    # ---- models ------------------------------------------------------------------------------------------------

    def get_model_state(self, request: Any) -> GetModelStateResponse:
        """Answer get_model_state; ``header.seq`` counts the calls for each model from 1."""
        response = _CountedState()
        if request.model_name not in self._simulator.models:
            response.status_message = "GetModelState: model does not exist"
            return response
        self._sequence[request.model_name] = self._sequence.get(request.model_name, 0) + 1
        response.header.seq = self._sequence[request.model_name]
        response.header.stamp = stamp_of(self._simulator.now_ns)
        response.header.frame_id = request.relative_entity_name
        try:
            state = self._simulator.model_state(request.model_name, request.relative_entity_name)
        except NotFoundError:
            response.status_message = "GetModelState: " + _NO_SCOPED_FRAME
            return response
        write_pose(response.pose, state.position, state.orientation)
        for vector, values in ((response.twist.linear, state.linear), (response.twist.angular, state.angular)):
            vector.x, vector.y, vector.z = values
        response.success, response.status_message = True, "GetModelState: got properties"
        return response

    def set_model_state(self, request: Any) -> SetModelStateResponse:
        """Answer set_model_state."""
        success, text = self._put_model(request.model_state)
        return SetModelStateResponse(success, text)

    def _put_model(self, wanted: Any) -> Tuple[bool, str]:
        if wanted.model_name not in self._simulator.models:
            log.warning("set_model_state: there is no model \"%s\"; models: %s", wanted.model_name,
                        list_names(self._simulator.models))
            return False, "SetModelState: model does not exist"
        numbers = sum(read_pose(wanted.pose), ()) + read_vector(wanted.twist.linear) + read_vector(wanted.twist.angular)
        if not all_finite(numbers):
            log.error("set_model_state: refused a state of \"%s\" with numbers that are not finite", wanted.model_name)
            return False, "SetModelState: pose or twist is not finite"
        try:
            self._simulator.set_model_state(wanted.model_name, read_pose(wanted.pose), read_vector(wanted.twist.linear),
                                            read_vector(wanted.twist.angular), wanted.reference_frame)
        except NotFoundError as error:
            log.error("set_model_state: %s", error)
            return False, "SetModelState: specified reference frame entity does not exist"
        except ModelError as error:
            log.error("set_model_state: %s", error)
            return False, "SetModelState: %s" % error
        return True, "SetModelState: set model state done"

    def set_model_configuration(self, request: Any) -> SetModelConfigurationResponse:
        """Answer set_model_configuration; ``urdf_param_name`` is not used, as in Gazebo."""
        if request.model_name not in self._simulator.models:
            return SetModelConfigurationResponse(False, "SetModelConfiguration: model does not exist")
        if len(request.joint_names) != len(request.joint_positions):
            return SetModelConfigurationResponse(
                False, "SetModelConfiguration: joint name and position list have different lengths")
        if not all_finite(request.joint_positions):
            return SetModelConfigurationResponse(False, "SetModelConfiguration: a joint position is not finite")
        wanted = dict(zip(request.joint_names, request.joint_positions))
        for joint in self._simulator.models[request.model_name].record.joints:
            position = min(joint.axis.upper, max(joint.axis.lower, wanted.get(joint.name, 0.0)))
            if joint.name in wanted and abs(position) > FARTHEST:
                return SetModelConfigurationResponse(False, "SetModelConfiguration: position %g of joint %s; expected "
                                                     "at most %g rad or m" % (position, joint.name, FARTHEST))
        self._simulator.set_joint_positions(request.model_name, wanted)
        return SetModelConfigurationResponse(True, "SetModelConfiguration: success")

    def delete_model(self, request: Any) -> DeleteModelResponse:
        """Answer delete_model."""
        if request.model_name not in self._simulator.models:
            return DeleteModelResponse(False, "DeleteModel: model does not exist")
        self._simulator.delete(request.model_name)
        return DeleteModelResponse(True, "DeleteModel: successfully deleted model")

    def get_model_properties(self, request: Any) -> GetModelPropertiesResponse:
        """Answer get_model_properties; ``canonical_body_name`` stays empty, as in Gazebo."""
        model = self._simulator.models.get(request.model_name)
        if model is None:
            return GetModelPropertiesResponse(status_message="GetModelProperties: model does not exist")
        links = [link for link in model.record.links if "::" not in link.name]      # others belong to nested models
        return GetModelPropertiesResponse(
            parent_model_name="", canonical_body_name="", body_names=[link.name for link in links],
            geom_names=[collision.name for link in links for collision in link.collisions],
            joint_names=[joint.name for joint in model.record.joints if "::" not in joint.name],
            child_model_names=[name for name in model.record.nested if "::" not in name],
            is_static=model.record.static, success=True, status_message="GetModelProperties: got properties")

    # ---- world -------------------------------------------------------------------------------------------------

    def get_world_properties(self, _: Any) -> GetWorldPropertiesResponse:
        """Answer get_world_properties."""
        return GetWorldPropertiesResponse(
            sim_time=self._simulator.now_ns * 1e-9, model_names=list(self._simulator.models), rendering_enabled=True,
            success=True, status_message="GetWorldProperties: got properties")

    def reset_world(self, _: Any) -> EmptyResponse:
        """Put the models back to their initial poses; simulated time continues."""
        self._simulator.reset_world()
        log.info("world reset: models are back at their initial poses")
        return EmptyResponse()

    def step(self, _: Any) -> TriggerResponse:
        """Make one step while the simulation is paused; answer when it is done."""
        refused = self._loop.step()
        if refused:
            return TriggerResponse(False, refused)
        return TriggerResponse(True, "time is %.9g s" % (self._simulator.now_ns * 1e-9))

    def reset_simulation(self, _: Any) -> EmptyResponse:
        """Set simulated time to zero and all models to their initial state."""
        # If robot_state_publisher receives a joint state with an old stamp after the clock was reset, it publishes
        # nothing until simulated time reaches that stamp.
        time.sleep(_DRAIN)
        self._simulator.reset_simulation()
        log.info("simulation reset: time is zero, models are in their initial state")
        return EmptyResponse()
