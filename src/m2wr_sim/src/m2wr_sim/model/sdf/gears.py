# SPDX-License-Identifier: BSD-3-Clause
"""``<joint type="gearbox">`` of SDF: a plugin that lets two wheels mesh, because the solver has no joint for it."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence, Tuple

from m2wr_sim.geometry import compose, rotate
from m2wr_sim.model.sdf.joint import named_end, unit
from m2wr_sim.model.types import PluginSpec

if TYPE_CHECKING:
    from m2wr_sim.model.sdf.frames import Frames
    from m2wr_sim.model.sdf.node import Node
    from m2wr_sim.model.types import Joint, Link

_GEAR_LIBRARY = "libm2wr_gear.so"


def read_gear(node: Node, links: Sequence[Link], joints: Sequence[Joint], frames: Frames,
              model: str) -> PluginSpec:
    """Read a ``<joint type="gearbox">``.

    Parameters
    ----------
    node : Node
    links, joints : sequences of Link and Joint
        Of the model.
    frames : Frames
    model : str
        Name of the model; link names may begin with it.

    Returns
    -------
    PluginSpec

    Raises
    ------
    XmlError
        If a link is missing or not joined to the reference body by a revolute joint, or ODE cannot carry such gears.
    """
    poses = {link.name: link.pose for link in links}
    wheels = [named_end(node, tag, model, poses.__contains__) for tag in ("parent", "child")]
    reference = node.text("gearbox_reference_body") or ""
    reference = reference[len(model) + 2:] if reference.startswith(model + "::") else reference
    ratio = node.number("gearbox_ratio", 1.0)
    for end in wheels + [reference]:
        if end not in poses:
            node.fail('gearbox names "{}"'.format(end), "a parent, a child and a <gearbox_reference_body>: links of "
                      "the model, which has " + ", ".join(sorted(poses)))
    found = [_bearing(node, joints, wheel, reference) for wheel in wheels]
    axes, anchors, signs = [], [], []
    pose = compose(poses[wheels[1]], frames.pose_in(node, wheels[1]))
    for joint, tag in zip(found, ("axis", "axis2")):
        position, orientation = compose(poses[joint.child], joint.pose)
        axis, child = rotate(orientation, joint.axis.xyz), node.child(tag)
        wanted = axis if not child else rotate(pose[1], unit(child.element, child.vector("xyz", 3, (0.0, 0.0, 1.0))))
        child.ignore()
        axes.append(axis)
        anchors.append(position)
        signs.append(_along((axis, wanted)))
    turning = ratio * signs[0] * signs[1]       # about the axes of the two joints
    _check_geometry(node, axes, anchors, turning * _along(axes))
    node.done()
    return PluginSpec("gear_" + node.name(), _GEAR_LIBRARY, (
        ("joint", found[0].name), ("driven", found[1].name), ("parent", wheels[0]), ("child", wheels[1]),
        ("ratio", repr(turning))), where=node.line)


def _along(axes: Sequence[Tuple[float, ...]]) -> float:
    """Return 1 if two axes point the same way, else -1."""
    return math.copysign(1.0, sum(a * b for a, b in zip(*axes)))


def _bearing(node: Node, joints: Sequence[Joint], wheel: str, reference: str) -> Joint:
    """Return the revolute joint between a gear wheel and the reference body."""
    for joint in joints:
        if joint.kind == "revolute" and {joint.parent, joint.child} == {wheel, reference}:
            return joint
    node.fail('gearbox: no revolute joint connects "{}" and the reference body "{}"'.format(wheel, reference),
              "one for each of the two gear wheels")


def _check_geometry(node: Node, axes: Sequence[Tuple[float, ...]], anchors: Sequence[Tuple[float, ...]],
                    ratio: float) -> None:
    """Raise XmlError for gears that no wheels in contact can stand for."""
    dot = sum(a * b for a, b in zip(*axes))
    apart = [b - a for a, b in zip(*anchors)]
    along = sum(a * b for a, b in zip(apart, axes[0]))
    if abs(dot) < 0.9999:
        node.fail("the axes of the two gear wheels are not parallel", "parallel ones; others are not simulated")
    if math.sqrt(max(0.0, sum(a * a for a in apart) - along * along)) < 1e-3:
        node.fail("the two gear wheels rotate about one line", "two lines at a distance; others are not simulated")
    if abs(1.0 + ratio) < 1e-3 or abs(ratio) < 1e-6:
        node.fail("gearbox ratio is {:g}".format(ratio), "another one than 0, and than a belt's, which turns both "
                  "wheels alike")
