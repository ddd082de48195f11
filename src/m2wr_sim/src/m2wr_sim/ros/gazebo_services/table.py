# SPDX-License-Identifier: BSD-3-Clause
"""The services of the simulation: name and type; each name is that of a method of a class in this folder."""
from typing import Any, Dict

from std_srvs.srv import Empty, Trigger

from gazebo_msgs import srv

SERVICES: Dict[str, Any] = {
    "apply_body_wrench": srv.ApplyBodyWrench,
    "apply_joint_effort": srv.ApplyJointEffort,
    "clear_body_wrenches": srv.BodyRequest,
    "clear_joint_forces": srv.JointRequest,
    "delete_light": srv.DeleteLight,
    "delete_model": srv.DeleteModel,
    "get_joint_properties": srv.GetJointProperties,
    "get_light_properties": srv.GetLightProperties,
    "get_link_properties": srv.GetLinkProperties,
    "get_link_state": srv.GetLinkState,
    "get_model_properties": srv.GetModelProperties,
    "get_model_state": srv.GetModelState,
    "get_physics_properties": srv.GetPhysicsProperties,
    "get_world_properties": srv.GetWorldProperties,
    "pause_physics": Empty,
    "reset_simulation": Empty,
    "reset_world": Empty,
    "set_joint_properties": srv.SetJointProperties,
    "set_light_properties": srv.SetLightProperties,
    "set_link_properties": srv.SetLinkProperties,
    "set_link_state": srv.SetLinkState,
    "set_model_configuration": srv.SetModelConfiguration,
    "set_model_state": srv.SetModelState,
    "set_physics_properties": srv.SetPhysicsProperties,
    "spawn_sdf_model": srv.SpawnModel,
    "spawn_urdf_model": srv.SpawnModel,
    "step": Trigger,
    "unpause_physics": Empty,
}
