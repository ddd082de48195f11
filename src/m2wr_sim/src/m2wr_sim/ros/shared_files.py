# SPDX-License-Identifier: BSD-3-Clause
"""Where worlds and models are on this machine; imports neither rospy nor the simulation."""
import os

import rospkg

from m2wr_node.user_folder import user_folder
from m2wr_sim.errors import WorldError
from m2wr_sim.model.model_folders import standard_folders


def package_folder():
    """Return this package's shared files: worlds and models."""
    return rospkg.RosPack().get_path("m2wr_sim")


def model_folders(share):
    """Return where models are looked for in this process; ``share`` is the folder of this package's shared files."""
    packages = rospkg.RosPack()
    return standard_folders(share, os.environ, lambda: [packages.get_path(name) for name in sorted(packages.list())])


def find_world(name, folder):
    """Return the path of a world: absolute, relative to where the user stands, or from this package's ``folder``.

    Raises
    ------
    WorldError
        If there is no such file; the message names the places that were searched.
    """
    places = list(dict.fromkeys((user_folder(), os.getcwd(), folder)))
    for place in places:
        for candidate in (os.path.join(place, name), os.path.join(place, name + ".world")):
            if place and os.path.isfile(candidate):
                return os.path.abspath(candidate)
    raise WorldError("world file \"%s\" cannot be read: there is none of that name; searched %s"
                     % (name, "as given" if os.path.isabs(name) else ", ".join(place for place in places if place)))
