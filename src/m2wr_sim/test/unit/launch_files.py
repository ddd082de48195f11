# SPDX-License-Identifier: BSD-3-Clause
"""Loads launch files as roslaunch does, with no master and nothing started."""
import os

from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

LAUNCH_DIR = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "launch")


def load(name, *args):
    """Return the nodes by name and the parameters of a launch file."""
    config = ROSLaunchConfig()
    XmlLoader().load(os.path.join(LAUNCH_DIR, name), config, argv=[name] + list(args), verbose=False)
    return {node.name: node for node in config.nodes}, {key: param.value for key, param in config.params.items()}
