# SPDX-License-Identifier: BSD-3-Clause
"""The launch files: all arguments of Gazebo's, and the nodes they start."""
import os
import re

import pytest
import roslaunch.config
import roslaunch.xmlloader
from lxml import etree

PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
EMPTY = {'paused', 'use_sim_time', 'extra_gazebo_args', 'gui', 'recording', 'headless', 'debug', 'physics', 'verbose',
         'output', 'world_name', 'respawn_gazebo', 'use_clock_frequency', 'pub_clock_frequency', 'enable_ros_network',
         'server_required', 'gui_required'}
WRAPPER = {'paused', 'use_sim_time', 'gui', 'headless', 'recording', 'debug'}
ARGUMENTS = {
    'empty': EMPTY, 'mud': WRAPPER, 'rubble': WRAPPER, 'shapes': WRAPPER, 'willowgarage': WRAPPER,
    'range': {'paused', 'use_sim_time', 'extra_gazebo_args', 'gui', 'debug', 'physics', 'verbose', 'world'},
    'elevator': {'paused', 'use_sim_time', 'extra_gazebo_args', 'gui', 'recording', 'headless', 'debug', 'physics',
                 'verbose', 'world_name'},
}


def path_of(name):
    return os.path.join(PACKAGE, 'launch', name + '_world.launch')


def load(name, *words):
    """Load a launch file with arguments; returns its nodes by name and its parameters."""
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.xmlloader.XmlLoader().load(path_of(name), config, argv=list(words), verbose=False)
    return {node.name: node for node in config.nodes}, {key: entry.value for key, entry in config.params.items()}


def declared(name):
    return {entry.get('name'): entry.get('default') for entry in etree.parse(path_of(name)).getroot().iter('arg')
            if entry.get('default') is not None and entry.getparent().tag == 'launch'}


@pytest.mark.parametrize('name', sorted(ARGUMENTS))
def test_every_argument_of_gazebos_file_is_declared(name):
    assert ARGUMENTS[name] <= set(declared(name))


@pytest.mark.parametrize('name', sorted(ARGUMENTS))
def test_every_argument_can_be_given(name):
    values = {'world_name': '/w.world', 'world': 'w', 'physics': 'ode', 'output': 'log', 'pub_clock_frequency': '50',
              'extra_gazebo_args': '--seed 3', 'respawn_gazebo': 'false'}     # roslaunch: respawn or required
    nodes, _ = load(name, *('%s:=%s' % (arg, values.get(arg, 'true')) for arg in ARGUMENTS[name]))
    assert set(nodes) == {'gazebo', 'gazebo_gui'} and nodes['gazebo'].type == 'debug'
    assert '-u' in nodes['gazebo'].args.split()


@pytest.mark.parametrize('name', sorted(ARGUMENTS))
def test_no_robot_name_is_special_and_set_parameters_are_kept(name):
    assert not [key for key in load(name)[1] if 'wheel_convention' in key]


def test_a_wheel_convention_can_be_given_for_all_robots():
    parameters = load('empty', 'wheel_convention:=rep103')[1]
    assert {key: value for key, value in parameters.items() if 'wheel' in key} == {'/gazebo/wheel_convention': 'rep103'}


@pytest.mark.parametrize('name', sorted(ARGUMENTS))
def test_the_defaults(name):
    nodes, parameters = load(name)
    server = nodes['gazebo']
    assert (server.package, server.type) == ('gazebo_ros', 'gzserver') and '-u' not in server.args.split()
    assert '-e ode' in server.args and server.args.split()[-1].endswith('.world')
    assert parameters['/use_sim_time'] is True and nodes['gazebo_gui'].type == 'gzclient'


def test_what_the_flags_become():
    nodes, parameters = load('empty', 'paused:=true', 'recording:=true', 'verbose:=true', 'gui:=false',
                             'use_sim_time:=false', 'respawn_gazebo:=true', 'output:=log',
                             'extra_gazebo_args:=--seed 4', 'world_name:=a.world')
    assert nodes['gazebo'].args.split() == '-u -r --verbose -e ode --seed 4 a.world'.split()
    assert nodes['gazebo'].respawn and nodes['gazebo'].output == 'log' and 'gazebo_gui' not in nodes
    assert parameters['/use_sim_time'] is False


def test_what_is_required():
    nodes, _ = load('empty', 'server_required:=true', 'gui_required:=true')
    assert nodes['gazebo'].required and nodes['gazebo_gui'].required and '--stay' in nodes['gazebo_gui'].args
    nodes, _ = load('empty')
    assert not nodes['gazebo'].required and not nodes['gazebo_gui'].required


def test_the_clock_frequency_counts_only_if_asked_for():
    assert '/gazebo/pub_clock_frequency' not in load('empty', 'pub_clock_frequency:=50')[1]
    parameters = load('empty', 'use_clock_frequency:=true', 'pub_clock_frequency:=50')[1]
    assert parameters['/gazebo/pub_clock_frequency'] == 50


def test_the_network_parameter():
    assert load('empty')[1]['/gazebo/enable_ros_network'] is True
    assert load('empty', 'enable_ros_network:=false')[1]['/gazebo/enable_ros_network'] is False


def test_elevator_keeps_use_sim_time_on_request():
    assert '/use_sim_time' not in load('elevator', 'use_sim_time:=false')[1]


def test_the_readme_has_every_argument_with_its_default():
    with open(os.path.join(PACKAGE, 'README.md'), encoding='utf-8') as stream:
        rows = re.findall(r'^\| `(\w+)` \| (`[^`]*`|empty) \|', stream.read(), re.MULTILINE)
    assert {name: value.strip('`').replace('empty', '') if value == 'empty' else value.strip('`')
            for name, value in rows} == declared('empty')
