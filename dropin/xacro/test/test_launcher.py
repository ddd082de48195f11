# SPDX-License-Identifier: BSD-3-Clause
"""The xacro command: it works in any folder, with any PATH and PYTHONPATH; its messages for broken input.

Runs the files of the source space like launch files, in processes of their own.
"""
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE_DIR = Path(__file__).resolve().parents[1]
COMMANDS = [PACKAGE_DIR / 'xacro', PACKAGE_DIR / 'xacro.py']

ROBOT = '''<?xml version="1.0"?>
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="1"/>
  <xacro:macro name="box" params="name">
    <link name="${name}"><inertial><mass value="$(arg mass)"/></inertial></link>
  </xacro:macro>
  <xacro:box name="base"/>
</robot>
'''


def run(command, *args, cwd='/', **env):
    """Run a command; variables given as None are removed from the environment."""
    full_env = {key: value for key, value in dict(os.environ, **env).items() if value is not None}
    return subprocess.run([str(command)] + [str(arg) for arg in args], cwd=str(cwd), env=full_env, timeout=60,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)


def workspace(tmp_path, python_script):
    """Copy the launcher into a workspace whose venv's python3 is the given shell script; return the command."""
    package = tmp_path / 'ws' / 'src' / 'xacro'
    shutil.copytree(str(PACKAGE_DIR), str(package), ignore=shutil.ignore_patterns('test', '__pycache__'))
    python = tmp_path / 'ws' / '.venv' / 'bin' / 'python3'
    python.parent.mkdir(parents=True)
    python.write_text('#!/bin/sh\n' + python_script)
    python.chmod(0o755)
    return package / 'xacro'


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_text(ROBOT)
    return path


@pytest.mark.parametrize('command', COMMANDS, ids=lambda path: path.name)
class TestCommand:
    def test_expands_macros_and_arguments(self, command, robot):
        result = run(command, robot, 'mass:=2.5')
        assert result.returncode == 0, result.stderr
        assert '<link name="base">' in result.stdout
        assert 'value="2.5"' in result.stdout
        assert result.stderr == ''

    def test_old_option_inorder_is_accepted(self, command, robot):
        assert run(command, '--inorder', robot).stdout == run(command, robot).stdout != ''

    def test_writes_to_a_file_with_o(self, command, robot, tmp_path):
        out = tmp_path / 'out.urdf'
        assert run(command, '-o', out, robot).returncode == 0
        assert '<link name="base">' in out.read_text()

    @pytest.mark.parametrize('cwd', [PACKAGE_DIR, PACKAGE_DIR.parent, PACKAGE_DIR / 'launcher'], ids=str)
    def test_module_is_not_shadowed_by_the_folder_it_runs_in(self, command, robot, cwd):
        """The folders contain a file xacro.py and a folder xacro, which could be imported instead of the module."""
        assert '<link name="base">' in run(command, robot, cwd=cwd).stdout

    def test_module_is_not_shadowed_by_pythonpath(self, command, robot):
        path = os.pathsep.join([str(PACKAGE_DIR), os.environ.get('PYTHONPATH', '')])
        result = run(command, robot, PYTHONPATH=path)
        assert '<link name="base">' in result.stdout, result.stderr

    def test_another_python_first_on_path_is_not_used(self, command, robot, tmp_path):
        python = tmp_path / 'bin' / 'python3'
        python.parent.mkdir()
        # xacro.py itself is started by the first python3 on PATH: a working one, but it may not see the module
        python.write_text('#!/bin/sh\nexec %s -I -S "$@"\n' % sys.executable)
        python.chmod(0o755)
        result = run(command, robot, PATH='%s:%s' % (python.parent, os.environ['PATH']))
        assert '<link name="base">' in result.stdout, result.stderr

    def test_broken_xml_is_named_with_file_and_line(self, command, tmp_path):
        path = tmp_path / 'broken.xacro'
        path.write_text('<robot name="r">\n  <link name="base">\n</robot>\n')
        result = run(command, path)
        assert result.returncode == 2
        assert str(path) in result.stderr and 'line 3' in result.stderr
        assert 'Traceback' not in result.stderr

    def test_failing_macro_is_named(self, command, tmp_path):
        path = tmp_path / 'macro.xacro'
        path.write_text(ROBOT.replace('${name}', '${nmae}'))
        result = run(command, path)
        assert result.returncode == 2
        assert "name 'nmae' is not defined" in result.stderr
        assert 'box' in result.stderr and str(path) in result.stderr
        assert 'Traceback' not in result.stderr

    def test_missing_file_is_named(self, command, tmp_path):
        result = run(command, tmp_path / 'none.xacro')
        assert result.returncode == 2
        assert str(tmp_path / 'none.xacro') in result.stderr
        assert 'Traceback' not in result.stderr


def make_package(folder, name):
    folder.mkdir(parents=True)
    (folder / 'package.xml').write_text('<package format="2"><name>%s</name></package>' % name)


def test_a_closed_pipe_leaves_no_traceback(robot):
    """Like roslaunch when Ctrl-C ends it while it loads its files."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, 'w') as nowhere:
        done = subprocess.run([str(COMMANDS[0]), str(robot)], stdout=nowhere, stderr=subprocess.PIPE, timeout=60,
                              universal_newlines=True)
    assert done.stderr == '' and done.returncode != 0


def test_find_looks_on_the_package_path(tmp_path):
    make_package(tmp_path / 'src' / 'arm', 'arm_description')
    path = tmp_path / 'r.xacro'
    path.write_text(ROBOT.replace('$(arg mass)', '$(find arm_description)/x'))
    result = run(COMMANDS[0], path, ROS_PACKAGE_PATH=str(tmp_path / 'src'))
    assert 'value="%s/src/arm/x"' % tmp_path in result.stdout, result.stderr


def test_find_of_an_unknown_package_names_the_search_path(tmp_path):
    path = tmp_path / 'r.xacro'
    path.write_text(ROBOT.replace('$(arg mass)', '$(find no_such_package)'))
    result = run(COMMANDS[0], path, ROS_PACKAGE_PATH=str(tmp_path))
    assert result.returncode == 2
    assert 'package "no_such_package" not found, ROS_PACKAGE_PATH is %s' % tmp_path in result.stderr
    assert str(path) in result.stderr
    assert 'Traceback' not in result.stderr


def test_venv_above_is_preferred(tmp_path, robot):
    command = workspace(tmp_path, 'echo "venv:$*"\n')
    result = run(command, '--inorder', robot, 'mass:=3')
    assert result.stdout == 'venv:%s/launcher/run_xacro.py --inorder %s mass:=3\n' % (command.parent, robot)


def test_a_symbolic_link_still_finds_the_workspace(tmp_path, robot):
    command = workspace(tmp_path, 'echo "venv:$*"\n')
    link = tmp_path / 'elsewhere' / 'xacro'
    link.parent.mkdir()
    link.symlink_to(command)
    assert run(link, robot).stdout.startswith('venv:')


@pytest.mark.parametrize('cwd', ['/', str(PACKAGE_DIR.parent)])
def test_missing_module_gives_the_cure_and_no_traceback(tmp_path, robot, cwd):
    command = workspace(tmp_path, 'exec /usr/bin/env -u PYTHONPATH %s -I -S "$@"\n' % sys.executable)
    result = run(command, robot, cwd=cwd)
    assert result.returncode == 1
    assert 'make setup' in result.stderr and 'the Python module xacro does not load' in result.stderr
    assert 'Traceback' not in result.stderr


def test_old_name_refuses_to_be_imported_as_the_module():
    result = run(sys.executable, '-c', 'import xacro', PYTHONPATH=str(PACKAGE_DIR))
    assert result.returncode == 1
    assert 'is a command, not the Python module xacro' in result.stderr
