# SPDX-License-Identifier: BSD-3-Clause
"""From ``model://NAME`` to the SDF file of that model, on this machine's disk only."""
from __future__ import annotations

import glob
import os
from typing import TYPE_CHECKING, Callable, Dict, Iterable, List, Mapping, Optional, Tuple

from m2wr_sim.model.fuel import fuel_address, refuse_escape
from m2wr_sim.model.source_files import note_file
from m2wr_sim.model.xml.safe import XmlError, parse_xml, read_file

#: Returns the path of the file of a URI, for instance ``model://NAME``; None if it is not on this machine.
ResolveModel = Callable[[str], Optional[str]]
#: Returns the folder of a package; raises an exception of any type if there is none.
ResolvePackage = Callable[[str], str]

if TYPE_CHECKING:
    from m2wr_sim.model.notes import Notes

NEWEST_SDF = (1, 7)
HOW_TO_INSTALL = "put its folder into ~/.gazebo/models or into a folder that GAZEBO_MODEL_PATH names"
_CONFIGS, _PLAIN = ("model.config", "manifest.xml"), "model.sdf"       # files by which a folder is a model
_MOST_LISTED = 5          # folders in a message
_INSTALLED = "/usr/share/gazebo*/models"        # where Gazebo's packages put theirs, its default for GAZEBO_MODEL_PATH


def parse_version(text: Optional[str]) -> Optional[Tuple[int, ...]]:
    """Return an SDF version text such as ``1.6`` as a tuple (1, 6), or None if it is none."""
    try:
        numbers = tuple(int(word) for word in (text or "").strip().split("."))
    except ValueError:
        return None
    return numbers[:2] if len(numbers) >= 2 else None


def exported_paths(packages: Iterable[str], attribute: str) -> List[str]:
    """Return the folders that packages export as ``<gazebo_ros ATTRIBUTE="${prefix}/..."/>`` in their package.xml.

    Parameters
    ----------
    packages : iterable of str
        Folders of packages; a file that cannot be read is ignored.
    attribute : str
        ``gazebo_model_path`` or ``gazebo_media_path``.

    Returns
    -------
    list of str
    """
    found: List[str] = []
    for folder in packages:
        path = os.path.join(folder, "package.xml")
        note_file(path)
        try:
            with open(path, "rb") as stream:
                text = stream.read()
            if attribute.encode() not in text:      # true of nearly all, and parsing takes most of the time
                continue
            root = parse_xml(text, path)
        except (OSError, XmlError):
            continue
        for element in root.findall("export/gazebo_ros"):
            value = (element.get(attribute) or "").replace("${prefix}", folder)
            found.extend(os.path.normpath(part) for part in value.split(":") if part.strip())
    return found


class ModelFolders:
    """The search path for models and other files that SDF names; an instance is called with a URI.

    Parameters
    ----------
    folders : iterable of str
        Folders that hold one folder for each model, searched in this order.
    resources : iterable of str
        Folders that ``file://media/...`` and bare relative paths count from.
    packages : callable, optional
        Returns the folders of all ROS packages; the folders that those export are searched last.  It is called at most
        once, if a file was found nowhere else.
    stand_ins : str
        Folder of replacements for models that many worlds include, with the same outer size; searched last.
    """

    def __init__(self, folders: Iterable[str] = (), resources: Iterable[str] = (),
                 packages: Optional[Callable[[], Iterable[str]]] = None, stand_ins: str = "") -> None:
        self._stand_ins = stand_ins
        self.folders = tuple(folder for folder in folders if folder)
        self.resources = tuple(folder for folder in resources if folder)
        self._packages = packages
        self._by_package: Dict[str, str] = {}

    def _ask_packages(self) -> bool:
        """Add what packages export; return whether there are packages."""
        if self._packages is None:
            return False
        folders, self._packages = list(self._packages()), None
        self._by_package = {os.path.basename(os.path.normpath(folder)): folder for folder in folders}
        self.folders += tuple(exported_paths(folders, "gazebo_model_path"))
        self.resources += tuple(exported_paths(folders, "gazebo_media_path"))
        return True

    def __call__(self, uri: str) -> Optional[str]:
        """Return the path of the file of a URI, or None if it is not on this machine.

        Parameters
        ----------
        uri : str
            ``model://NAME`` (its SDF file), ``model://NAME/path``, ``package://NAME/path``, ``file:///absolute/path``,
            ``file://relative/path``, a bare relative path, or that of a model on a Fuel server, see
            :mod:`m2wr_sim.model.fuel`; nothing is downloaded.

        Raises
        ------
        XmlError
            If the path contains ``..``, or the model's own model.config is malformed or names no usable file.
        """
        found = self._first(self._candidates(uri))
        if found is None and self._ask_packages():
            found = self._first(self._candidates(uri))
        if found is None:
            address = fuel_address(uri)
            if address is not None:
                return self(address.as_model())
        if found is None and self._stand_ins and uri.startswith("model://"):
            found = self._first([os.path.join(self._stand_ins, uri[len("model://"):].strip("/"))])
        return found

    def folder(self, uri: str) -> Optional[str]:
        """Return the path of the folder of a URI, such as ``model://NAME/materials/scripts``; None if there is none.

        Parameters
        ----------
        uri : str
            As in a call.

        Raises
        ------
        XmlError
            If the path contains ``..``.
        """
        for ask in (False, True):
            if ask and not self._ask_packages():
                break
            found = next((path for path in self._candidates(uri) if os.path.isdir(path)), None)
            if found is not None:
                return found
        return None

    def names(self, most: int) -> List[str]:
        """Return the names of the models in all folders, at most ``most`` of them, sorted."""
        self._ask_packages()
        found = {name for folder in self.folders if os.path.isdir(folder) for name in os.listdir(folder)
                 if any(os.path.isfile(os.path.join(folder, name, file)) for file in _CONFIGS + (_PLAIN,))}
        return sorted(found)[:most]

    def stood_in(self, path: str) -> str:
        """Return the name of the model that a stand-in at ``path`` replaces; empty if it is not a stand-in."""
        if not self._stand_ins:
            return ""
        inside = os.path.relpath(os.path.realpath(path), os.path.realpath(self._stand_ins))
        return "" if inside.startswith(os.pardir) else inside.split(os.sep)[0]

    @staticmethod
    def _first(candidates: Iterable[str]) -> Optional[str]:
        for candidate in candidates:
            note_file(candidate)
            if os.path.isfile(candidate):
                return candidate
            found = _file_in_folder(candidate) if os.path.isdir(candidate) else None
            if found is not None:
                return found
        return None

    def _candidates(self, uri: str) -> List[str]:
        scheme, mark, rest = uri.partition("://")
        if not mark:
            scheme, rest = "file", uri
        if scheme == "model":
            rest = rest.strip("/")
            refuse_escape(rest, uri)
            return [os.path.join(folder, rest) for folder in self.folders] if rest else []
        if scheme == "package":
            refuse_escape(rest.lstrip("/"), uri)
            name, _, inside = rest.strip("/").partition("/")
            return [os.path.join(self._by_package[name], inside.lstrip("/"))] if name in self._by_package else []
        if scheme in ("http", "https"):
            address = fuel_address(uri)
            return [] if address is None else address.in_caches()
        if scheme != "file" or not rest:
            return []
        refuse_escape(rest.lstrip("/"), uri)
        return [rest] if os.path.isabs(rest) else [os.path.join(folder, rest) for folder in self.resources]

    def __str__(self) -> str:
        names = list(self.folders[:_MOST_LISTED])
        if len(self.folders) > _MOST_LISTED:
            names.append("and %d folders that packages or GAZEBO_MODEL_PATH name" % (len(self.folders) - _MOST_LISTED))
        return ", ".join(names) if names else "no folders"


def standard_folders(share: str, environment: Mapping[str, str],
                     packages: Optional[Callable[[], Iterable[str]]] = None) -> ModelFolders:
    """Return the :class:`ModelFolders` of a program started in ``environment``, in Gazebo's order.


    Parameters
    ----------
    share : str
        Folder with ``models`` and ``stand_ins`` of this package.
    environment : mapping
        Environment variables.
    packages : callable, optional
        See :class:`ModelFolders`.

    Returns
    -------
    ModelFolders
    """
    home = os.path.join(os.path.expanduser("~"), ".gazebo", "models")
    listed = [environment.get(name, "").split(":") for name in ("GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH")]
    if not any(listed[0]):
        listed[0] = sorted(glob.glob(_INSTALLED))
    return ModelFolders([home] + listed[0] + [os.path.join(share, "models")], listed[1], packages,
                        os.path.join(share, "stand_ins"))


def tell_stand_in(notes: Notes, folders: Optional[ResolveModel], path: str) -> None:
    """Report once for each model that a stand-in is used, if the file at ``path`` belongs to one.

    Parameters
    ----------
    notes : Notes
    folders : callable or None
        Function that found the file; only :class:`ModelFolders` has stand-ins.
    path : str
    """
    name = folders.stood_in(path) if isinstance(folders, ModelFolders) else ""
    if name:
        notes.add("model://{} is not installed; using the stand-in of the same outer size ({}).".format(
            name, HOW_TO_INSTALL), ("stand-in", name))


def _file_in_folder(folder: str) -> Optional[str]:
    """Return the newest SDF file that the folder's model.config names and this package reads, or None.

    If all are newer than that, the oldest of them is tried.
    """
    for name in _CONFIGS:
        config = os.path.join(folder, name)
        note_file(config)
        if os.path.isfile(config):
            return _file_in_config(config, folder)
    plain = os.path.join(folder, _PLAIN)
    note_file(plain)
    return plain if os.path.isfile(plain) else None


def _file_in_config(config: str, folder: str) -> str:
    root = parse_xml(read_file(config), config)
    listed = [(parse_version(element.get("version")) or (1, 0), (element.text or "").strip())
              for element in root.iter("sdf") if (element.text or "").strip()]
    if not listed:
        raise XmlError('{}: no <sdf version="..."> is listed; expected one with the name of an SDF file'.format(config))
    usable = [entry for entry in listed if entry[0] <= NEWEST_SDF]
    name = max(usable, key=lambda entry: entry[0])[1] if usable else min(listed, key=lambda entry: entry[0])[1]
    refuse_escape(name, config)
    path = os.path.join(folder, name)
    note_file(path)
    if not os.path.isfile(path):
        raise XmlError("{}: lists the file {}, which does not exist; expected an SDF file there".format(config, name))
    return path
