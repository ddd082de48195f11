# SPDX-License-Identifier: BSD-3-Clause
"""Finds worlds and models on this machine; imports neither rospy nor the simulation."""
import os

import rospkg

from m2wr_node.user_folder import user_folder
from m2wr_sim.errors import WorldError
from m2wr_sim.model.model_folders import ModelFolders, standard_folders


def package_folder() -> str:
    """Return the folder of this package, which has the worlds and models."""
    return rospkg.RosPack().get_path("m2wr_sim")


def model_folders(share: str) -> ModelFolders:
    """Return the folders that are searched for models; ``share`` is the folder of this package."""
    packages = rospkg.RosPack()
    return standard_folders(share, os.environ, lambda: [packages.get_path(name) for name in sorted(packages.list())])


def find_world(name: str, folder: str) -> str:
    """Return the path of a world file.

    Parameters
    ----------
    name : str
        Absolute path, path relative to the user's folder, or name in ``folder``; ``.world`` may be omitted.
    folder : str
        Folder of this package's worlds.

    Raises
    ------
    WorldError
        If there is no such file; the message names the folders that were searched.
    """
    places = list(dict.fromkeys((user_folder(), os.getcwd(), folder)))
    for place in places:
        for candidate in (os.path.join(place, name), os.path.join(place, name + ".world")):
            if place and os.path.isfile(candidate):
                return os.path.abspath(candidate)
    raise WorldError("world file \"%s\" cannot be read: no such file; searched %s"
                     % (name, "as given" if os.path.isabs(name) else ", ".join(place for place in places if place)))
