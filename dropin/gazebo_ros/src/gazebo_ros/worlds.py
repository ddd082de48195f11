# SPDX-License-Identifier: BSD-3-Clause
"""Search path of world files: as given, GAZEBO_RESOURCE_PATH, exports of packages, the installed folders."""
from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from typing import Any, Iterator, List, Mapping, Optional, Sequence, Tuple

import rospkg

from m2wr_node.user_folder import user_folder


def exported_folders(rospack: Any) -> List[str]:
    """Return the folders that packages export as ``<gazebo_ros gazebo_media_path="..."/>``, in order of their names.

    Parameters
    ----------
    rospack : rospkg.RosPack

    Returns
    -------
    list of str
    """
    found: List[str] = []
    for name in sorted(rospack.list()):
        folder = rospack.get_path(name)
        try:
            root = ElementTree.parse(os.path.join(folder, 'package.xml')).getroot()
        except (OSError, ElementTree.ParseError):
            continue        # manifest.xml of rosbuild; a broken file elsewhere must not hide the worlds of the others
        for element in root.iterfind('export/gazebo_ros'):
            value = element.get('gazebo_media_path', '').replace('${prefix}', folder)
            found.extend(part for part in value.split(':') if part)
    return found


def shipped_folders(rospack: Any) -> List[str]:
    """Return the folders that contain ``worlds/`` of this package and of m2wr_sim."""
    return [rospack.get_path(name) for name in ('gazebo_ros', 'm2wr_sim')]


def candidates(name: str, environment: Mapping[str, str], folders: Sequence[str], rospack: Any) -> Iterator[str]:
    """Yield the possible paths of a world, in order of priority.

    Parameters
    ----------
    name : str
        As on the command line: absolute, or relative to any of the places.
    environment : mapping of str to str
        GAZEBO_RESOURCE_PATH of it is read.
    folders : sequence of str
        Folders of the user and of this program.
    rospack : rospkg.RosPack
    """
    if os.path.isabs(name):
        yield name
        return
    for folder in folders:
        yield os.path.join(folder, name)
    for folder in environment.get('GAZEBO_RESOURCE_PATH', '').split(':'):
        if folder:
            yield os.path.join(folder, name)
    for folder in exported_folders(rospack):
        yield os.path.join(folder, name)
    for folder in shipped_folders(rospack):
        yield os.path.join(folder, name)
        yield os.path.join(folder, 'worlds', name)
        yield os.path.join(folder, 'worlds', name + '.world')


def find(name: str, environment: Optional[Mapping[str, str]] = None, folders: Optional[Sequence[str]] = None,
         rospack: Any = None) -> Tuple[Optional[str], List[str]]:
    """Find a world file.

    Parameters
    ----------
    name, environment, folders, rospack
        As for :func:`candidates`; by default those of this process, the user's folder and the present one first.

    Returns
    -------
    path : str or None
        Absolute path, or None if there is no such file anywhere.
    searched : list of str
        The paths that were tried, for the message.
    """
    searched: List[str] = []
    for path in candidates(name, os.environ if environment is None else environment,
                           folders or (user_folder(), os.getcwd()), rospack or rospkg.RosPack()):
        path = os.path.abspath(path)
        if path in searched:
            continue
        searched.append(path)
        if os.path.isfile(path):
            return path, searched
    return None, searched
