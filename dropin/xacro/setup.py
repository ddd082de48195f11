# SPDX-License-Identifier: BSD-3-Clause
"""Python modules of this package for catkin; the module xacro is not one of them, it comes from the venv."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=['ament_index_python'], package_dir={'': 'src'}))
