# SPDX-License-Identifier: BSD-3-Clause
"""Calls of the simulation's services, with the names and return values of Gazebo's module."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Optional, Sequence

import rospy

from gazebo_msgs.srv import SetModelConfiguration, SpawnModel

if TYPE_CHECKING:
    from geometry_msgs.msg import Pose

_SETTLING_TIME = 1.0        # s of wall time between a spawn and the joint positions, as in Gazebo's client


def _call(service: str, kind: Any, told: str, *arguments: Any) -> Optional[bool]:
    """Wait for a service and call it; returns its ``success``, or None if the call itself failed."""
    rospy.loginfo('Calling service %s', service)
    try:
        response = rospy.ServiceProxy(service, kind)(*arguments)
    except rospy.ServiceException as error:
        rospy.logerr('Service call failed: %s', error)
        return None
    rospy.loginfo('%s: %s', told, response.status_message)
    return bool(response.success)


def _wait(service: str) -> None:
    rospy.loginfo('Waiting for service %s', service)
    rospy.wait_for_service(service)


def _spawn(name: str, gazebo_namespace: str, *arguments: Any) -> Optional[bool]:
    service = '%s/%s' % (gazebo_namespace.rstrip('/'), name)
    _wait(service)
    return _call(service, SpawnModel, 'Spawn status', *arguments)


def spawn_urdf_model_client(model_name: str, model_xml: str, robot_namespace: str, initial_pose: Pose,
                            reference_frame: str, gazebo_namespace: str) -> Optional[bool]:
    """Spawn a model described in URDF.

    Parameters
    ----------
    model_name : str
        Name in the simulation.
    model_xml : str
        The description itself.
    robot_namespace : str
        Namespace for plugins that name none.
    initial_pose : geometry_msgs.msg.Pose
        Pose in ``reference_frame`` [m].
    reference_frame : str
        A model, a link ``model::link``, or empty for the world.
    gazebo_namespace : str
        Namespace of the services, usually ``/gazebo``.

    Returns
    -------
    bool or None
        Whether it was spawned; None if the service itself failed. Waits without limit for the service.
    """
    return _spawn('spawn_urdf_model', gazebo_namespace, model_name, model_xml, robot_namespace, initial_pose,
                  reference_frame)


def spawn_sdf_model_client(model_name: str, model_xml: str, robot_namespace: str, initial_pose: Pose,
                           reference_frame: str, gazebo_namespace: str) -> Optional[bool]:
    """Spawn a model described in SDF.

    Parameters
    ----------
    model_name, model_xml, robot_namespace, initial_pose, reference_frame, gazebo_namespace
        As for :func:`spawn_urdf_model_client`.

    Returns
    -------
    bool or None
        As for :func:`spawn_urdf_model_client`.
    """
    return _spawn('spawn_sdf_model', gazebo_namespace, model_name, model_xml, robot_namespace, initial_pose,
                  reference_frame)


def set_model_configuration_client(model_name: str, model_param_name: str, joint_names: Sequence[str],
                                   joint_positions: Sequence[float], gazebo_namespace: str) -> Optional[bool]:
    """Set joint positions, one second after the service is available.

    Parameters
    ----------
    model_name : str
    model_param_name : str
        Parameter with the URDF; not used by the simulation.
    joint_names : list of str
    joint_positions : list of float
        Angles [rad] or lengths [m], in the order of the names.
    gazebo_namespace : str

    Returns
    -------
    bool or None
        Whether they were set; None if the service itself failed.
    """
    service = gazebo_namespace.rstrip('/') + '/set_model_configuration'
    _wait(service)
    time.sleep(_SETTLING_TIME)
    return _call(service, SetModelConfiguration, 'Set model configuration status', model_name, model_param_name,
                 joint_names, joint_positions)
