# SPDX-License-Identifier: BSD-3-Clause
"""Installs the Python package."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["collision_topic"], package_dir={"": "src"}))
