# SPDX-License-Identifier: BSD-3-Clause
"""Expand this package's own xacro files, wherever else a package of this name may be on the path."""
import os
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from roslaunch.substitution_args import resolve_args

PACKAGE_DIR = Path(__file__).resolve().parents[2]
MODEL = PACKAGE_DIR / 'urdf' / 'm2wr.xacro'


def run_xacro(path, *args, package_dir=PACKAGE_DIR):
    """Run the xacro command that launch files name; return the finished process, its output as text."""
    env = dict(os.environ)
    env['ROS_PACKAGE_PATH'] = os.pathsep.join([str(package_dir), env.get('ROS_PACKAGE_PATH', '')])
    command = [resolve_args('$(find xacro)/xacro'), str(path)] + list(args)
    return subprocess.run(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)


def expand(*args, path=MODEL, package_dir=PACKAGE_DIR):
    """Return the URDF text of the robot, or of another xacro file; a failure to expand fails the test."""
    result = run_xacro(path, *args, package_dir=package_dir)
    assert result.returncode == 0, result.stderr
    return result.stdout


def robot_of(*args):
    """Return the root element of the expanded robot."""
    return ElementTree.fromstring(expand(*args))
