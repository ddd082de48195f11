# SPDX-License-Identifier: BSD-3-Clause
"""Reads worlds and robots from a name, a path, a text or a record."""
from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any, Dict, Optional, Union

import rospkg

from m2wr_sim.api.shared import Shared
from m2wr_sim.errors import ModelError, NotFoundError, WorldError
from m2wr_sim.model.model_folders import standard_folders
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.model.source_files import note_file
from m2wr_sim.model.types import Model, World
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.urdf.xacro_text import expand_xacro, expanded
from m2wr_sim.model.xml.lenient import root_tag
from m2wr_sim.model.xml.safe import errors_as

_HERE = Path(__file__).resolve()
#: Robots that are known by name: package, and file in it.
ROBOTS = {"m2wr": ("m2wr_description", "urdf/m2wr.xacro"),
          "m2wr_rough": ("m2wr_description", "urdf/m2wr_rough.xacro")}


_MOST_COLLISIONS = 200000       # in the worlds, and in the robots, that are kept; one takes about 2 kB


def _collisions(model: Model) -> int:
    return 1 + sum(1 + len(link.collisions) for link in model.links)


_worlds: Shared[World] = Shared(lambda world: 1 + sum(map(_collisions, world.models)), _MOST_COLLISIONS)
_robots: Shared[Model] = Shared(_collisions, _MOST_COLLISIONS)


@lru_cache(maxsize=1)
def _packages(_: Optional[str]) -> Any:
    """Return the index of ROS packages, cached: it takes 10 ms to build, and reading a robot needs it several times."""
    return rospkg.RosPack()


def package_folder(name: str) -> str:
    """Return the folder of a ROS package: in the workspace of the environment, or beside this package.

    Raises
    ------
    NotFoundError
        If there is no such package.
    """
    beside = [_HERE.parents[4] / name]                          # the source tree
    if len(_HERE.parents) > 5:
        beside.append(_HERE.parents[5] / "share" / name)        # an install space
    found = None
    if name != "m2wr_sim":                                      # worlds of this version
        try:
            found = _packages(os.environ.get("ROS_PACKAGE_PATH")).get_path(name)
        except rospkg.ResourceNotFound:
            _packages.cache_clear()                             # it may be installed later
    for folder in beside:
        if found is None and (folder / "package.xml").is_file():
            found = str(folder)
    if found is not None:
        return found
    raise NotFoundError("there is no package \"%s\" in ROS_PACKAGE_PATH nor beside m2wr_sim (%s)"
                        % (name, ", ".join(str(folder) for folder in beside)))


def _model_folders() -> Any:
    packages = _packages(os.environ.get("ROS_PACKAGE_PATH"))
    return standard_folders(package_folder("m2wr_sim"), os.environ,
                            lambda: [packages.get_path(name) for name in sorted(packages.list())])


def read_world(world: Union[World, str, os.PathLike[str]]) -> World:
    """Read a world.

    Parameters
    ----------
    world : World, str or Path
        A record (returned as it is), the path of an SDF ``.world`` file, the name of one of this package's worlds
        (``world02`` or ``world02.world``), or the SDF text itself.

    Returns
    -------
    m2wr_sim.model.types.World
        It can be used for any number of simulations.  While the files have not changed, the same world is the same
        record, see :mod:`m2wr_sim.api.shared`.

    Raises
    ------
    WorldError
        If there is no such world or it cannot be used.
    """
    if isinstance(world, World):
        return world
    text = os.fspath(world)
    return _worlds.get(text, lambda: _read_world(text))


def _read_world(text: str) -> World:
    if "<" in text:
        return load_world(text, resolve_model=_model_folders())
    folder = os.path.join(package_folder("m2wr_sim"), "worlds")
    for candidate in (text, os.path.join(folder, text), os.path.join(folder, text + ".world")):
        note_file(candidate)
        if os.path.isfile(candidate):
            return load_world(candidate, resolve_model=_model_folders())
    known = sorted(name[:-len(".world")] for name in os.listdir(folder) if name.endswith(".world"))
    raise WorldError("world \"%s\": there is no such file; expected a path or one of %s" % (text, ", ".join(known)))


def read_robot(robot: Union[Model, str, os.PathLike[str]], arguments: Optional[Dict[str, Any]] = None) -> Model:
    """Read a robot, or any other model.

    Parameters
    ----------
    robot : Model, str or Path
        A record (returned as it is), the name of a robot of this workspace (``m2wr``, ``m2wr_rough``), the path of a
        URDF, xacro or SDF file, or the text of one. A file is expanded by xacro where it needs to be, text only if
        ``arguments`` are given: xacro runs code.
    arguments : dict, optional
        Values of xacro arguments, by name.

    Returns
    -------
    m2wr_sim.model.types.Model
        It can be spawned any number of times; as for :func:`read_world`.

    Raises
    ------
    ModelError
        If there is no such robot or it cannot be used.
    """
    if isinstance(robot, Model):
        return robot
    text = os.fspath(robot)
    key = text, None if arguments is None else frozenset((name, str(value)) for name, value in arguments.items())
    return _robots.get(key, lambda: _read_robot(text, arguments))


def _read_robot(text: str, arguments: Optional[Dict[str, Any]]) -> Model:
    source, file = "robot", None
    if text in ROBOTS:
        package, file = ROBOTS[text]
        text = os.path.join(package_folder(package), file)
    if "<" not in text:
        source = file = text
        note_file(source)
        try:
            text = Path(source).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ModelError("robot \"%s\": %s; expected a readable file, its text, or one of %s"
                             % (source, error, ", ".join(sorted(ROBOTS)))) from error
    if root_tag(text) == "robot":
        with errors_as(ModelError):
            given, values = text, {name: str(value) for name, value in (arguments or {}).items()}
            if arguments is not None:
                text = expand_xacro(text, source, package_folder, values)
            elif source == file:
                text = expanded(text, source, package_folder)
            source += "" if text == given else " (expanded)"
        return load_urdf(text, source, resolve_package=package_folder, resolve_model=_model_folders())
    models = load_sdf_models(text, source, resolve_model=_model_folders())
    if len(models) != 1:
        raise ModelError("%s holds %d models; expected one" % (source, len(models)))
    return models[0]
