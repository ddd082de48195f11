# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_camera.so and libgazebo_ros_triggered_camera.so: pictures as sensor_msgs/Image and CameraInfo."""
from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING, Any, List, Optional, Tuple

import numpy as np

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import compose
from m2wr_sim.messages import CameraInfo, EmptyMessage, Image, SetCameraInfo, SetCameraInfoResponse
from m2wr_sim.plugins.base import NEVER, LazySensor, PluginContext, PluginReader
from m2wr_sim.rendering.camera import Camera as Pinhole
from m2wr_sim.rendering.camera import warm_up
from m2wr_sim.rendering.lens import ENCODINGS, PictureNoise, distortion_of, encode
from m2wr_sim.runtime.schedule import GapSchedule, SensorSchedule

if TYPE_CHECKING:
    import numpy.typing as npt

    from m2wr_sim.model.types import CameraView

IDENTITY_MATRIX = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


class Eye:
    """One camera of a sensor: takes pictures and makes their messages.

    Parameters
    ----------
    spec : PluginReader
    ctx : PluginContext
    view : CameraView
    frame : str
        Frame of the messages.
    noise : str
        Name of the random numbers for its noise.
    baseline : float
        Distance [m] to the camera on the left, for the message.

    Raises
    ------
    PluginError
        If a size is outside of its limits.
    """

    def __init__(self, spec: PluginReader, ctx: PluginContext, view: CameraView, frame: str, noise: str,
                 baseline: float) -> None:
        self._ctx, self._noise_name = ctx, noise
        try:
            self.pinhole = Pinhole(view.width, view.height, view.field_of_view, view.near, view.far)
            self._noise = PictureNoise(view.noise, ctx.rng(noise))
            self._distortion = distortion_of(view.distortion, view.width, view.height, self.pinhole.focal,
                                             spec.flag("borderCrop", True))
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        self.encoding = ENCODINGS.get(view.encoding, "")
        if not self.encoding:
            self.encoding = "bgr8"
            spec.problems.append("Unsupported Gazebo ImageFormat \"%s\" (expected one of %s); using bgr8"
                                 % (view.encoding, ", ".join(ENCODINGS)))
        self.info = self._make_info(spec, view, baseline)
        self.info.header.frame_id = frame
        self._read_pose = ctx.physics.pose_reader([(ctx.sensor_link, compose(ctx.sensor.pose, view.pose))],
                                                  self.pinhole.pose)

    def _make_info(self, spec: PluginReader, view: CameraView, baseline: float) -> CameraInfo:
        computed, given = self.pinhole.focal, spec.number("focalLength", 0.0)
        if given and abs(given - computed) > 1e-3 * computed:
            spec.problems.append("<focalLength> is %g, but width and horizontal_fov give %g; messages hold the former"
                                 % (given, computed))
        focal = given or computed
        cx, cy = spec.number("Cx", 0.0) or 0.5 * (view.width + 1), spec.number("Cy", 0.0) or 0.5 * (view.height + 1)
        spec.ignore("CxPrime")
        lens = [spec.number(tag, 0.0) for tag in ("distortionK1", "distortionK2", "distortionT1", "distortionT2",
                                                  "distortionK3")]
        if spec.flag("autoDistortion", False):
            k1, k2, k3, p1, p2 = view.distortion[:5]
            lens = [k1, k2, p1, p2, k3]
        info = CameraInfo()
        info.width, info.height, info.distortion_model, info.D = view.width, view.height, "plumb_bob", lens
        info.K = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
        info.R = list(IDENTITY_MATRIX)
        info.P = [focal, 0.0, cx, -focal * baseline, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
        return info

    def take(self, colour: bool = True) -> npt.NDArray[np.uint8]:
        """Take a picture now; return its colours (height, width, 3) uint8, which the next one overwrites."""
        self._read_pose()
        self.pinhole.take(self._ctx.refresh_pictures(), colour)
        picture = self.pinhole.colour
        if colour:
            if self._distortion is not None:
                picture = self._distortion.apply(picture)
            self._noise.add(picture)
        return picture

    def image(self, stamp: Any, picture: npt.NDArray[np.uint8]) -> Image:
        """Return the message of a picture.

        Parameters
        ----------
        stamp : Time
        picture : (height, width, 3) uint8
            Red, green, blue.
        """
        message = Image()
        message.header.stamp, message.header.frame_id = stamp, self.info.header.frame_id
        message.height, message.width, message.encoding = self.info.height, self.info.width, self.encoding
        message.data, message.step = encode(picture, self.encoding)
        return message

    def info_at(self, stamp: Any) -> CameraInfo:
        """Return the CameraInfo for a picture."""
        info = copy.copy(self.info)
        info.header = copy.copy(self.info.header)
        info.header.stamp = stamp
        return info

    def set_info(self, request: Any) -> SetCameraInfoResponse:
        """Answer ``set_camera_info``: later messages hold this calibration; the pictures do not change."""
        given = request.camera_info
        numbers = [float(value) for values in (given.D, given.K, given.R, given.P) for value in values]
        if (given.width, given.height) != (self.info.width, self.info.height):
            return SetCameraInfoResponse(False, "the calibration is for %d x %d pixels; expected %d x %d" % (
                given.width, given.height, self.info.width, self.info.height))
        if len(given.D) > 100 or not all(map(math.isfinite, numbers)):
            return SetCameraInfoResponse(False, "a number is not finite, or D has over 100; expected a calibration")
        self.info.distortion_model, self.info.D, self.info.K = given.distortion_model, list(given.D), list(given.K)
        self.info.R, self.info.P = list(given.R), list(given.P)
        return SetCameraInfoResponse(True, "kept until the simulation ends")

    def restart(self) -> None:
        """Restart the noise."""
        self._noise.restart(self._ctx.rng(self._noise_name))


class CameraPlugin(LazySensor):
    """Base of all cameras: takes pictures at the rate of the sensor while one of their topics has subscribers."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or not ctx.sensor.cameras:
            raise PluginError("%s: a camera plugin must be in a <sensor type=\"camera\">, \"depth\" or \"multicamera\" "
                              "with a <camera> element" % spec.spec.where)
        self._ctx = ctx
        self._namespace = spec.spec.find("robotNamespace") or ""
        self._camera_name = spec.text("cameraName", "").strip("/")
        self._topics = "/".join(part for part in (self._namespace, self._camera_name) if part)
        self._frame = ctx.frame(spec.text("frameName", "/world"), self._namespace)
        self._sensed = SensorSchedule(ctx.sensor.update_rate)
        self._sent = GapSchedule(spec.number("updateRate", 0.0, minimum=0.0), ctx.now_ns)
        self._waking: List[Any] = []        # ports whose subscribers let it take pictures
        spec.ignore("imageTopicName", "cameraInfoTopicName", "triggerTopicName", "hackBaseline", "baseline",
                    "distortion", "always_on", "viewUpdateRate")
        self._set_up(spec)
        warm_up()

    def _set_up(self, spec: PluginReader) -> None:
        """Create the cameras and ports."""
        raise NotImplementedError

    def _open(self, topic: str, kind: type, folder: str = "", wakes: bool = True, latched: bool = False) -> Any:
        """Return a port in the camera's namespace."""
        port = self._ctx.advertise(topic, kind, 2, "/".join(part for part in (self._topics, folder) if part))
        if latched and hasattr(port, "latch"):
            port.latch()
        if wakes:
            self._waking.append(port)
        return port

    def wanted(self) -> bool:
        """Return whether one of the topics has subscribers."""
        return any(port.wanted() for port in self._waking)

    def wake(self, now_ns: int) -> None:
        self._sensed.restart()

    def next_reading(self, now_ns: int) -> int:
        step_ns = self._ctx.step_ns
        if not self._sensed.period_ns:
            return max(now_ns + step_ns, self._sent.next_due(now_ns, step_ns))
        return self._sensed.next_due(now_ns, step_ns)

    def after_step(self, now_ns: int) -> None:
        if self.awake and self._sensed.due(now_ns) and self._sent.due(now_ns):
            self._publish(self._ctx.moment(now_ns))

    def _publish(self, stamp: Any) -> None:
        """Take pictures and publish them."""
        raise NotImplementedError

    def _restart_noise(self) -> None:
        """Restart the noise of all cameras."""
        raise NotImplementedError

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._sent.restart(now_ns)
        if rewound:
            self._sensed.restart()
            self._restart_noise()


class Camera(CameraPlugin):
    """One camera."""

    _image_topic, _info_topic = "image_raw", "camera_info"

    def _set_up(self, spec: PluginReader) -> None:
        self._eye = Eye(spec, self._ctx, self._ctx.sensor.cameras[0], self._frame, "noise",
                        spec.number("hackBaseline", 0.0))
        self._image_port = self._open(spec.text("imageTopicName", self._image_topic), Image, latched=True)
        self._info_port = self._open(spec.text("cameraInfoTopicName", self._info_topic), CameraInfo)
        if self._camera_name:
            self._ctx.serve("set_camera_info", SetCameraInfo, self._eye.set_info, self._topics)

    def measure(self) -> Tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        """Take a picture now; return colours (height, width, 3) and depths (height, width) [m], to be overwritten."""
        return self._eye.take(), self._eye.pinhole.depth

    def _publish(self, stamp: Any) -> None:
        picture = self._eye.take()
        if self._image_port.wanted():
            self._image_port.publish(self._eye.image(stamp, picture))
        self._info_port.publish(self._eye.info_at(stamp))

    def _restart_noise(self) -> None:
        self._eye.restart()


class TriggeredCamera(Camera):
    """Takes one picture for each message on a topic."""

    def _set_up(self, spec: PluginReader) -> None:
        super()._set_up(spec)
        self._pending = 0
        self._ctx.subscribe(spec.text("triggerTopicName", "image_trigger"), EmptyMessage, self._trigger, self._topics)

    def _trigger(self, message: Any) -> None:
        self._pending = 1

    def next_after(self, now_ns: int) -> Optional[int]:
        return now_ns + self._ctx.step_ns if self._pending else NEVER

    def after_step(self, now_ns: int) -> None:
        if self._pending:
            self._pending = 0
            self._publish(self._ctx.moment(now_ns))
