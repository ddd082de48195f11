# SPDX-License-Identifier: BSD-3-Clause
"""Folder of a ROS 1 package, for ``$(find ...)`` in xacro files.

The xacro module of PyPI is the one for ROS 2 and imports its look-up by this name. Only the function it calls is here.
"""
from __future__ import annotations

import os

import rospkg


def get_package_share_directory(package_name: str) -> str:
    """Return the folder of a package: its source folder in a devel space, ``share/<name>`` in an install space.

    Parameters
    ----------
    package_name : str
        Name of a package on ``ROS_PACKAGE_PATH``.

    Returns
    -------
    str
        Absolute path.

    Raises
    ------
    LookupError
        If no package of that name is on the path; the message contains the path.
    """
    try:
        return str(rospkg.RosPack().get_path(package_name))
    except rospkg.ResourceNotFound:
        path = os.environ.get('ROS_PACKAGE_PATH') or '(empty: no setup file sourced)'
        raise LookupError('package "%s" not found, ROS_PACKAGE_PATH is %s' % (package_name, path)) from None
