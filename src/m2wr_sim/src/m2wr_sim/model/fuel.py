# SPDX-License-Identifier: BSD-3-Clause
"""Addresses of models on a Fuel server: worlds name ``https://fuel.gazebosim.org/1.0/OWNER/models/NAME``.

Gazebo downloads such a model into a cache.  Here nothing is downloaded: the model is taken from the caches of Gazebo on
this machine, or else a local model of the same name, ``ground_plane`` for ``Ground Plane``.
"""
from __future__ import annotations

import os
from typing import List, NamedTuple, Optional
from urllib.parse import unquote, urlsplit

from m2wr_sim.model.xml.safe import XmlError

_CACHES = ("~/.gz/fuel", "~/.ignition/fuel")


class FuelAddress(NamedTuple):
    """Server, owner and name of a model; its version, empty for the newest; a file in it, empty for the model."""

    server: str
    owner: str
    name: str
    version: str
    file: str

    def in_caches(self) -> List[str]:
        """Return the paths where Gazebo would have put it, the newest version first."""
        found = []
        for cache in _CACHES:
            folder = os.path.join(os.path.expanduser(cache), self.server, self.owner.lower(), "models",
                                  self.name.lower())
            stored = os.listdir(folder) if os.path.isdir(folder) else []
            versions = [self.version] if self.version else sorted(
                (name for name in stored if name.isdecimal()), key=int, reverse=True)
            found += [os.path.join(folder, version, self.file) if self.file else os.path.join(folder, version)
                      for version in versions]
        return found

    def as_model(self) -> str:
        """Return the ``model://`` address of a local model of this name."""
        return "model://" + "/".join(filter(None, (self.name.lower().replace(" ", "_"), self.file)))


def fuel_address(uri: str) -> Optional[FuelAddress]:
    """Return the parts of the address of a model on a Fuel server; None if it is not one.

    Parameters
    ----------
    uri : str

    Raises
    ------
    XmlError
        If a part leaves the folder of the model.
    """
    try:
        parts = urlsplit(uri)
    except ValueError:
        return None
    words = [unquote(word) for word in parts.path.split("/") if word]
    if parts.scheme not in ("http", "https") or not parts.hostname or words[2:3] != ["models"] or len(words) < 4:
        return None
    owner, name, more = words[1], words[3], words[4:]
    version = more[0] if more and (more[0].isdecimal() or more[0] == "tip") else ""
    more = more[1:] if version else more
    file = "/".join(more[1:]) if more[:1] == ["files"] else ""
    for part in (parts.hostname, owner, name, file):
        refuse_escape(part, uri)
    if "/" in name or "/" in owner:
        return None
    return FuelAddress(parts.hostname, owner, name, "" if version == "tip" else version, file)


def refuse_escape(path: str, source: str) -> None:
    """Check that a path stays in the folder from which it counts.

    Parameters
    ----------
    path : str
    source : str
        Where it was read, for the message.

    Raises
    ------
    XmlError
        If it is absolute, or goes up.
    """
    if os.path.isabs(path) or ".." in path.replace("\\", "/").split("/"):
        raise XmlError('{}: the path "{}" leaves the model\'s folder; expected a path below it, without ".."'.format(
            source, path))
