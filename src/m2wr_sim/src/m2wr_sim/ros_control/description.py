# SPDX-License-Identifier: BSD-3-Clause
"""What ros_control reads from the text of a URDF: transmissions, limits of joints, geometry of wheels."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Callable, List, Optional, Tuple

from m2wr_sim.errors import PluginError
from m2wr_sim.model.xml.safe import XmlError, parse_xml
from m2wr_sim.ros_control.joint_limits import JointLimits

PREFIX = "hardware_interface/"


@dataclass(frozen=True)
class Transmission:
    """The joint of a transmission, and the hardware interface by which it is commanded."""

    name: str
    joint: str
    interface: str      # with the prefix ``hardware_interface/``


class RobotDescription:
    """The parts of a URDF that ros_control uses.

    Parameters
    ----------
    text : str
        A URDF document.
    where : str
        Name of the parameter that holds it, for messages.

    Raises
    ------
    PluginError
        If it is not a URDF.
    """

    def __init__(self, text: str, where: str) -> None:
        self.where = where
        try:
            self._root = parse_xml(text, where)
        except XmlError as error:
            raise PluginError(str(error)) from None
        if self._root.tag != "robot":
            raise PluginError("%s: read a document <%s>; expected a URDF, <robot>" % (where, self._root.tag))

    def transmissions(self, warn: Callable[..., None]) -> List[Transmission]:
        """Return the transmissions; each one that cannot be used is skipped with a message.

        Parameters
        ----------
        warn : callable
            ``warn(format, *values)``.
        """
        found = []
        for element in self._root.findall("transmission"):
            transmission = self._transmission(element, warn)
            if transmission is not None:
                found.append(transmission)
        return found

    def _transmission(self, element: Any, warn: Callable[..., None]) -> Optional[Transmission]:
        name, joints = element.get("name"), element.findall("joint")
        if not name:
            warn("%s: a transmission without a name is skipped; expected the attribute name", self.where)
            return None
        lacking = [word for word, missing in (
            ("type", not (element.findtext("type") or element.get("type") or "").strip()),
            ("joint", not joints or not joints[0].get("name")),
            ("actuator", not element.findall("actuator") or not element.find("actuator").get("name"))) if missing]
        if lacking:
            warn("No %s element found in transmission '%s'; it is skipped.", lacking[0], name)
            return None
        if len(joints) > 1:
            warn("Transmission %s has more than one joint. Only %s is used.", name, joints[0].get("name"))
        joint = joints[0].get("name")
        interfaces = [(entry.text or "").strip() for entry in joints[0].findall("hardwareInterface")]
        interfaces = [text for text in interfaces if text]
        if not interfaces:
            warn("No valid hardware interface element found in joint '%s'; transmission '%s' is skipped. Expected "
                 "<hardwareInterface> in <joint>, not in <actuator>.", joint, name)
            return None
        if len(interfaces) > 1:
            warn("Transmission %s has more than one hardware interface. Using the first entry, %s.", name,
                 interfaces[0])
        interface = interfaces[0]
        if "/" not in interface:
            warn("Deprecated syntax, please prepend '%s' to '%s' within the <hardwareInterface> tag in joint '%s'.",
                 PREFIX, interface, joint)
            interface = PREFIX + interface
        return Transmission(name, joint, interface)

    def joint_type(self, joint: str) -> Optional[str]:
        """Return the type of a joint, or None if there is no such joint."""
        element = self._joint(joint)
        return None if element is None else element.get("type")

    def limits(self, joint: str) -> JointLimits:
        """Return the limits of a joint; those of the position only for revolute and prismatic joints.

        Parameters
        ----------
        joint : str

        Raises
        ------
        PluginError
            If a limit is no number.
        """
        element = self._joint(joint)
        limit, safety = (None, None) if element is None else (element.find("limit"), element.find("safety_controller"))
        if limit is None:
            return JointLimits()
        bounded = element.get("type") in ("revolute", "prismatic")
        velocity, effort = self._number(limit, "velocity", joint), self._number(limit, "effort", joint)
        lower, upper = (self._number(limit, name, joint) or 0.0 for name in ("lower", "upper"))
        if lower > upper:
            raise PluginError("%s: joint %s has a lower limit of %g above the upper one of %g; expected the opposite"
                              % (self.where, joint, lower, upper))
        limits = JointLimits(position=(lower, upper) if bounded else None, velocity=velocity, effort=effort)
        if safety is None:
            return limits
        soft = tuple(self._number(safety, name, joint) or 0.0 for name in ("soft_lower_limit", "soft_upper_limit"))
        gains = [self._number(safety, name, joint) or 0.0 for name in ("k_position", "k_velocity")]
        return JointLimits(limits.position, velocity, None, effort, (soft[0], soft[1]) if bounded else None, *gains)

    def effort_limit(self, joint: str) -> Optional[float]:
        """Return the effort limit of a joint [N m or N], or None without ``<limit effort>``."""
        element = self._joint(joint)
        limit = None if element is None else element.find("limit")
        return None if limit is None else self._number(limit, "effort", joint)

    def origin(self, joint: str) -> Tuple[float, float, float]:
        """Return the origin of a joint in the frame of its parent link [m].

        Parameters
        ----------
        joint : str

        Raises
        ------
        PluginError
            If there is no such joint, or its origin is not three numbers.
        """
        element = self._joint(joint)
        if element is None:
            raise PluginError("%s: there is no joint %s (it has %s)" % (self.where, joint, ", ".join(sorted(
                entry.get("name", "") for entry in self._root.findall("joint")))))
        origin = element.find("origin")
        words = "0 0 0".split() if origin is None else (origin.get("xyz") or "0 0 0").split()
        try:
            x, y, z = (float(word) for word in words)
        except ValueError:
            raise PluginError("%s: the origin of joint %s is %s; expected three numbers"
                              % (self.where, joint, " ".join(words))) from None
        return x, y, z

    def place(self, joint: str, base: str) -> Tuple[float, float, float]:
        """Return the sum of the origins of a joint and those above it, up to a link [m]; as ros_control, unrotated.

        Parameters
        ----------
        joint, base : str

        Raises
        ------
        PluginError
            If there is no such joint, or the link is not above it.
        """
        x, y, z = self.origin(joint)
        above, seen = joint, {joint}
        while True:
            parent = self._joint(above).find("parent")
            link = "" if parent is None else parent.get("link", "")
            if link == base:
                return x, y, z
            above = next((entry.get("name", "") for entry in self._root.findall("joint")
                          if entry.find("child") is not None and entry.find("child").get("link") == link), "")
            if not above or above in seen:
                raise PluginError("%s: joint %s is not below the link %s; expected the parameter base_frame_id to "
                                  "name a link above it" % (self.where, joint, base))
            seen.add(above)
            x, y, z = (a + b for a, b in zip((x, y, z), self.origin(above)))

    def wheel_separation(self, left: str, right: str) -> float:
        """Return the distance of the origins of two joints [m]; as in ros_control their parents are ignored.

        Parameters
        ----------
        left : float
            Rate of the left wheels [rad/s].
        right : float
            Rate of the right wheels [rad/s].
        """
        return math.dist(self.origin(left), self.origin(right))

    def wheel_radius(self, joint: str) -> float:
        """Return the radius of the wheel that a joint carries [m].

        Parameters
        ----------
        joint : str

        Raises
        ------
        PluginError
            If the first collision of its child link is neither a cylinder nor a sphere.
        """
        self.origin(joint)
        child = self._joint(joint).find("child")
        name = "" if child is None else child.get("link", "")
        shapes = [shape for link in self._root.findall("link") if link.get("name") == name
                  for tag in ("cylinder", "sphere") for shape in link.findall("collision/geometry/" + tag)]
        radius = self._number(shapes[0], "radius", joint) if shapes else None
        if radius is None or not radius > 0.0:
            raise PluginError("Wheel link %s is NOT modeled as a cylinder or sphere! Expected such a <collision>, or "
                              "the parameter wheel_radius" % name)
        return radius

    def _joint(self, name: str) -> Any:
        return next((joint for joint in self._root.findall("joint") if joint.get("name") == name), None)

    def _number(self, element: Any, attribute: str, joint: str) -> Optional[float]:
        text = element.get(attribute)
        if text is None:
            return None
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if math.isnan(value):
            raise PluginError("%s: <%s %s=\"%s\"> of joint %s; expected a number"
                              % (self.where, element.tag, attribute, text, joint))
        return value
