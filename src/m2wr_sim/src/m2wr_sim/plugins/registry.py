# SPDX-License-Identifier: BSD-3-Clause
"""Table of the supported plugin libraries and their classes."""
from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Optional, Type

if TYPE_CHECKING:
    from m2wr_sim.plugins.base import Plugin

PLUGINS = {
    "libgazebo_ros_diff_drive.so": "m2wr_sim.plugins.diff_drive:DiffDrive",
    "libgazebo_ros_laser.so": "m2wr_sim.plugins.laser:Laser",
    "libgazebo_ros_gpu_laser.so": "m2wr_sim.plugins.laser:Laser",
    "libgazebo_ros_joint_state_publisher.so": "m2wr_sim.plugins.joint_state:JointStatePublisher",
    "libgazebo_ros_skid_steer_drive.so": "m2wr_sim.plugins.skid_steer:SkidSteer",
    "libgazebo_ros_tricycle_drive.so": "m2wr_sim.plugins.tricycle:Tricycle",
    "libgazebo_ros_kobuki.so": "m2wr_sim.plugins.kobuki:Kobuki",
    "libgazebo_ros_planar_move.so": "m2wr_sim.plugins.planar_move:PlanarMove",
    "libgazebo_ros_p3d.so": "m2wr_sim.plugins.p3d:GroundTruth",
    "libgazebo_ros_imu.so": "m2wr_sim.plugins.imu:BodyImu",
    "libgazebo_ros_imu_sensor.so": "m2wr_sim.plugins.imu_sensor:SensorImu",
    "libgazebo_ros_range.so": "m2wr_sim.plugins.range:RangeFinder",
    "libgazebo_ros_bumper.so": "m2wr_sim.plugins.bumper:Bumper",
    "libgazebo_ros_force.so": "m2wr_sim.plugins.force:Force",
    "libgazebo_ros_ft_sensor.so": "m2wr_sim.plugins.ft_sensor:JointWrench",
    "libgazebo_ros_wheel_slip.so": "m2wr_sim.plugins.wheel_slip:WheelSlip",
    "libWheelSlipPlugin.so": "m2wr_sim.plugins.wheel_slip:WheelSlip",
    "libgazebo_ros_harness.so": "m2wr_sim.plugins.harness:Harness",
    "libHarnessPlugin.so": "m2wr_sim.plugins.harness:Harness",
    "libgazebo_ros_control.so": "m2wr_sim.plugins.ros_control:RosControl",
    "libm2wr_mimic.so": "m2wr_sim.plugins.mimic:MimicJoint",
    "libm2wr_gear.so": "m2wr_sim.plugins.coupling:Gear",
    "libm2wr_screw.so": "m2wr_sim.plugins.coupling:Screw",
    "libroboticsgroup_gazebo_mimic_joint_plugin.so": "m2wr_sim.plugins.mimic:MimicJoint",
    "libroboticsgroup_upatras_gazebo_mimic_joint_plugin.so": "m2wr_sim.plugins.mimic:MimicJoint",
    "libmimic_joint_plugin.so": "m2wr_sim.plugins.mimic:MimicJoint",
    "libgazebo_mimic_joint_plugin.so": "m2wr_sim.plugins.mimic:MimicJoint",
    "libgazebo_ros_camera.so": "m2wr_sim.plugins.camera:Camera",
    "libgazebo_ros_triggered_camera.so": "m2wr_sim.plugins.camera:TriggeredCamera",
    "libgazebo_ros_depth_camera.so": "m2wr_sim.plugins.depth_camera:DepthCamera",
    "libgazebo_ros_openni_kinect.so": "m2wr_sim.plugins.depth_camera:OpenniKinect",
    "libgazebo_ros_multicamera.so": "m2wr_sim.plugins.multicamera:Multicamera",
    "libgazebo_ros_velodyne_laser.so": "m2wr_sim.plugins.cloud_laser:Velodyne",
    "libgazebo_ros_velodyne_gpu_laser.so": "m2wr_sim.plugins.cloud_laser:Velodyne",
    "libgazebo_ros_block_laser.so": "m2wr_sim.plugins.cloud_laser:BlockLaser",
    "libhector_gazebo_ros_imu.so": "m2wr_sim.plugins.hector_imu:HectorImu",
    "libhector_gazebo_ros_gps.so": "m2wr_sim.plugins.hector_gps:HectorGps",
    "libhector_gazebo_ros_magnetic.so": "m2wr_sim.plugins.hector_magnetic:HectorMagnetic",
    "libhector_gazebo_ros_sonar.so": "m2wr_sim.plugins.hector_sonar:HectorSonar",
    "libm2wr_way_points.so": "m2wr_sim.plugins.way_points:WayPoints",
    "libTrajectoryActorPlugin.so": "m2wr_sim.plugins.way_points:TrajectoryActor",
    "libm2wr_actor_script.so": "m2wr_sim.plugins.way_points:ActorMotion",
}


def find_plugin(filename: str) -> Optional[Type[Plugin]]:
    """Return the plugin class for a library's file name (``lib`` and ``.so`` may be missing), or None."""
    target = PLUGINS.get(library_name(filename))
    if target is None:
        return None
    module, _, attribute = target.partition(":")
    return getattr(importlib.import_module(module), attribute)


def library_name(filename: str) -> str:
    """Return a library's name with ``lib`` and ``.so``, without its folder."""
    name = filename.strip().rsplit("/", 1)[-1]
    if not name.endswith(".so"):
        name += ".so"
    if not name.startswith("lib"):
        name = "lib" + name
    return name
