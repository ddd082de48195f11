# SPDX-License-Identifier: BSD-3-Clause
"""``<sensor>`` elements -> Sensor, the same for SDF files and for URDF ``<gazebo>`` blocks."""
from __future__ import annotations

from typing import TYPE_CHECKING, Callable, Optional, Tuple

from m2wr_sim.model.plugin_spec import read_plugin
from m2wr_sim.model.sdf.frames import raw_pose
from m2wr_sim.model.types import CameraView, Noise, RayScan, Sensor

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.sdf.node import Node
    from m2wr_sim.model.types import PluginSpec

RAY_KINDS = ("ray", "gpu_ray")
NOISE_KINDS = ("none", "custom", "gaussian", "gaussian_quantized")
MOST_RAYS = 1000000         # rays of one sensor, and readings; 16 MB a scan
#: Sensors of SDF that plugins here read.
READ_KINDS = RAY_KINDS + ("imu", "contact", "camera", "depth", "multicamera")
CAMERA_KINDS = ("camera", "depth", "multicamera")
#: Sensors of SDF that are not simulated; their elements are ignored.
OTHER_KINDS = ("depth_camera", "rgbd_camera", "wideanglecamera", "thermal_camera",
               "altimeter", "air_pressure", "force_torque", "gps", "navsat", "logical_camera", "magnetometer", "rfid",
               "rfidtag", "sonar", "wireless_receiver", "wireless_transmitter", "lidar", "gpu_lidar", "custom", "none")


def read_noise(node: Node, dynamic_bias: bool = False) -> Noise:
    """Read ``<noise>``; a missing one gives no noise, an element without type is gaussian, as in SDF.

    An unknown type gives a warning and no noise.

    Parameters
    ----------
    node : Node
    dynamic_bias : bool
        Whether the sensor has a bias that changes.

    Returns
    -------
    Noise
    """
    if not node:
        return Noise()
    kind = node.attribute("type") or node.text("type") or "gaussian"
    node.text("type")
    if kind not in NOISE_KINDS:
        node.ignore()
        node.notes.add('{}: noise type "{}" is unknown (expected one of {}); no noise is applied.'.format(
            node.line, kind, ", ".join(NOISE_KINDS)))
        return Noise()
    bias = node.number("dynamic_bias_stddev", 0.0, 0.0), node.number("dynamic_bias_correlation_time", 0.0, 0.0)
    if bias[0] > 0.0 and not (dynamic_bias and bias[1] > 0.0):
        node.notes.add("{}: <dynamic_bias_stddev> in <noise> ignored; {}.".format(
            node.line, "it needs a <dynamic_bias_correlation_time> above 0" if dynamic_bias else
            "only IMU sensors have a dynamic bias"), ("unread", "noise", "dynamic_bias_stddev", dynamic_bias))
        bias = (0.0, 0.0)
    return Noise(kind, node.number("mean", 0.0), node.number("stddev", 0.0, 0.0), node.number("bias_mean", 0.0),
                 node.number("bias_stddev", 0.0, 0.0), node.number("precision", 0.0, 0.0), *bias)


def _fan(node: Node, default: Tuple[int, float, float, float]) -> Tuple[int, float, float, float]:
    """Return samples, resolution, least and greatest angle of ``<horizontal>`` or ``<vertical>``."""
    samples, resolution, low, high = default
    return (node.whole("samples", samples, 1), node.positive("resolution", resolution),
            node.number("min_angle", low), node.number("max_angle", high))


def read_ray(node: Node) -> RayScan:
    """Read ``<ray>``; a missing one gives the defaults."""
    base, scan, limits = RayScan(), node.child("scan"), node.child("range")
    across = _fan(scan.child("horizontal"), (base.samples, base.resolution, base.min_angle, base.max_angle))
    upwards = _fan(scan.child("vertical"), (base.vertical_samples, base.vertical_resolution, base.vertical_min_angle,
                                            base.vertical_max_angle))
    readings = across[0] * max(across[1], 1.0) * upwards[0] * max(upwards[1], 1.0)
    if readings > MOST_RAYS:
        node.notes.add("{}: {} x {} samples, resolution {:g} x {:g}; expected at most {} readings; one row of {} is "
                       "taken.".format(node.place, across[0], upwards[0], across[1], upwards[1], MOST_RAYS,
                                       base.samples))
        across, upwards = (base.samples, 1.0) + across[2:], (1, 1.0) + upwards[2:]
    return RayScan(across[0], across[1], across[2], across[3], upwards[0], upwards[1], upwards[2], upwards[3],
                   range_min=limits.number("min", 0.0, 0.0),
                   range_max=limits.number("max", 0.0, 0.0), range_resolution=limits.number("resolution", 0.0),
                   noise=read_noise(node.child("noise")))


def read_imu(node: Node) -> Tuple[Noise, ...]:
    """Return the noise of ``<imu>``: of angular velocity x y z and linear acceleration x y z; empty if it is missing.

    SDF 1.5 has one ``<noise>`` for each axis, earlier versions one for the rates and one for the accelerations.
    """
    if not node:
        return ()
    early = node.child("noise")
    if early:
        kind = early.text("type") or "gaussian"
        return tuple(noise for tag in ("rate", "accel") for noise in 3 * [_early_noise(early.child(tag), kind)])
    return tuple(read_noise(node.child(quantity).child(axis).child("noise"), True)
                 for quantity in ("angular_velocity", "linear_acceleration") for axis in "xyz")


def _early_noise(node: Node, kind: str) -> Noise:
    if not node or kind not in NOISE_KINDS:
        return Noise()
    return Noise(kind=kind, mean=node.number("mean", 0.0), stddev=node.number("stddev", 0.0, 0.0),
                 bias_mean=node.number("bias_mean", 0.0), bias_stddev=node.number("bias_stddev", 0.0, 0.0))


def read_camera(node: Node) -> CameraView:
    """Read ``<camera>``; sizes are checked by the camera, which knows its limits."""
    base, image, clip, lens = CameraView(), node.child("image"), node.child("clip"), node.child("distortion")
    centre = lens.vector("center", 2, base.distortion[5:]) if lens else base.distortion[5:]
    return CameraView(
        node.attribute("name"), raw_pose(node)[0], image.whole("width", base.width), image.whole("height", base.height),
        image.text("format") or base.encoding, node.number("horizontal_fov", base.field_of_view),
        clip.number("near", base.near), clip.number("far", base.far), read_noise(node.child("noise")),
        (lens.number("k1", 0.0), lens.number("k2", 0.0), lens.number("k3", 0.0), lens.number("p1", 0.0),
         lens.number("p2", 0.0), centre[0], centre[1]))


def read_sensor(node: Node, link_name: str, resolve_pose: Optional[Callable[[Node], Pose]] = None) -> Sensor:
    """Read one ``<sensor>`` of a link.

    Parameters
    ----------
    node : Node
        The sensor; ``name`` and ``type`` are required.
    link_name : str
        The link that carries it; its plugins get it as ``reference``.
    resolve_pose : callable or None
        ``resolve_pose(node) -> pose`` in the link frame, if poses may be relative to other frames.

    Returns
    -------
    Sensor
        ``ray`` is set only for ray and gpu_ray, ``imu_noise`` for imu, ``contact_collisions`` for contact, ``cameras``
        for camera, depth and multicamera; other kinds have name, rate, pose and plugins.

    Raises
    ------
    XmlError
        If name or type are missing.
    """
    name, kind = node.name(), node.attribute("type")
    if not kind:
        node.fail("attribute type is missing or empty", "a sensor type, e.g. ray")
    parts = {"ray": node.child("ray"), "imu": node.child("imu"), "contact": node.child("contact")}
    ray = read_ray(parts["ray"]) if kind in RAY_KINDS else None
    imu = read_imu(parts["imu"]) if kind == "imu" else ()
    cameras = tuple(map(read_camera, node.children("camera") or [node.child("camera")])) if kind in CAMERA_KINDS else ()
    contact = tuple(child.own_text() for child in parts["contact"].children("collision"))
    for part, kinds in (("ray", RAY_KINDS), ("imu", ("imu",)), ("contact", ("contact",))):
        if parts[part] and kind not in kinds:
            parts[part].ignore()
            node.notes.add('{}: unsupported element <{}> in a sensor of type {} ignored.'.format(
                parts[part].line, part, kind), ("unread", kind, part))
    plugins = tuple(plugin for plugin in (
        node.notes.attempt("this plugin", read_plugin, child.element, link_name, node.notes)
        for child in node.children("plugin")) if plugin is not None)
    for child in node.children("plugin"):
        child.ignore()
    _tell_idle(node, name, kind, plugins)
    sensor = Sensor(name=name, kind=kind, pose=raw_pose(node)[0] if resolve_pose is None else resolve_pose(node),
                    update_rate=node.number("update_rate", 0.0, 0.0), always_on=node.flag("always_on", False),
                    visualize=node.flag("visualize", False), ray=ray, imu_noise=imu,
                    contact_collisions=contact if kind == "contact" else (), cameras=cameras, plugins=plugins)
    node.done()
    return sensor


def _tell_idle(node: Node, name: str, kind: str, plugins: Tuple[PluginSpec, ...]) -> None:
    """Report a sensor without measurements: its type is unknown, or it has no plugin."""
    if kind not in READ_KINDS + OTHER_KINDS:
        node.notes.add('{}: sensor "{}" is of the unknown type "{}" (expected one of {}); it measures nothing by '
                       'itself.'.format(node.line, name, kind, ", ".join(READ_KINDS)))
    elif kind in OTHER_KINDS and not plugins:
        node.notes.add('{}: sensor "{}" of type {} is not simulated.'.format(node.line, name, kind),
                       ("sensor", kind))
