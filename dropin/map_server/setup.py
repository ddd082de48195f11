# SPDX-License-Identifier: BSD-3-Clause
"""The Python package has another name than the script map_server, which would hide it."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=['map_pictures'], package_dir={'': 'src'}))
