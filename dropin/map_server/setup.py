# SPDX-License-Identifier: BSD-3-Clause
"""The Python package has a name of its own: beside a script map_server, that name is the script."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=['map_pictures'], package_dir={'': 'src'}))
