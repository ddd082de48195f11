# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["m2wr_tools"] + ["m2wr_tools." + folder for folder in (
        "benchmark", "buildings", "doctor", "map_comparison", "map_figure", "obstacles", "robots", "runs",
        "slam_benchmark", "slam_logs")],
    package_dir={"": "src"},
))
