"""Gazebo's services and command topics under ``~``, as calls of the simulator; texts are Gazebo's to the letter."""
import functools
import logging
import time

import rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import (DeleteModel, DeleteModelResponse, GetModelProperties, GetModelPropertiesResponse,
                             GetModelState, GetModelStateResponse, GetWorldProperties, GetWorldPropertiesResponse,
                             SetModelConfiguration, SetModelConfigurationResponse, SetModelState,
                             SetModelStateResponse, SpawnModel)
from std_srvs.srv import Empty, EmptyResponse

from m2wr_sim.errors import ModelError, NotFoundError
from m2wr_sim.ros.convert import read_pose, read_vector, stamp_of, write_pose
from m2wr_sim.ros.loop import ShuttingDown
from m2wr_sim.ros.spawning import Spawner
from m2wr_sim.runtime.entities import tell

log = logging.getLogger(__name__)

_DRAIN = 0.2            # s of wall time between the last message of the old time and the clock's jump back to zero
_NO_SCOPED_FRAME = ("reference relative_entity_name not found, did you forget to scope the body by model name?")


class GazeboApi:
    """The services; every handler body runs in the loop's thread.

    Parameters
    ----------
    simulator : Simulator
    loop : Loop
    spawner : Spawner
    """

    def __init__(self, simulator, loop, spawner=None):
        self._simulator, self._loop = simulator, loop
        self._spawner = spawner or Spawner(simulator)
        self._sequence = {}
        self._services = []
        for name, kind, handler in (
                ("get_model_state", GetModelState, self.get_model_state),
                ("set_model_state", SetModelState, self.set_model_state),
                ("set_model_configuration", SetModelConfiguration, self.set_model_configuration),
                ("get_model_properties", GetModelProperties, self.get_model_properties),
                ("get_world_properties", GetWorldProperties, self.get_world_properties),
                ("spawn_urdf_model", SpawnModel, self._spawner.spawn_urdf),
                ("spawn_sdf_model", SpawnModel, self._spawner.spawn_sdf),
                ("delete_model", DeleteModel, self.delete_model),
                ("pause_physics", Empty, self.pause), ("unpause_physics", Empty, self.unpause),
                ("reset_world", Empty, self.reset_world), ("reset_simulation", Empty, self.reset_simulation)):
            self._services.append(rospy.Service("~" + name, kind, functools.partial(self._in_loop, handler)))
        self._commands = rospy.Subscriber("~set_model_state", ModelState, self._on_model_state, queue_size=10)

    def _in_loop(self, handler, request):
        try:
            return self._loop.call(lambda: handler(request))
        except ShuttingDown as error:
            raise rospy.ServiceException(str(error))

    def close(self):
        """Withdraw the services."""
        for service in self._services:
            service.shutdown("the simulation ends")

    # ---- models ------------------------------------------------------------------------------------------------

    def get_model_state(self, request):
        """Answer get_model_state; ``header.seq`` counts the answers for each model from 1."""
        response = GetModelStateResponse()
        if request.model_name not in self._simulator.models:
            response.status_message = "GetModelState: model does not exist"
            return response
        try:
            state = self._simulator.model_state(request.model_name, request.relative_entity_name)
        except NotFoundError:
            response.status_message = "GetModelState: " + _NO_SCOPED_FRAME
            return response
        self._sequence[request.model_name] = self._sequence.get(request.model_name, 0) + 1
        response.header.seq = self._sequence[request.model_name]
        response.header.stamp = stamp_of(self._simulator.now_ns)
        response.header.frame_id = request.relative_entity_name
        write_pose(response.pose, state.position, state.orientation)
        for vector, values in ((response.twist.linear, state.linear), (response.twist.angular, state.angular)):
            vector.x, vector.y, vector.z = values
        response.success, response.status_message = True, "GetModelState: got properties"
        return response

    def set_model_state(self, request):
        """Answer set_model_state."""
        success, text = self._set_model_state(request.model_state)
        return SetModelStateResponse(success, text)

    def _set_model_state(self, wanted):
        if wanted.model_name not in self._simulator.models:
            log.warning("set_model_state: there is no model \"%s\"; models: %s", wanted.model_name,
                        tell(self._simulator.models))
            return False, "SetModelState: model does not exist"
        numbers = sum(read_pose(wanted.pose), ()) + read_vector(wanted.twist.linear) + read_vector(wanted.twist.angular)
        if not all(abs(number) < float("inf") for number in numbers):
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

    def _on_model_state(self, message):
        try:
            self._loop.call(lambda: self._set_model_state(message))
        except ShuttingDown:
            pass

    def set_model_configuration(self, request):
        """Answer set_model_configuration; ``urdf_param_name`` is not used, as in Gazebo."""
        if request.model_name not in self._simulator.models:
            return SetModelConfigurationResponse(False, "SetModelConfiguration: model does not exist")
        if len(request.joint_names) != len(request.joint_positions):
            return SetModelConfigurationResponse(
                False, "SetModelConfiguration: joint name and position list have different lengths")
        if not all(abs(position) < float("inf") for position in request.joint_positions):
            return SetModelConfigurationResponse(False, "SetModelConfiguration: a joint position is not finite")
        self._simulator.set_joint_positions(request.model_name, dict(zip(request.joint_names, request.joint_positions)))
        return SetModelConfigurationResponse(True, "SetModelConfiguration: success")

    def delete_model(self, request):
        """Answer delete_model."""
        if request.model_name not in self._simulator.models:
            return DeleteModelResponse(False, "DeleteModel: model does not exist")
        self._simulator.delete(request.model_name)
        return DeleteModelResponse(True, "DeleteModel: successfully deleted model")

    def get_model_properties(self, request):
        """Answer get_model_properties; ``canonical_body_name`` stays empty, as in Gazebo."""
        model = self._simulator.models.get(request.model_name)
        if model is None:
            return GetModelPropertiesResponse(status_message="GetModelProperties: model does not exist")
        links = model.record.links
        return GetModelPropertiesResponse(
            parent_model_name="", canonical_body_name="", body_names=[link.name for link in links],
            geom_names=[collision.name for link in links for collision in link.collisions],
            joint_names=[joint.name for joint in model.record.joints], child_model_names=list(model.record.nested),
            is_static=model.record.static, success=True, status_message="GetModelProperties: got properties")

    # ---- world -------------------------------------------------------------------------------------------------

    def get_world_properties(self, _):
        """Answer get_world_properties."""
        return GetWorldPropertiesResponse(
            sim_time=self._simulator.now_ns * 1e-9, model_names=list(self._simulator.models), rendering_enabled=True,
            success=True, status_message="GetWorldProperties: got properties")

    def pause(self, _):
        """Stop time; services go on."""
        self._simulator.paused = True
        return EmptyResponse()

    def unpause(self, _):
        """Let time go on."""
        self._simulator.paused = False
        return EmptyResponse()

    def reset_world(self, _):
        """Put models back; time goes on."""
        self._simulator.reset_world()
        log.info("world reset: models are back at their initial poses")
        return EmptyResponse()

    def reset_simulation(self, _):
        """Start over at time zero."""
        # robot_state_publisher falls silent until the old time comes again if a joint state of the old time reaches it
        # after the clock has gone back
        time.sleep(_DRAIN)
        self._simulator.reset_simulation()
        log.info("simulation reset: time is zero, models are as at the start")
        return EmptyResponse()
