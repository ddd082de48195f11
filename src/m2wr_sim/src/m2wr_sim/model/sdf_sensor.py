"""``<sensor>`` elements -> Sensor, the same for SDF files and for URDF ``<gazebo>`` blocks."""
from m2wr_sim.geometry import IDENTITY
from m2wr_sim.model.plugin_spec import read_plugin
from m2wr_sim.model.safe_xml import (child_bool, child_float, child_int, child_text, fail, line_of, parse_pose,
                                     required_name)
from m2wr_sim.model.types import Noise, RayScan, Sensor

RAY_KINDS = ("ray", "gpu_ray")
NOISE_KINDS = ("none", "custom", "gaussian", "gaussian_quantized")

_SENSOR_READ = frozenset(("pose", "update_rate", "always_on", "visualize", "plugin", "ray", "imu", "contact"))
_SENSOR_SILENT = frozenset(("topic", "camera", "depth", "gps", "sonar", "force_torque", "altimeter",
                            "magnetometer", "rfid", "rfidtag", "transceiver", "logical_camera"))
_RAY_READ = frozenset(("scan", "range", "noise"))
_NOISE_READ = frozenset(("type", "mean", "stddev", "bias_mean", "bias_stddev", "precision"))


def read_noise(element, notes):
    """Read ``<noise>``; None (no element) gives no noise, an element without type is gaussian, as in SDF.

    An unknown type is noted and gives no noise.
    """
    if element is None:
        return Noise()
    kind = element.get("type") or child_text(element, "type") or "gaussian"
    if kind not in NOISE_KINDS:
        notes.add('{}: noise type "{}" is unknown (expected one of {}); no noise is applied.'.format(
            line_of(element), kind, ", ".join(NOISE_KINDS)))
        return Noise()
    notes.unread(element, _NOISE_READ)
    return Noise(kind=kind, mean=child_float(element, "mean", 0.0), stddev=_not_negative(element, "stddev"),
                 bias_mean=child_float(element, "bias_mean", 0.0), bias_stddev=_not_negative(element, "bias_stddev"),
                 precision=child_float(element, "precision", 0.0))


def _not_negative(parent, tag):
    value = child_float(parent, tag, 0.0)
    if value < 0.0:
        fail(parent.find(tag), "{} is {}".format(tag, value), "zero or a positive number")
    return value


def read_ray(element, notes):
    """Read ``<ray>`` (None: all defaults) into a RayScan.

    Raises
    ------
    XmlError
        If a number is not finite, a sample count is below one, or a range or resolution is negative.
    """
    defaults = RayScan()
    if element is None:
        return defaults
    notes.unread(element, _RAY_READ)
    horizontal, vertical, limits = element.find("scan/horizontal"), element.find("scan/vertical"), element.find("range")
    for axis in (horizontal, vertical):
        if axis is not None and child_float(axis, "resolution", 1.0) <= 0.0:
            fail(axis.find("resolution"), "resolution is not positive", "a positive number, usually 1")
    return RayScan(
        samples=child_int(horizontal, "samples", defaults.samples, 1),
        resolution=child_float(horizontal, "resolution", defaults.resolution),
        min_angle=child_float(horizontal, "min_angle", defaults.min_angle),
        max_angle=child_float(horizontal, "max_angle", defaults.max_angle),
        vertical_samples=child_int(vertical, "samples", defaults.vertical_samples, 1),
        vertical_resolution=child_float(vertical, "resolution", defaults.vertical_resolution),
        vertical_min_angle=child_float(vertical, "min_angle", defaults.vertical_min_angle),
        vertical_max_angle=child_float(vertical, "max_angle", defaults.vertical_max_angle),
        range_min=_not_negative(limits, "min"), range_max=_not_negative(limits, "max"),
        range_resolution=child_float(limits, "resolution", 0.0), noise=read_noise(element.find("noise"), notes))


def read_imu(element, notes):
    """Read ``<imu>`` (None: no noise) into the noise of angular velocity x y z and linear acceleration x y z.

    SDF 1.5 has one ``<noise>`` an axis, earlier versions one for the rates and one for the accelerations.
    """
    if element is None:
        return ()
    early = element.find("noise")
    if early is not None:
        kind = child_text(early, "type") or "gaussian"
        return tuple(noise for tag in ("rate", "accel") for noise in 3 * [_early_noise(early.find(tag), kind)])
    return tuple(read_noise(element.find("%s/%s/noise" % (quantity, axis)), notes)
                 for quantity in ("angular_velocity", "linear_acceleration") for axis in "xyz")


def _early_noise(element, kind):
    if element is None or kind not in NOISE_KINDS:
        return Noise()
    return Noise(kind=kind, mean=child_float(element, "mean", 0.0), stddev=_not_negative(element, "stddev"),
                 bias_mean=child_float(element, "bias_mean", 0.0), bias_stddev=_not_negative(element, "bias_stddev"))


def read_sensor(element, link_name, notes, resolve_pose=None):
    """Read one ``<sensor>`` of a link.

    Parameters
    ----------
    element : lxml element
        The sensor; ``name`` and ``type`` are required.
    link_name : str
        The link that carries it, kept in its plugins' ``reference``.
    notes : Notes
        Receives what is not read.
    resolve_pose : callable or None
        ``resolve_pose(element) -> pose`` in the link frame, where poses may be relative to other frames.

    Returns
    -------
    Sensor
        ``ray`` is filled for ray and gpu_ray only, ``imu_noise`` for imu, ``contact_collisions`` for contact; other
        kinds keep name, rate, pose and plugins.
    """
    name, kind = required_name(element), (element.get("type") or "").strip()
    if not kind:
        fail(element, "attribute type is missing or empty", "a sensor type, e.g. ray")
    notes.unread(element, _SENSOR_READ, _SENSOR_SILENT)
    pose_element = element.find("pose")
    if resolve_pose is not None:
        pose = resolve_pose(element)
    else:
        pose = IDENTITY if pose_element is None else parse_pose(pose_element, pose_element.text or "")
    ray = read_ray(element.find("ray"), notes) if kind in RAY_KINDS else None
    imu = read_imu(element.find("imu"), notes) if kind == "imu" else ()
    contact = tuple((child.text or "").strip() for child in element.findall("contact/collision"))
    return Sensor(name=name, kind=kind, pose=pose, update_rate=_not_negative(element, "update_rate"),
                  always_on=child_bool(element, "always_on", False), visualize=child_bool(element, "visualize", False),
                  ray=ray, imu_noise=imu, contact_collisions=contact if kind == "contact" else (),
                  plugins=tuple(read_plugin(child, link_name) for child in element.findall("plugin")))
