# SPDX-License-Identifier: BSD-3-Clause
"""Plugins that are not here: what each would have done, what follows without it, and what can be done instead.

One entry a library, see :class:`LeftOut`.  In topics ``{tag=default}`` stands for the text of a tag; a topic whose tag
has neither text nor default is not named.  Sources: gazebo_plugins 2.9.2, hector_gazebo_plugins 0.5.4,
velodyne_gazebo_plugins 1.0, kobuki_gazebo_plugins 0.5, the plugins of Gazebo 11.
"""
import logging
import re
from typing import NamedTuple

from m2wr_sim.model.xml.safe import shorten
from m2wr_sim.plugins.registry import library_name

log = logging.getLogger(__name__)

_MOST_REMEMBERED = 1000     # plugins of which it is remembered that they were named
_MAY_BE_EMPTY = ("cameraName", "prefix", "robotNamespace")
_MOST_TOPICS = 10           # of one plugin that is not known
_PLACE = re.compile(r"\{(\w+)(?:=([^}]*))?\}")

_RENDERER = "images need a renderer, which this simulation does not have"
_DEPTH = _RENDERER + "; a ray sensor with libgazebo_ros_laser.so gives a scan"
_DRIVES = "libgazebo_ros_diff_drive.so, libgazebo_ros_skid_steer_drive.so and libgazebo_ros_planar_move.so are here"
_PLANAR = "libgazebo_ros_planar_move.so is here and reads the same commands"
_FLAT = "libgazebo_ros_laser.so is here, for scans in one plane"
_IMUS = "libgazebo_ros_imu_sensor.so and libgazebo_ros_imu.so are here"
_FORCES = "the service apply_body_wrench and libgazebo_ros_force.so push bodies"
_PLACES = "the service and topic set_model_state move models"
_JOINTS = "the service apply_joint_effort drives joints"
_SURFACE = "<slip1> and <slip2> of a collision's <surface> are read"
_TRUTH = "libgazebo_ros_p3d.so gives the pose in the world"
_ROS_CONTROL = ("libgazebo_ros_diff_drive.so drives a robot on wheels, the service apply_joint_effort any joint; the "
                "controllers of ros_control are libraries for Gazebo's own process")


class LeftOut(NamedTuple):
    """One plugin: "It ``does``: ``follows``." is said of it; topics are separated by blanks."""

    does: str
    follows: str
    publishes: str = ""
    reads: str = ""
    instead: str = ""
    by_model: bool = False      # topics without a namespace begin with the model's name


_DRIVE = LeftOut("drives this robot", "it will not move", "{odometryTopic=odom}", "{commandTopic=cmd_vel}", _DRIVES)
_FORCE_DRIVE = _DRIVE._replace(instead=_PLANAR)
_MUTE_DRIVE = LeftOut("drives this model by Gazebo's own messages", "it will not move", instead=_DRIVES)
_MIMIC = LeftOut("lets joint {mimicJoint} follow joint {joint}", "it swings freely", instead=_JOINTS)
_CLOUD = LeftOut("measures distances in several layers", "no cloud", "{topicName=/points}", "", _FLAT)
_CAMERA = LeftOut("takes pictures", "no pictures", "{cameraName}/{imageTopicName=image_raw} "
                  "{cameraName}/{cameraInfoTopicName=camera_info}", "", _RENDERER)
_STEREO = LeftOut("takes pictures by several cameras", "no pictures", "{cameraName}/left/{imageTopicName=image_raw} "
                  "{cameraName}/right/{imageTopicName=image_raw}", "", _RENDERER)
_KINECT = LeftOut("takes depth pictures", "no pictures and no cloud", "{cameraName}/{imageTopicName=ir/image_raw} "
                  "{cameraName}/{depthImageTopicName=depth/image_raw} {cameraName}/{pointCloudTopicName=points}", "",
                  _DEPTH)
_REALSENSE = _KINECT._replace(
    publishes="{prefix}/{colorTopicName} {prefix}/{depthTopicName} {prefix}/{pointCloudTopicName}")
_SLIP = LeftOut("sets the slip of wheels", "they have the slip of the description", instead=_SURFACE)
_ACTOR = LeftOut("lets an actor walk", "there is none", instead=_PLACES)

LEFT_OUT = {
    # -- drives
    "libgazebo_ros_tricycle_drive.so": _DRIVE._replace(by_model=True),
    "libgazebo_ros_ackerman.so": _DRIVE,
    "libgazebo_ros_ackermann_drive.so": _DRIVE,
    "libdiffdrive_plugin_6w.so": _DRIVE._replace(publishes="odom", reads="{topicName=cmd_vel}"),
    "libdiffdrive_plugin_multi_wheel.so": _DRIVE,
    "libhusky_gazebo_plugins.so": _DRIVE._replace(publishes="odom joint_states", reads="cmd_vel"),
    "libgazebo_ros_kobuki.so": LeftOut(
        "drives this robot and reads its bumpers and cliff sensors", "it will not move",
        "odom joint_states mobile_base/events/bumper", "mobile_base/commands/velocity", _DRIVES),
    "libgazebo_ros_create.so": LeftOut(
        "drives this robot and reads its bumpers", "it will not move", "odom joint_states", "cmd_vel", _DRIVES),
    "libgazebo_ros_force_based_move.so": _FORCE_DRIVE,
    "libridgeback_ros_force_based_move.so": _FORCE_DRIVE,
    "libnexus_ros_force_based_move.so": _FORCE_DRIVE,
    "libDiffDrivePlugin.so": _MUTE_DRIVE,
    "libSkidSteerDrivePlugin.so": _MUTE_DRIVE,
    "libSimpleTrackedVehiclePlugin.so": _MUTE_DRIVE,
    "libWheelTrackedVehiclePlugin.so": _MUTE_DRIVE,
    "libVehiclePlugin.so": _MUTE_DRIVE,
    "libCartDemoPlugin.so": _MUTE_DRIVE,
    # -- joints
    "libgazebo_ros_control.so": LeftOut(
        "runs the controllers of ros_control", "no controller drives a joint and there is no controller_manager",
        instead=_ROS_CONTROL),
    "libgazebo_ros2_control.so": LeftOut(
        "runs the controllers of ros2_control, for ROS 2 only", "no controller drives a joint", instead=_ROS_CONTROL),
    "libroboticsgroup_gazebo_mimic_joint_plugin.so": _MIMIC,
    "libroboticsgroup_upatras_gazebo_mimic_joint_plugin.so": _MIMIC,
    "libmimic_joint_plugin.so": _MIMIC,
    "libgazebo_mimic_joint_plugin.so": _MIMIC,
    "libroboticsgroup_gazebo_disable_link_plugin.so": LeftOut("switches link {link} off", "it stays"),
    "libroboticsgroup_upatras_gazebo_disable_link_plugin.so": LeftOut("switches link {link} off", "it stays"),
    "libgazebo_ros_joint_pose_trajectory.so": LeftOut(
        "moves joints along a trajectory", "they stay where they are", "", "{topicName=set_joint_trajectory}",
        "the service set_model_configuration sets joints"),
    "libhector_servo_plugin.so": LeftOut("turns a servo", "it stays where it is", "", "{topicName=drive}", _JOINTS),
    "libJointControlPlugin.so": LeftOut("drives joints", "they move freely", instead=_JOINTS),
    "libJointTrajectoryPlugin.so": LeftOut("moves joints along a trajectory", "they move freely", instead=_JOINTS),
    "libActuatorPlugin.so": LeftOut("limits joints as motors do", "only the limits of the description hold"),
    "libVariableGearboxPlugin.so": LeftOut("couples joints by a gear", "they move freely"),
    "libBreakableJointPlugin.so": LeftOut("lets a joint break", "it holds"),
    "libleo_gazebo_differential_plugin.so": LeftOut("couples the two rockers", "they swing freely"),
    # -- grippers, ropes, surfaces, moving parts of the world
    "libgazebo_grasp_fix.so": LeftOut("holds what a hand grasps", "a closed hand holds by friction alone"),
    "libgazebo_ros_vacuum_gripper.so": LeftOut(
        "draws bodies to the link", "nothing is drawn", "{topicName}", "", _FORCES),
    "libgazebo_ros_link_attacher.so": LeftOut("joins links at run time", "its services attach and detach are missing"),
    "libgazebo_ros_harness.so": LeftOut(
        "hangs the model on a rope", "it falls", "", "{robotNamespace}/velocity {robotNamespace}/detach"),
    "libHarnessPlugin.so": LeftOut("hangs the model on a rope", "it falls"),
    "libgazebo_ros_wheel_slip.so": _SLIP,
    "libWheelSlipPlugin.so": _SLIP,
    "libgazebo_ros_hand_of_god.so": LeftOut("drags the body after a tf frame", "it is not dragged", instead=_PLACES),
    "libgazebo_ros_elevator.so": LeftOut("moves a lift", "it stands still", "", "{topic=elevator}", _PLACES),
    "libElevatorPlugin.so": LeftOut("moves a lift", "it stands still", instead=_PLACES),
    "libROSConveyorBeltPlugin.so": LeftOut("moves a conveyor belt", "it stands still"),
    "libTransporterPlugin.so": LeftOut("moves models from pad to pad", "they stay", instead=_PLACES),
    "libMudPlugin.so": LeftOut("makes the ground hold wheels as mud does", "it is firm"),
    # -- lasers
    "libgazebo_ros_block_laser.so": _CLOUD._replace(publishes="{topicName=/world}"),
    "libgazebo_ros_velodyne_laser.so": _CLOUD,
    "libgazebo_ros_velodyne_gpu_laser.so": _CLOUD,
    "libgazebo_ros_ouster_laser.so": _CLOUD,
    "libgazebo_ros_livox_laser.so": _CLOUD._replace(publishes="{ros_topic}"),
    "liblivox_laser_simulation.so": _CLOUD._replace(publishes="{ros_topic}"),
    "libgazebo_ros_ray_sensor.so": LeftOut(
        "publishes a scan, for ROS 2 only", "no scan", instead="libgazebo_ros_laser.so is that of ROS 1"),
    "libhector_gazebo_ros_sonar.so": LeftOut(
        "measures a distance", "no range", "{topicName=sonar}", "", "libgazebo_ros_range.so is here"),
    # -- cameras
    "libgazebo_ros_camera.so": _CAMERA,
    "libgazebo_ros_prosilica.so": _CAMERA,
    "libgazebo_ros_thermal_camera.so": _CAMERA,
    "libgazebo_ros_thermal_depth_camera.so": _CAMERA,
    "libgazebo_ros_triggered_camera.so": _CAMERA._replace(reads="{cameraName}/{triggerTopicName=image_trigger}"),
    "libgazebo_ros_multicamera.so": _STEREO,
    "libgazebo_ros_triggered_multicamera.so": _STEREO,
    "libgazebo_ros_depth_camera.so": _KINECT,
    "libgazebo_ros_openni_kinect.so": _KINECT,
    "librealsense_gazebo_plugin.so": _REALSENSE,
    "libgazebo_ros_realsense.so": _REALSENSE,
    "libgazebo_ros_video.so": LeftOut(
        "shows pictures on a surface", "the surface is plain", "", "{topicName=image_raw}", _RENDERER),
    "libgazebo_ros_projector.so": LeftOut(
        "projects a picture", "none is seen", "", "{projectorTopicName} {textureTopicName}", _RENDERER),
    "libgazebo_video_recorder.so": LeftOut("records a video", "no file", instead="image_dump of m2wr_view draws a run"),
    "libROSLogicalCameraPlugin.so": LeftOut(
        "tells which models are in view", "no list of them", instead="/gazebo/model_states has all poses"),
    # -- position, contacts and the rest
    "libhector_gazebo_ros_imu.so": LeftOut(
        "measures rates and accelerations", "no imu data", "{topicName=imu}", "", _IMUS),
    "libhector_gazebo_ros_gps.so": LeftOut(
        "gives positions on the earth", "no fix", "{topicName=fix} {velocityTopicName=fix_velocity}", "", _TRUTH),
    "libhector_gazebo_ros_magnetic.so": LeftOut("measures the magnetic field", "no field", "{topicName=magnetic}"),
    "libhector_gazebo_reset_plugin.so": LeftOut("tells of resets", "nothing tells of them", "syscommand"),
    "libgazebo_ros_world_odometry.so": LeftOut(
        "gives the true pose", "no odometry", "{topicName=world_odom}", "", _TRUTH),
    "libgazebo_ros_f3d.so": LeftOut(
        "measures the force on a body", "no force", "{topicName}", "",
        "libgazebo_ros_ft_sensor.so is here, for joints"),
    "libgazebo_ros_contact.so": LeftOut(
        "tells what touches the body", "no contacts", "{topicName}", "", "libgazebo_ros_bumper.so is here"),
    "libgazebo_ros_power_monitor.so": LeftOut("gives the charge of a battery", "no charge", "{powerStateTopic}"),
    "libgazebo_ros_moveit_planning_scene.so": LeftOut("tells MoveIt of the shapes around", "it does not know them"),
    "libLinearBatteryPlugin.so": LeftOut("lets a battery run down", "no charge is simulated"),
    "libLiftDragPlugin.so": LeftOut("gives wings lift and drag", "nothing flies", instead=_FORCES),
    "libBuoyancyPlugin.so": LeftOut("lets bodies float", "they sink", instead=_FORCES),
    "libWindPlugin.so": LeftOut("blows", "there is no wind", instead=_FORCES),
    "libGravityCompensationPlugin.so": LeftOut(
        "holds links against gravity", "they sink", instead="<gravity> of a link switches it off"),
    "libInitialVelocityPlugin.so": LeftOut("sets the model in motion", "it begins at rest", instead=_PLACES),
    "libRandomVelocityPlugin.so": LeftOut("moves a link about at random", "it stands still", instead=_PLACES),
    "libFollowerPlugin.so": LeftOut("lets this model follow another", "it stands still", instead=_PLACES),
    "libActorPlugin.so": _ACTOR,
    "libgazebo_ros_actor.so": _ACTOR,
    "libgazebo_ros_actor_plugin.so": _ACTOR,
    "libPedestrianSFMPlugin.so": _ACTOR,
    "libActorCollisionsPlugin.so": LeftOut("gives an actor a shape to touch", "there is none", instead=_PLACES),
}

#: Plugins whose absence changes nothing here, and why.
NOT_NEEDED = {
    "libgazebo_ros_api_plugin.so": "this simulation has Gazebo's services and topics itself",
    "libgazebo_ros_paths_plugin.so": "packages that export model paths are searched anyway",
    "libgazebo_ros_init.so": "this simulation publishes /clock itself",
    "libgazebo_ros_factory.so": "this simulation has the services that spawn and delete itself",
    "libgazebo_ros_state.so": "this simulation has the services for states itself",
    "libRayPlugin.so": "it prints what its sensor measures and gives nothing to ROS",
    "libGpuRayPlugin.so": "it prints what its sensor measures and gives nothing to ROS",
    "libContactPlugin.so": "it prints what its sensor measures and gives nothing to ROS",
    "libCameraPlugin.so": "it gives nothing to ROS",
    "libDepthCameraPlugin.so": "it gives nothing to ROS",
    "libImuSensorPlugin.so": "it gives nothing to ROS",
    "libSimEventsPlugin.so": "it tells Gazebo's own programs of events and gives nothing to ROS",
    "libFlashLightPlugin.so": "light is not simulated",
    "libLedPlugin.so": "light is not simulated",
    "libAttachLightPlugin.so": "light is not simulated",
    "libLensFlareSensorPlugin.so": "light is not simulated",
    "libHeightmapLODPlugin.so": "it is for viewers",
    "libKeyboardGUIPlugin.so": "it is for viewers",
}
NOT_NEEDED.update({
    "lib%s-%s-system.so" % (family, system): "it is a part of Gazebo Sim that this simulation has built in"
    for family in ("gz-sim", "ignition-gazebo")
    for system in ("physics", "user-commands", "scene-broadcaster", "sensors", "imu", "contact")})


class AbsentPlugins:
    """Names plugins that are not here, each once: a second model of the same description is not told of again."""

    def __init__(self):
        self._named = set()

    def tell(self, owner, spec, namespace):
        """Log what follows from a plugin's absence: a warning where something is missing; see :func:`explain`."""
        key = hash((spec.filename, spec.name, spec.parameters, spec.reference))
        if key in self._named:
            return
        if len(self._named) >= _MOST_REMEMBERED:
            self._named.clear()
        self._named.add(key)
        text, missing = explain(spec, owner, namespace)
        log.log(logging.WARNING if missing else logging.INFO, "%s", text)


def explain(spec, owner, namespace=None):
    """Say what follows from a plugin that is not here.

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
        The sentences, and whether anything is missing.
    """
    library = library_name(spec.filename)
    if library in NOT_NEEDED:
        return "%s: no plugin %s here, and none is needed: %s." % (owner, library, NOT_NEEDED[library]), False
    known = LEFT_OUT.get(library)
    told = ["%s: no plugin %s here; %s is left out." % (owner, shorten(library), spec.where or spec.name)]
    if known is None:
        told.append("What it does is missing.")
        named = _topic_tags(spec)
        if named:
            told.append("Nothing here publishes or reads what its tags name: %s."
                        % ", ".join("%s (<%s>)" % (shorten(text), tag) for tag, text in named[:_MOST_TOPICS]))
    else:
        told.append("It %s: %s." % (_filled(known.does, spec, "?"), known.follows))
        scope = spec.find("robotNamespace") or namespace or (owner if known.by_model else "")
        for verb, topics in (("published", known.publishes), ("read", known.reads)):
            named = [_in_namespace(scope, topic) for topic in (_filled(word, spec) for word in topics.split()) if topic]
            if named:
                told.append("It would have %s %s." % (verb, " and ".join(named)))
        if known.instead:
            told.append("Instead: %s." % known.instead)
    return " ".join(told), True


def _filled(template, spec, missing=None):
    """Return the template with the texts of tags in it; None where one has neither text nor default."""
    found = {tag: shorten(spec.find(tag) or default) or missing for tag, default in _PLACE.findall(template)}
    found = {tag: "" if text is None and tag in _MAY_BE_EMPTY else text for tag, text in found.items()}
    if None in found.values():
        return None
    for tag in found:
        if not found[tag]:
            template = template.replace("{%s}/" % tag, "")
    return _PLACE.sub(lambda place: found[place.group(1)], template)


def _in_namespace(namespace, topic):
    """Return a topic's full name."""
    return re.sub("/+", "/", topic if topic.startswith("/") else "/%s/%s" % (namespace, topic))


def _topic_tags(spec):
    """Return the (tag, text) pairs of a plugin that name topics."""
    return [(tag, text) for tag, text in spec.parameters
            if text and re.search("topic(_?name)?$", tag.rpartition("/")[2], re.IGNORECASE)]
