# SPDX-License-Identifier: BSD-3-Clause
"""Another world in a running simulation: its models are replaced by those of a world file; robots stay."""
from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from typing import List, NamedTuple

from geometry_msgs.msg import Pose

from m2wr_sim.angles import quaternion_from_rpy
from m2wr_sim.ros.pose_messages import write_pose
from m2wr_sim.ros.shared_files import package_folder
from m2wr_view.errors import ViewError

GROUND = "ground_plane"      # every world has one; it stays


class WorldModel(NamedTuple):
    """A model of a world file: its ``name``, an ``sdf`` document with it, and its ``pose``."""

    name: str
    sdf: str
    pose: Pose


def _folder() -> str:
    return os.path.join(package_folder(), "worlds")


def names() -> List[str]:
    """Return the names of the worlds of m2wr_sim."""
    return sorted(name[:-len(".world")] for name in os.listdir(_folder()) if name.endswith(".world"))


def models_of(name: str) -> List[WorldModel]:
    """Return the models and actors of a world of m2wr_sim, without lights and without the ground.

    Parameters
    ----------
    name : str
        One of :func:`names`.

    Raises
    ------
    ViewError
        If there is no such world, or its file cannot be read.
    """
    if name not in names():
        raise ViewError("world %r; expected one of %s" % (name[:60], ", ".join(names())))
    path = os.path.join(_folder(), name + ".world")
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise ViewError("world %s: %s" % (path, error)) from error
    found = []
    for element in root.findall("world/*"):
        uri = (element.findtext("uri") or "").rpartition("/")[2]
        own = (element.findtext("name") or uri) if element.tag == "include" else element.get("name")
        if element.tag in ("model", "actor", "include") and own and own not in (GROUND, "sun"):
            pose = _taken_pose(element)
            found.append(WorldModel(own, "<sdf version=\"%s\"><world name=\"world\">%s</world></sdf>" % (
                root.get("version", "1.6"), ElementTree.tostring(element, encoding="unicode")), pose))
    return found


def _taken_pose(element: ElementTree.Element) -> Pose:
    """Take the pose out of a model's element, as the service that adds it is told where to put it.

    The way points of an actor are places in the world, so that it is added at the origin.
    """
    found = Pose()
    pose = element.find("pose") if element.tag != "actor" else None
    numbers = [0.0] * 6
    if pose is not None:
        element.remove(pose)
        words = (pose.text or "").split()
        numbers = [float(word) for word in words] if len(words) == 6 else numbers
    write_pose(found, numbers[:3], quaternion_from_rpy(*numbers[3:]))
    return found
