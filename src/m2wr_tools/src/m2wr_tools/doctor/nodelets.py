# SPDX-License-Identifier: BSD-3-Clause
"""Whether a nodelet can be loaded: its package declares a C++ library with it that is built, or a node in its place."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Iterator, NamedTuple, Optional, Tuple

from m2wr_sim.model.xml.safe import XmlError, parse_xml, read_file
from m2wr_tools.doctor.package_sources import how_to_get

if TYPE_CHECKING:
    from m2wr_tools.doctor.installation import PackageList
    from m2wr_tools.doctor.machine import Machine

_SYSTEM_LIBRARIES = ("/usr/lib", "/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/opt/ros/noetic/lib")


class Fault(NamedTuple):
    """What is wrong, and what to do."""

    what: str
    cure: str


def fault(machine: Machine, packages: PackageList, kind: str) -> Optional[Fault]:
    """Return why a nodelet cannot be loaded, or None if nothing speaks against it.

    Parameters
    ----------
    machine : Machine
    packages : PackageList
    kind : str
        ``package/Class`` as on the command line of nodelet.

    Returns
    -------
    Fault or None
    """
    package = kind.split("/")[0]
    folder = packages.find(package)
    if not folder:
        return Fault("package %s is missing" % package, how_to_get(machine, package))
    manifest = _manifest(folder)
    if manifest is not None and any(entry.get("type") == kind for entry in manifest.iterfind("export/m2wr_nodelet")):
        return None                     # m2wr_nodelet starts a node in its place
    libraries = dict(_declared(folder, manifest) if manifest is not None else ())
    if kind not in libraries:
        return Fault("package %s has no nodelet %s" % (package, kind),
                     "correct the name; the package has %s" % (", ".join(sorted(libraries)) or "none"))
    name = os.path.basename(libraries[kind]) + ".so"
    prefixes = [prefix for prefix in machine.environ.get("CMAKE_PREFIX_PATH", "").split(":") if prefix]
    places = [os.path.join(prefix, "lib") for prefix in prefixes] + [folder] + list(_SYSTEM_LIBRARIES)
    if any(machine.exists(os.path.join(place, name)) for place in places):
        return None
    return Fault("the library %s of nodelet %s is not there" % (name, kind),
                 "it is C++: build package %s in your workspace, or take the element out of the launch file" % package
                 if not folder.startswith("/usr/") else how_to_get(machine, package))


def _manifest(folder: str) -> Optional[Any]:
    """Return the root element of a package's ``package.xml``; None if the file cannot be read."""
    try:
        return parse_xml(read_file(os.path.join(folder, "package.xml")), "package.xml")
    except (OSError, XmlError):
        return None


def _declared(folder: str, manifest: Any) -> Iterator[Tuple[str, str]]:
    """Yield the name of each nodelet that a package declares, and its library; files that cannot be read have none."""
    try:
        for entry in manifest.iterfind("export/nodelet"):
            path = (entry.get("plugin") or "").replace("${prefix}", folder)
            libraries = parse_xml(read_file(path), path)
            for library in [libraries] if libraries.tag == "library" else libraries.iterfind("library"):
                for nodelet in library.iterfind("class"):
                    for name in (nodelet.get("name"), nodelet.get("type")):
                        if name:
                            yield name, library.get("path") or ""
    except (OSError, XmlError):
        return
