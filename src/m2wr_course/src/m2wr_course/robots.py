# SPDX-License-Identifier: BSD-3-Clause
"""Exercises 1 to 3: robots.  Each is read, put into the simulator, and driven; no ROS master is needed."""
from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Dict, Iterator, List, Tuple, Union

from lxml import etree

from m2wr_course.finding import Finding
from m2wr_sim.api.loading import package_folder, read_robot
from m2wr_sim.api.sim import Sim
from m2wr_sim.geometry import rotate
from m2wr_sim.model.urdf.xacro_text import expand_xacro

TRACK, TRACK_ERROR = 0.6, 0.005         # m; what exercise 1 asks for
STRAIGHT, SIDEWAYS = 2.0, 0.02          # m; driven, and the offset that is still straight
TURN_RATE, TURN_ERROR = 0.5, 0.05       # rad/s asked; share by which the robot may miss it
TILT = math.radians(2.0)
BACK_BEAMS, BACK_TOPIC = 360, "/m2wr/back/scan"
WALL, WALL_ERROR = 2.0, 0.1             # m; behind the robot's origin
# one box two metres behind the robot, and nothing else
WALL_WORLD = """<sdf version="1.6"><world name="behind">
<model name="ground"><static>1</static><link name="link"><collision name="c"><geometry><plane/></geometry></collision>
</link></model><model name="wall"><static>1</static><pose>-%g 0 0.5 0 0 0</pose><link name="link"><collision name="c">
<geometry><box><size>0.2 4 1</size></box></geometry></collision></link></model></world></sdf>""" % (WALL + 0.1)


def _wheels(model: Any) -> Dict[str, float]:
    """Return {joint: y of its wheel [m]} of the joints that turn about the robot's y axis."""
    places = {link.name: link.pose for link in model.links}
    return {joint.name: places[joint.child][0][1] for joint in model.joints
            if joint.kind in ("continuous", "revolute")}


def _drive_findings(model: Any) -> Iterator[Finding]:
    with Sim("empty", model, wheel_convention="rep103") as sim:
        sim.step((0.0, 0.0), 1.0)
        up = rotate(sim.pose()[1], (0.0, 0.0, 1.0))[2]
        tilt = math.acos(min(1.0, up))
        yield Finding(tilt < TILT, "it stands %.1f degrees from level" % math.degrees(tilt),
                      "wheels and caster must reach the same floor: compare their radii and heights")
        start = sim.observe()[sim.robots[0]].pose
        end = sim.step((0.5, 0.0), STRAIGHT / 0.5).pose
        ahead, aside = end[0] - start[0], end[1] - start[1]
        yield Finding(abs(aside) < SIDEWAYS and abs(ahead - STRAIGHT) < 0.1 * STRAIGHT,
                      "told to drive %g m straight, it drives %.2f m and %.2f m to the side" % (STRAIGHT, ahead, aside),
                      "check <wheelDiameter> against the wheels' radius, and that both wheels are the same")
        sim.reset()
        sim.step((0.0, 0.0), 1.0)
        before = sim.step((0.0, TURN_RATE), 1.0).pose[2]
        after = sim.step((0.0, TURN_RATE), 2.0).pose[2]
        rate = math.remainder(after - before, 2.0 * math.pi) / 2.0
        yield Finding(abs(rate - TURN_RATE) < TURN_ERROR * TURN_RATE,
                      "told to turn left with %g rad/s, it turns with %.2f" % (TURN_RATE, rate),
                      "<wheelSeparation> must be the distance of the wheels, <wheelDiameter> twice their radius")


def wider_robot(path: str) -> Iterator[Finding]:
    """Exercise 1: the robot with its wheels 0.6 m apart.

    Parameters
    ----------
    path : str
        URDF or xacro file.

    Yields
    ------
    Finding
    """
    model = read_robot(path)
    sides = sorted(_wheels(model).values())
    track = sides[-1] - sides[0] if len(sides) > 1 else 0.0
    yield Finding(abs(track - TRACK) < TRACK_ERROR, "the wheels are %.2f m apart" % track,
                  "%g m are asked for: origin_xyz of the two joint_wheel lines" % TRACK)
    yield from _drive_findings(model)


def _plain(element: Any) -> Tuple[Any, ...]:
    """Element as nested tuples in which only what a reader of URDF sees is left: numbers as numbers, no order."""
    attributes = []
    for name, value in sorted(element.attrib.items()):
        try:
            value = tuple(round(float(word), 9) for word in value.split())
        except ValueError:
            pass
        attributes.append((name, value))
    text = (element.text or "").strip()
    try:
        text = str(float(text))
    except ValueError:
        pass
    children = sorted((_plain(child) for child in element.iterchildren(tag=etree.Element)), key=repr)
    return (element.tag, tuple(attributes), text, tuple(children))


def _described(path: Union[str, Path]) -> Dict[str, List[Tuple[Any, ...]]]:
    root = etree.fromstring(expand_xacro(Path(path).read_text(encoding="utf-8"), str(path), package_folder).encode())
    parts: Dict[str, List[Tuple[Any, ...]]] = {}
    for child in root.iterchildren(tag=etree.Element):
        parts.setdefault(_title(child), []).append(_plain(child))
    return {key: sorted(value, key=repr) for key, value in parts.items() if not key.startswith("<material")}


def _title(element: Any) -> str:
    """Return what a reader looks for in the file: the tag with its name, or what it holds where it has none."""
    for attribute in ("name", "reference"):
        if element.get(attribute):
            return "<%s %s=\"%s\">" % (element.tag, attribute, element.get(attribute))
    held = ["<%s%s>" % (child.tag, " name=\"%s\"" % child.get("name") if child.get("name") else "")
            for child in element.iterchildren(tag=etree.Element)]
    return "<%s> with %s" % (element.tag, ", ".join(held)) if held else "<%s>" % element.tag


def _texts(path: Path) -> List[str]:
    """Return the texts of a file and of those beside it that it includes, directly or not."""
    found: Dict[Path, str] = {}
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in found and file.is_file():
            found[file] = file.read_text(encoding="utf-8")
            names = re.findall(r"<xacro:include\s+filename=\"([^\"]+)\"", found[file])
            waiting += [path.parent / name.rsplit("/", 1)[-1] for name in names]
    return list(found.values())


def same_robot(path: str) -> Iterator[Finding]:
    """Exercise 2: other files, the same robot, and no number of the wheels written twice.

    Parameters and yields as :func:`wider_robot`.
    """
    read_robot(path)        # says at once what cannot be read
    mine = _described(path)
    original = _described(Path(package_folder("m2wr_description")) / "urdf" / "m2wr.xacro")
    for key in sorted(set(mine) | set(original)):
        if mine.get(key) != original.get(key):
            what = ("is missing" if key not in mine else "is not in m2wr" if key not in original
                    else "differs from m2wr's")
            yield Finding(False, "%s %s" % (key, what), "compare the texts: xacro FILE > a.urdf; diff a.urdf b.urdf")
    if mine == original:
        yield Finding(True, "it is the same robot, in %d parts" % len(mine))
    text = "".join(_texts(Path(path)))
    names = re.findall(r"<xacro:property\s+name=\"(\w+)\"", text)
    used = [name for name in names if re.search(r"\$\{[^}]*\b%s\b" % name, text)]
    yield Finding(bool(used), "properties that are used: %s" % (", ".join(used) or "none"),
                  "give the wheels' radius a name, <xacro:property name=\"wheel_radius\" value=\"0.1\"/>, and write "
                  "${wheel_radius} for it")


def laser_behind(path: str) -> Iterator[Finding]:
    """Exercise 3: a second laser that looks back.

    Parameters and yields as :func:`wider_robot`.
    """
    model = read_robot(path)
    sensors = [sensor for link in model.links for sensor in link.sensors if sensor.ray is not None]
    topics = [dict(plugin.parameters).get("topicName", "") for sensor in sensors for plugin in sensor.plugins]
    yield Finding(len(sensors) == 2, "the robot has %d laser%s" % (len(sensors), "" if len(sensors) == 1 else "s"),
                  "a second <gazebo reference=\"...\"> with a <sensor>, for a link of its own with a joint and a mass")
    yield Finding(BACK_TOPIC in topics, "their topics: %s" % ", ".join(topics),
                  "<topicName>%s</topicName>" % BACK_TOPIC)
    if BACK_TOPIC not in topics:
        return
    with Sim(WALL_WORLD, model) as sim:
        sim.step((0.0, 0.0), 1.0)
        sim.measure()
        lasers = {laser.name: laser.scan for laser in sim.lasers() if laser.scan is not None}
    name = sensors[topics.index(BACK_TOPIC)].name
    scan = lasers[name]
    yield Finding(len(scan.ranges) == BACK_BEAMS, "it has %d beams" % len(scan.ranges),
                  "<samples>%d</samples>" % BACK_BEAMS)
    nearest = float(min(scan.ranges))
    place = next(sensor for link in model.links for sensor in link.sensors if sensor.name == name)
    offset = next(link.pose[0][0] for link in model.links if place in link.sensors) + place.pose[0][0]
    yield Finding(abs(nearest - (WALL + offset)) < WALL_ERROR,
                  "a wall %g m behind the robot's origin is seen at %.2f m; from x = %.2f m that should be %.2f"
                  % (WALL, nearest, offset, WALL + offset),
                  "the joint's rpy=\"0 0 3.14159\" turns the laser round; mount it at the rear, or above the other")
