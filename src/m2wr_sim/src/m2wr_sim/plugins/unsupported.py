# SPDX-License-Identifier: BSD-3-Clause
"""Plugins that are not supported: what each does, the consequence of its absence, and an alternative.

Each library has one entry, see :class:`Missing`. In topics ``{tag=default}`` stands for the text of a tag. A topic
whose tag has neither text nor default is not listed. Sources: gazebo_plugins 2.9.2, hector_gazebo_plugins 0.5.4,
velodyne_gazebo_plugins 1.0, kobuki_gazebo_plugins 0.5, the plugins of Gazebo 11.
"""
from __future__ import annotations

import logging
import re
from typing import List, NamedTuple, Optional, Set, Tuple

from m2wr_sim.model.types import PluginSpec
from m2wr_sim.model.xml.safe import shorten
from m2wr_sim.plugins.registry import library_name

log = logging.getLogger(__name__)

_MOST_REMEMBERED = 1000     # plugins that were reported
_MAY_BE_EMPTY = ("cameraName", "prefix", "robotNamespace")
_MOST_TOPICS = 10           # listed for one unknown plugin
_PLACE = re.compile(r"\{(\w+)(?:=([^}]*))?\}")

_CAMERAS = "use libgazebo_ros_camera.so"
_NOT_SHOWN = "images are not shown in the world"
_DEPTH = "use libgazebo_ros_openni_kinect.so or libgazebo_ros_depth_camera.so in a sensor of type depth"
_DRIVES = "use libgazebo_ros_diff_drive.so, libgazebo_ros_skid_steer_drive.so or libgazebo_ros_planar_move.so"
_PLANAR = "use libgazebo_ros_planar_move.so, which takes the same commands"
_LAYERS = "use libgazebo_ros_velodyne_laser.so"
_FORCES = "use the service apply_body_wrench or libgazebo_ros_force.so"
_PLACES = "use the service or topic set_model_state"
_JOINTS = "use the service apply_joint_effort"
_SURFACE = "use <slip1> and <slip2> of a collision's <surface>"
_TRUTH = "use libgazebo_ros_p3d.so for the pose in the world"
_ROS_CONTROL = ("use libgazebo_ros_diff_drive.so for wheels, the service apply_joint_effort for any joint; the "
                "controllers of ros_control are libraries for Gazebo's process")


class Missing(NamedTuple):
    """One plugin; the message is "It ``does``; ``follows``.". Topics are separated by spaces."""

    does: str
    follows: str
    publishes: str = ""
    reads: str = ""
    instead: str = ""


_DRIVE = Missing("drives this robot", "it will not move", "{odometryTopic=odom}", "{commandTopic=cmd_vel}", _DRIVES)
_FORCE_DRIVE = _DRIVE._replace(instead=_PLANAR)
_GAZEBO_DRIVE = Missing("drives this model by Gazebo messages", "it will not move", instead=_DRIVES)
_CLOUD = Missing("measures distances in several layers", "no point cloud", "{topicName=/points}", "", _LAYERS)
_CAMERA = Missing("publishes images", "no images", "{cameraName}/{imageTopicName=image_raw} "
                  "{cameraName}/{cameraInfoTopicName=camera_info}", "", _CAMERAS)
_REALSENSE = Missing("publishes depth images", "no images and no point cloud",
                     "{prefix}/{colorTopicName} {prefix}/{depthTopicName} "
                     "{prefix}/{pointCloudTopicName}", "", _DEPTH)
_ACTOR = Missing("animates an actor", "no actor", instead=_PLACES)

UNSUPPORTED = {
    # -- drives
    "libgazebo_ros_ackerman.so": _DRIVE,
    "libgazebo_ros_ackermann_drive.so": _DRIVE,
    "libdiffdrive_plugin_6w.so": _DRIVE._replace(publishes="odom", reads="{topicName=cmd_vel}"),
    "libdiffdrive_plugin_multi_wheel.so": _DRIVE,
    "libhusky_gazebo_plugins.so": _DRIVE._replace(publishes="odom joint_states", reads="cmd_vel"),
    "libgazebo_ros_create.so": Missing(
        "drives this robot and reads its bumpers", "it will not move", "odom joint_states", "cmd_vel", _DRIVES),
    "libgazebo_ros_force_based_move.so": _FORCE_DRIVE,
    "libridgeback_ros_force_based_move.so": _FORCE_DRIVE,
    "libnexus_ros_force_based_move.so": _FORCE_DRIVE,
    "libDiffDrivePlugin.so": _GAZEBO_DRIVE,
    "libSkidSteerDrivePlugin.so": _GAZEBO_DRIVE,
    "libSimpleTrackedVehiclePlugin.so": _GAZEBO_DRIVE,
    "libWheelTrackedVehiclePlugin.so": _GAZEBO_DRIVE,
    "libVehiclePlugin.so": _GAZEBO_DRIVE,
    "libCartDemoPlugin.so": _GAZEBO_DRIVE,
    # -- joints
    "libgazebo_ros2_control.so": Missing(
        "runs the controllers of ros2_control, for ROS 2 only", "no controller drives a joint", instead=_ROS_CONTROL),
    "libroboticsgroup_gazebo_disable_link_plugin.so": Missing("disables link {link}", "it stays enabled"),
    "libroboticsgroup_upatras_gazebo_disable_link_plugin.so": Missing("disables link {link}", "it stays enabled"),
    "libgazebo_ros_joint_pose_trajectory.so": Missing(
        "moves joints along a trajectory", "they do not move", "", "{topicName=set_joint_trajectory}",
        "use the service set_model_configuration"),
    "libhector_servo_plugin.so": Missing("drives a servo", "it does not move", "", "{topicName=drive}", _JOINTS),
    "libJointControlPlugin.so": Missing("drives joints", "they move freely", instead=_JOINTS),
    "libJointTrajectoryPlugin.so": Missing("moves joints along a trajectory", "they move freely", instead=_JOINTS),
    "libActuatorPlugin.so": Missing("limits joints as motors do", "only the limits of the description apply"),
    "libVariableGearboxPlugin.so": Missing("couples joints by a gear", "they move freely"),
    "libBreakableJointPlugin.so": Missing("lets a joint break", "it never breaks"),
    "libleo_gazebo_differential_plugin.so": Missing("couples the two rockers", "they move freely"),
    # -- grippers, ropes, surfaces, moving parts of the world
    "libgazebo_grasp_fix.so": Missing("fixes grasped objects to a gripper", "a closed gripper holds by friction only"),
    "libgazebo_ros_vacuum_gripper.so": Missing(
        "attracts bodies to the link", "no suction", "{topicName}", "", _FORCES),
    "libgazebo_ros_link_attacher.so": Missing(
        "attaches links at run time", "its services attach and detach are missing"),
    "libgazebo_ros_hand_of_god.so": Missing(
        "moves the body to a tf frame", "it does not follow the frame", instead=_PLACES),
    "libgazebo_ros_elevator.so": Missing("moves an elevator", "it does not move", "", "{topic=elevator}", _PLACES),
    "libElevatorPlugin.so": Missing("moves an elevator", "it does not move", instead=_PLACES),
    "libROSConveyorBeltPlugin.so": Missing("moves a conveyor belt", "it does not move"),
    "libTransporterPlugin.so": Missing("moves models from pad to pad", "they do not move", instead=_PLACES),
    "libMudPlugin.so": Missing("simulates mud", "the ground is firm"),
    # -- lasers
    "libgazebo_ros_ouster_laser.so": _CLOUD,
    "libgazebo_ros_livox_laser.so": _CLOUD._replace(publishes="{ros_topic}"),
    "liblivox_laser_simulation.so": _CLOUD._replace(publishes="{ros_topic}"),
    "libgazebo_ros_ray_sensor.so": Missing(
        "publishes a scan, for ROS 2 only", "no scan", instead="use libgazebo_ros_laser.so of ROS 1"),
    # -- cameras
    "libgazebo_ros_prosilica.so": _CAMERA,
    "libgazebo_ros_thermal_camera.so": _CAMERA,
    "libgazebo_ros_thermal_depth_camera.so": _CAMERA,
    "libgazebo_ros_triggered_multicamera.so": _CAMERA,
    "librealsense_gazebo_plugin.so": _REALSENSE,
    "libgazebo_ros_realsense.so": _REALSENSE,
    "libgazebo_ros_video.so": Missing(
        "shows images on a surface", "the surface is plain", "", "{topicName=image_raw}", _NOT_SHOWN),
    "libgazebo_ros_projector.so": Missing(
        "projects an image", "no projection", "", "{projectorTopicName} {textureTopicName}", _NOT_SHOWN),
    "libgazebo_video_recorder.so": Missing("records a video", "no file", instead="use image_dump of m2wr_view"),
    "libROSLogicalCameraPlugin.so": Missing(
        "lists the models in view", "no list", instead="use /gazebo/model_states"),
    # -- position, contacts and the rest
    "libhector_gazebo_reset_plugin.so": Missing("reports resets", "resets are not reported", "syscommand"),
    "libgazebo_ros_world_odometry.so": Missing(
        "publishes the true pose", "no odometry", "{topicName=world_odom}", "", _TRUTH),
    "libgazebo_ros_f3d.so": Missing(
        "measures the force on a body", "no data", "{topicName}", "",
        "use libgazebo_ros_ft_sensor.so at a joint"),
    "libgazebo_ros_contact.so": Missing(
        "publishes the contacts of a body", "no contacts", "{topicName}", "", "use libgazebo_ros_bumper.so"),
    "libgazebo_ros_power_monitor.so": Missing("publishes the charge of a battery", "no data", "{powerStateTopic}"),
    "libgazebo_ros_moveit_planning_scene.so": Missing("sends the planning scene to MoveIt", "no planning scene"),
    "libLinearBatteryPlugin.so": Missing("simulates a battery", "no battery"),
    "libLiftDragPlugin.so": Missing("simulates lift and drag", "no lift and drag", instead=_FORCES),
    "libBuoyancyPlugin.so": Missing("simulates buoyancy", "bodies sink", instead=_FORCES),
    "libWindPlugin.so": Missing("simulates wind", "no wind", instead=_FORCES),
    "libGravityCompensationPlugin.so": Missing(
        "compensates gravity", "links sink", instead="set <gravity> of a link to false"),
    "libInitialVelocityPlugin.so": Missing("sets the initial velocity", "the model starts at rest", instead=_PLACES),
    "libRandomVelocityPlugin.so": Missing("moves a link at random", "it does not move", instead=_PLACES),
    "libFollowerPlugin.so": Missing("makes this model follow another", "it does not move", instead=_PLACES),
    "libActorPlugin.so": _ACTOR,
    "libgazebo_ros_actor.so": _ACTOR,
    "libgazebo_ros_actor_plugin.so": _ACTOR,
    "libPedestrianSFMPlugin.so": _ACTOR,
    "libActorCollisionsPlugin.so": Missing("gives an actor a collision shape", "no collision shape", instead=_PLACES),
}

#: Plugins that are not needed, and why.
NOT_NEEDED = {
    "libgazebo_ros_api_plugin.so": "Gazebo's services and topics are built in",
    "libgazebo_ros_paths_plugin.so": "exported model paths are always searched",
    "libgazebo_ros_init.so": "/clock is built in",
    "libgazebo_ros_factory.so": "the services to spawn and delete are built in",
    "libgazebo_ros_state.so": "the services for states are built in",
    "libRayPlugin.so": "it only prints measurements and has no ROS interface",
    "libGpuRayPlugin.so": "it only prints measurements and has no ROS interface",
    "libContactPlugin.so": "it only prints measurements and has no ROS interface",
    "libCameraPlugin.so": "it has no ROS interface",
    "libDepthCameraPlugin.so": "it has no ROS interface",
    "libImuSensorPlugin.so": "it has no ROS interface",
    "libSimEventsPlugin.so": "it reports events to Gazebo only and has no ROS interface",
    "libFlashLightPlugin.so": "light is not simulated",
    "libLedPlugin.so": "light is not simulated",
    "libAttachLightPlugin.so": "light is not simulated",
    "libLensFlareSensorPlugin.so": "light is not simulated",
    "libHeightmapLODPlugin.so": "it only affects viewers",
    "libKeyboardGUIPlugin.so": "it only affects viewers",
}
NOT_NEEDED.update({
    "lib%s-%s-system.so" % (family, system): "this part of Gazebo Sim is built in"
    for family in ("gz-sim", "ignition-gazebo")
    for system in ("physics", "user-commands", "scene-broadcaster", "sensors", "imu", "contact")})


class UnsupportedPlugins:
    """Reports unsupported plugins, once for all models of a description."""

    def __init__(self) -> None:
        self._reported: Set[int] = set()

    def report(self, owner: str, spec: PluginSpec, namespace: Optional[str]) -> None:
        """Log a warning about an unsupported plugin, or an info if it is not needed.

        Parameters
        ----------
        owner : str
            Name of the model, or "the world".
        spec : PluginSpec
        namespace : str or None
            ROS namespace for plugins without one of their own.
        """
        key = hash((spec.filename, spec.name, spec.parameters, spec.reference))
        if key in self._reported:
            return
        if len(self._reported) >= _MOST_REMEMBERED:
            self._reported.clear()
        self._reported.add(key)
        text, missing = explain(spec, owner, namespace)
        log.log(logging.WARNING if missing else logging.INFO, "%s", text)


def explain(spec: PluginSpec, owner: str, namespace: Optional[str] = None) -> Tuple[str, bool]:
    """Return a message about an unsupported plugin.

    Parameters
    ----------
    spec : PluginSpec
    owner : str
        Name of the model, or "the world".
    namespace : str or None
        ROS namespace for plugins without one of their own.

    Returns
    -------
    str, bool
        The message, and whether the simulation lacks a function of the plugin.
    """
    library = library_name(spec.filename)
    if library in NOT_NEEDED:
        return "%s: plugin %s is not needed: %s." % (owner, library, NOT_NEEDED[library]), False
    known = UNSUPPORTED.get(library)
    text = ["%s: plugin %s is not supported; %s is ignored." % (owner, shorten(library), spec.where or spec.name)]
    if known is None:
        text.append("Its function is missing.")
        named = _topic_tags(spec)
        if named:
            text.append("The topics of its tags do not exist: %s."
                        % ", ".join("%s (<%s>)" % (shorten(value), tag) for tag, value in named[:_MOST_TOPICS]))
    else:
        text.append("It %s; without it: %s." % (_filled(known.does, spec, "?"), known.follows))
        scope = spec.find("robotNamespace") or namespace or ""
        for verb, topics in (("published", known.publishes), ("subscribed", known.reads)):
            filled = [_filled(word, spec) for word in topics.split()]
            missing = [_in_namespace(scope, topic) for topic in filled if topic]
            if missing:
                text.append("Not %s: %s." % (verb, ", ".join(missing)))
        if known.instead:
            text.append("Alternative: %s." % known.instead)
    return " ".join(text), True


def _filled(template: str, spec: PluginSpec, missing: Optional[str] = None) -> Optional[str]:
    """Return the template with the texts of tags, or None if one has neither text nor default."""
    found = {tag: shorten(spec.find(tag) or default) or missing for tag, default in _PLACE.findall(template)}
    found = {tag: "" if text is None and tag in _MAY_BE_EMPTY else text for tag, text in found.items()}
    if None in found.values():
        return None
    for tag in found:
        if not found[tag]:
            template = template.replace("{%s}/" % tag, "")
    return _PLACE.sub(lambda place: found[place.group(1)] or "", template)


def _in_namespace(namespace: str, topic: str) -> str:
    """Return a topic's full name."""
    return re.sub("/+", "/", topic if topic.startswith("/") else "/%s/%s" % (namespace, topic))


def _topic_tags(spec: PluginSpec) -> List[Tuple[str, str]]:
    """Return the (tag, text) pairs of a plugin that name topics."""
    return [(tag, text) for tag, text in spec.parameters
            if text and re.search("topic(_?name)?$", tag.rpartition("/")[2], re.IGNORECASE)]
