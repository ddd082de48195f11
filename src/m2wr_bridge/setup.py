# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["m2wr_bridge"] + ["m2wr_bridge." + folder for folder in (
        "foxglove", "messages", "ros", "rosbridge", "web")],
    package_dir={"": "src"},
))
