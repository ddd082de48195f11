from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["m2wr_sim"] + ["m2wr_sim." + room for room in (
        "api", "control", "model", "physics", "plugins", "ros", "runtime", "sensors")],
    package_dir={"": "src"},
))
