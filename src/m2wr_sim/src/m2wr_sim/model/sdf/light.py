# SPDX-License-Identifier: BSD-3-Clause
"""``<light>`` and ``<scene>`` of SDF -> Light and Scene, which cameras see."""
from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

from m2wr_sim.model.sdf.frames import raw_pose
from m2wr_sim.model.types import Light, Scene

Colour = Tuple[float, float, float, float]        # red, green, blue, alpha
if TYPE_CHECKING:
    from m2wr_sim.model.sdf.node import Node


def _colour(node: Node, tag: str, default: Colour) -> Colour:
    """Return red, green, blue and alpha; files write three or four numbers."""
    text = node.text(tag)
    if not text:
        return default
    count = 4 if len(text.split()) > 3 else 3
    red, green, blue, alpha = (*(node.vector(tag, count, default) or default), 1.0)[:4]
    return (red, green, blue, alpha)


def read_light(node: Node) -> Light:
    """Read one ``<light>``; raise XmlError if its name is missing."""
    base, attenuation = Light(node.name()), node.child("attenuation")
    light = Light(
        name=base.name, kind=node.attribute("type") or "point", pose=raw_pose(node)[0],
        diffuse=_colour(node, "diffuse", base.diffuse), specular=_colour(node, "specular", base.specular),
        attenuation=(attenuation.number("constant", base.attenuation[0]),
                     attenuation.number("linear", base.attenuation[1]),
                     attenuation.number("quadratic", base.attenuation[2])),
        direction=node.vector("direction", 3, base.direction),
        cast_shadows=node.flag("cast_shadows", base.cast_shadows))
    node.done()
    return light


def read_scene(node: Node) -> Scene:
    """Read the ``<scene>`` of a world; a missing one gives the defaults.  Its other elements have no effect."""
    if not node:
        return Scene()
    base, sky = Scene(), node.child("sky")
    sky.ignore()
    return Scene(_colour(node, "ambient", base.ambient), _colour(node, "background", base.background),
                 bool(sky), node.flag("shadows", base.shadows))
