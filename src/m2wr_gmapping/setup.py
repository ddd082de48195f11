from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=['m2wr_gmapping', 'm2wr_gmapping.bench', 'm2wr_gmapping.replay',
              'm2wr_gmapping.ros'],
    package_dir={'': 'src'},
))
