# SPDX-License-Identifier: BSD-3-Clause
"""Which node stands in for a nodelet, and where the system's own program is."""
from __future__ import annotations

import os
from typing import List, Mapping, NamedTuple, Optional
from xml.etree import ElementTree

import rospkg

TAG = "m2wr_nodelet"            # <m2wr_nodelet type="package/Class" node="program"/> in the export of a package.xml
PREFIXES = "/opt/ros/noetic", "/usr"
_COMMANDS = "load", "standalone"


class Node(NamedTuple):
    """Program ``node`` of a package."""

    package: str
    node: str


def wanted(arguments: List[str]) -> Optional[str]:
    """Return the nodelet that a command line loads, as ``package/Class``; None if it loads none.

    Parameters
    ----------
    arguments : list of str
        Without the name of the program: ``load package/Class manager``, ``standalone package/Class``; remappings,
        ``from:=to``, may be among them.
    """
    words = [word for word in arguments if ":=" not in word and not word.startswith("--")]
    return words[1] if len(words) > 1 and words[0] in _COMMANDS and "/" in words[1] else None


def node_for(nodelet: str, packages: rospkg.RosPack) -> Optional[Node]:
    """Return the node that its package declares in place of a nodelet; None if there is no such node.

    Parameters
    ----------
    nodelet : str
        ``package/Class``.
    packages : rospkg.RosPack
    """
    package = nodelet.split("/")[0]
    try:
        manifest = packages.get_manifest(package)
    except (rospkg.ResourceNotFound, rospkg.InvalidManifest, ElementTree.ParseError):
        return None
    declared = dict(zip(manifest.get_export(TAG, "type"), manifest.get_export(TAG, "node")))
    return Node(package, declared[nodelet]) if nodelet in declared else None


def remappings(arguments: List[str]) -> List[str]:
    """Return the remappings of a command line, which a node gets unchanged: its private names are the nodelet's."""
    return [word for word in arguments if ":=" in word]


def system_program(name: str, own: str, environ: Mapping[str, str]) -> Optional[str]:
    """Return the path of a program of the package nodelet that is not ours; None if there is none.

    Parameters
    ----------
    name : str
        Of the program.
    own : str
        Path of the program that asks.
    environ : mapping
        With ``CMAKE_PREFIX_PATH``.
    """
    prefixes = [prefix for prefix in environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for prefix in prefixes + list(PREFIXES):
        path = os.path.join(prefix, "lib", "nodelet", name)
        if os.access(path, os.X_OK) and not _is_ours(path, own):
            return path
    return None


def _is_ours(path: str, own: str) -> bool:
    """Return whether a program is this one, or the one of another build of this workspace."""
    if os.path.realpath(path) == os.path.realpath(own):
        return True
    with open(path, "rb") as stream:
        start = stream.read(4096)
    return start.startswith(b"#!") and b"m2wr_nodelet" in start
