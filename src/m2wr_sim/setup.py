# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["m2wr_sim"] + ["m2wr_sim." + folder for folder in (
        "api", "control", "model", "model.mesh", "model.sdf", "model.urdf", "model.xml", "physics", "plugins",
        "rendering", "ros", "ros.gazebo_services", "ros_control", "ros_control.controllers", "runtime", "sensors")],
    package_dir={"": "src"},
))
