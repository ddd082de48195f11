# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=['m2wr_navigation'] + ['m2wr_navigation.' + layer for layer in (
        'accuracy', 'barn', 'benchmark', 'best_path', 'compare', 'controllers', 'costmap', 'criteria', 'fusion',
        'localization', 'methods', 'optimum', 'planners', 'recoveries', 'ros')],
    package_dir={'': 'src'},
    package_data={'m2wr_navigation.methods': ['*.npz']},
))
