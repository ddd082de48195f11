# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["m2wr_live", "m2wr_live.scene", "m2wr_live.web", "m2wr_live.ros"], package_dir={"": "src"}))
