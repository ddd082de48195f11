# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=['m2wr_lockstep', 'm2wr_lockstep.client', 'm2wr_lockstep.server', 'm2wr_lockstep.server.ros'],
    package_dir={'': 'src'},
))
