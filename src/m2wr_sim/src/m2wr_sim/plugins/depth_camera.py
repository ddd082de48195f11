# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_openni_kinect.so, libgazebo_ros_depth_camera.so: picture, depth image and point cloud of one camera."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from m2wr_sim.messages import CameraInfo, Image, PointCloud2, PointField
from m2wr_sim.plugins.camera import Camera, PluginReader
from m2wr_sim.rendering import output_kernels as kernels

if TYPE_CHECKING:
    import numpy.typing as npt

_BELOW = 1.0 - 1e-6             # share of the far limit: there is nothing beyond
_POINT_BYTES = 4 * kernels.POINT_STEP


class DepthCamera(Camera):
    """A depth camera; depth is the distance along the optical axis.  The point cloud is in optical axes."""

    _image_topic, _info_topic = "ir/image_raw", "ir/camera_info"
    _longest = math.inf             # default of <pointCloudCutoffMax> [m]

    def _set_up(self, spec: PluginReader) -> None:
        super()._set_up(spec)
        self._least = spec.number("pointCloudCutoff", 0.4, minimum=0.0)
        far = self._eye.pinhole.far * _BELOW
        self._most = min(spec.number("pointCloudCutoffMax", min(self._longest, far)), far)
        if not self._least < self._most:
            spec.problems.append("<pointCloudCutoff> %g m is not below the farthest depth %g m; no depth is valid"
                                 % (self._least, self._most))
        self._in_millimetres = spec.flag("useDepth16UC1Format", False)
        spec.ignore("normalsTopicName", "reduceNormals", "depthImageInfoTopicName")
        self._depth_port = self._open(spec.text("depthImageTopicName", "depth/image_raw"), Image, latched=True)
        self._depth_info_port = self._open(spec.text("depthImageCameraInfoTopicName", "depth/camera_info"), CameraInfo,
                                           wakes=False)
        self._cloud_port = self._open(spec.text("pointCloudTopicName", "points"), PointCloud2)

    def _publish(self, stamp: Any) -> None:
        eye = self._eye
        image, cloud = self._image_port.wanted(), self._cloud_port.wanted()
        picture = eye.take(image or cloud)
        if image:
            self._image_port.publish(eye.image(stamp, picture))
        if self._info_port.wanted():
            self._info_port.publish(eye.info_at(stamp))
        if self._depth_port.wanted():
            self._depth_port.publish(self._depth_image(stamp))
        if self._depth_info_port.wanted():
            self._depth_info_port.publish(eye.info_at(stamp))
        if cloud:
            self._cloud_port.publish(self._cloud(stamp, picture))

    def _depth_image(self, stamp: Any) -> Image:
        eye, depth = self._eye, self._eye.pinhole.depth.reshape(-1)
        message = Image()
        message.header.stamp, message.header.frame_id = stamp, eye.info.header.frame_id
        message.height, message.width = eye.info.height, eye.info.width
        if self._in_millimetres:
            whole = np.empty(depth.size, np.uint16)
            kernels.millimetres(whole, depth, self._least, self._most)
            message.encoding, message.step, message.data = "16UC1", 2 * eye.info.width, whole.view(np.uint8)
        else:
            values = np.empty(depth.size, np.float32)
            kernels.metres(values, depth, self._least, self._most)
            message.encoding, message.step, message.data = "32FC1", 4 * eye.info.width, values.view(np.uint8)
        return message

    def _cloud(self, stamp: Any, picture: npt.NDArray[np.uint8]) -> PointCloud2:
        eye = self._eye
        height, width = eye.info.height, eye.info.width
        points = np.empty((height, width, kernels.POINT_STEP), np.float32)
        invalid = kernels.cloud(points, eye.pinhole.depth, picture, eye.pinhole.focal, self._least, self._most)
        message = PointCloud2()
        message.header.stamp, message.header.frame_id = stamp, eye.info.header.frame_id
        message.height, message.width, message.is_dense = height, width, invalid == 0
        message.fields = [PointField(name, offset, PointField.FLOAT32, 1)
                          for name, offset in (("x", 0), ("y", 4), ("z", 8), ("rgb", 16))]
        message.point_step, message.row_step = _POINT_BYTES, _POINT_BYTES * width
        message.data = points.reshape(-1).view(np.uint8)
        return message


class OpenniKinect(DepthCamera):
    """The same with another default of the longest depth in point clouds."""

    _longest = 5.0
