"""``<light>`` of SDF -> Light: nothing here shines, but clients ask for lights by name."""
from m2wr_sim.model.safe_xml import child_bool, child_float, child_text, child_vector, parse_vector, required_name
from m2wr_sim.model.sdf_frames import raw_pose
from m2wr_sim.model.types import Light

_READ = frozenset(("cast_shadows", "intensity", "pose", "diffuse", "specular", "attenuation", "direction", "spot"))


def _colour(element, tag, default):
    """Return red, green, blue and alpha; files write three or four numbers."""
    text = child_text(element, tag)
    if not text:
        return default
    count = 4 if len(text.split()) > 3 else 3
    return tuple(parse_vector(element.find(tag), text, count, tag)) + (1.0,) * (4 - count)


def read_light(element, notes):
    """Read one ``<light>``; XmlError if its name is missing or a number is none."""
    notes.unread(element, _READ)
    base, attenuation = Light(required_name(element)), element.find("attenuation")
    return Light(
        name=base.name, kind=(element.get("type") or "point").strip(), pose=raw_pose(element)[0],
        diffuse=_colour(element, "diffuse", base.diffuse), specular=_colour(element, "specular", base.specular),
        attenuation=tuple(child_float(attenuation, tag, default) for tag, default in zip(
            ("constant", "linear", "quadratic"), base.attenuation)),
        direction=tuple(child_vector(element, "direction", 3, base.direction)),
        cast_shadows=child_bool(element, "cast_shadows", base.cast_shadows))
