# SPDX-License-Identifier: BSD-3-Clause
"""The Python package has another name than the one that is generated from messages and services."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["web_transforms"], package_dir={"": "src"}))
