# SPDX-License-Identifier: BSD-3-Clause
"""``<light>`` of SDF -> Light: light is not simulated, but services report lights by name."""
from m2wr_sim.model.sdf.frames import raw_pose
from m2wr_sim.model.types import Light


def _colour(node, tag, default):
    """Return red, green, blue and alpha; files write three or four numbers."""
    count = 4 if len((node.text(tag) or "").split()) > 3 else 3
    return tuple(node.vector(tag, count, default)) + (1.0,) * (4 - count) if node.text(tag) else default


def read_light(node):
    """Read one ``<light>``, a Node; XmlError if its name is missing."""
    base, attenuation = Light(node.name()), node.child("attenuation")
    light = Light(
        name=base.name, kind=node.attribute("type") or "point", pose=raw_pose(node)[0],
        diffuse=_colour(node, "diffuse", base.diffuse)[:4], specular=_colour(node, "specular", base.specular)[:4],
        attenuation=tuple(attenuation.number(tag, default) for tag, default in zip(
            ("constant", "linear", "quadratic"), base.attenuation)),
        direction=tuple(node.vector("direction", 3, base.direction)),
        cast_shadows=node.flag("cast_shadows", base.cast_shadows))
    node.done()
    return light
