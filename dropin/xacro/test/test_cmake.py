# SPDX-License-Identifier: BSD-3-Clause
"""The CMake functions, called as packages with a description call them."""
import os
import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGE_DIR = Path(__file__).resolve().parents[1]
ROBOT = '''<?xml version="1.0"?>
<robot name="%s" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="mass" default="1"/>
<link name="base"><inertial><mass value="$(arg mass)"/></inertial></link></robot>
'''
PROJECT = '''cmake_minimum_required(VERSION 3.0.2)
project(robots NONE)
set(xacro_DIR %s)
set(CATKIN_PACKAGE_SHARE_DESTINATION share/robots)
include(%s)
'''

pytestmark = pytest.mark.skipif(shutil.which('cmake') is None, reason='no cmake')


def build(tmp_path, *lines):
    """Build and install a package with these lines; returns its build folder and install prefix."""
    (tmp_path / 'devel' / 'bin').mkdir(parents=True)
    os.symlink(str(PACKAGE_DIR / 'xacro'), str(tmp_path / 'devel' / 'bin' / 'xacro'))
    (tmp_path / 'devel' / 'share' / 'xacro' / 'cmake').mkdir(parents=True)
    source, made, prefix = tmp_path / 'robots', tmp_path / 'made', tmp_path / 'prefix'
    source.mkdir()
    for name in ('one.xacro', 'two.urdf.xacro'):
        (source / name).write_text(ROBOT % name.partition('.')[0])
    (source / 'CMakeLists.txt').write_text('\n'.join([PROJECT % (
        tmp_path / 'devel' / 'share' / 'xacro' / 'cmake', PACKAGE_DIR / 'cmake' / 'xacro-extras.cmake')] + list(lines)))
    made.mkdir()
    for words in (['cmake', str(source), '-DCMAKE_INSTALL_PREFIX=' + str(prefix)],
                  ['cmake', '--build', '.', '--target', 'install']):
        result = subprocess.run(words, cwd=str(made), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60,
                                universal_newlines=True)
        assert result.returncode == 0, result.stdout
    return made, prefix


def test_several_files_with_an_argument_are_made_and_installed(tmp_path):
    made, prefix = build(tmp_path, 'xacro_add_files(one.xacro two.urdf.xacro INORDER REMAP mass:=7 TARGET media '
                                   'INSTALL DESTINATION urdf)')
    for name in ('one.urdf', 'two.urdf'):
        assert 'value="7"' in (made / name).read_text()
        assert (prefix / 'share' / 'robots' / 'urdf' / name).read_text() == (made / name).read_text()


def test_one_file_under_a_name_of_its_own(tmp_path):
    made, prefix = build(tmp_path, 'xacro_add_xacro_file(${CMAKE_SOURCE_DIR}/one.xacro robots/heavy.urdf '
                                   'REMAP mass:=9 DEPENDS two.urdf.xacro)', 'xacro_install(heavy ${XACRO_OUTPUT_FILE})')
    assert 'value="9"' in (made / 'robots' / 'heavy.urdf').read_text()
    assert (prefix / 'share' / 'robots' / 'heavy.urdf').is_file()
