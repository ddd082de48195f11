# SPDX-License-Identifier: BSD-3-Clause
"""The launch files, loaded as roslaunch loads them but with no master and nothing started."""
import os
import re
import shlex
import xml.etree.ElementTree as ElementTree

import pytest
import yaml
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

from model_files import PACKAGE_DIR, expand

LAUNCH_DIR = PACKAGE_DIR / 'launch'


@pytest.fixture(autouse=True)
def no_master(monkeypatch):
    """Whatever runs on this machine, there is no simulation here."""
    monkeypatch.setenv('ROS_MASTER_URI', 'http://127.0.0.1:1')


def load(name, *args):
    """Return the nodes by name and the parameters of a launch file."""
    config = ROSLaunchConfig()
    XmlLoader().load(str(LAUNCH_DIR / name), config, argv=[name] + list(args), verbose=False)
    return {node.name: node for node in config.nodes}, {key: param.value for key, param in config.params.items()}


def words(node):
    return re.sub(r'\s+', ' ', node.args).strip()


@pytest.mark.parametrize('path', sorted(LAUNCH_DIR.glob('*.launch')), ids=lambda path: path.name)
def test_every_argument_has_a_default_and_a_description(path):
    for arg in ElementTree.parse(str(path)).getroot().findall('arg'):
        assert arg.get('default') is not None and arg.get('doc'), arg.get('name')


class TestSpawn:
    def test_bare_defaults_drop_the_robot_at_the_origin(self):
        nodes, _ = load('spawn.launch')
        assert list(nodes) == ['m2wr_spawn']
        node = nodes['m2wr_spawn']
        assert (node.package, node.type) == ('m2wr_sim', 'spawn_model')
        assert words(node) == '-urdf -param robot_description -model m2wr -x 0 -y 0 -z 0.5 -Y 0'

    def test_arguments_reach_the_spawner(self):
        nodes, _ = load('spawn.launch', 'x:=1.5', 'y:=-2', 'z:=0.2', 'yaw:=3.1', 'spawner:=gazebo_ros')
        assert nodes['m2wr_spawn'].package == 'gazebo_ros'
        assert words(nodes['m2wr_spawn']) == '-urdf -param robot_description -model m2wr -x 1.5 -y -2 -z 0.2 -Y 3.1'

    @pytest.mark.parametrize('swap, convention', [('false', 'kinetic'), ('true', '')])
    def test_description_is_the_expanded_model(self, swap, convention):
        _, params = load('spawn.launch', 'swap_wheel_joints:=' + swap)
        installed = ElementTree.fromstring(params['/robot_description'])
        expected = ElementTree.fromstring(expand('swap_wheel_joints:=' + swap, 'wheel_convention:=' + convention))
        assert ElementTree.tostring(installed) == ElementTree.tostring(expected)

    @pytest.mark.parametrize('words, convention', [
        ((), 'kinetic'), (('swap_wheel_joints:=true',), None), (('wheel_convention:=rep103',), 'rep103')])
    def test_report_robot_turns_as_in_the_report_everywhere(self, words, convention):
        _, params = load('spawn.launch', *words)
        assert not [name for name in params if 'wheel_convention' in name]     # nothing outlives the robot
        plugin, = (block for block in ElementTree.fromstring(params['/robot_description']).iter('plugin')
                   if 'diff_drive' in block.get('filename'))
        assert plugin.findtext('wheelConvention') == convention


@pytest.mark.parametrize('name', ['rvis.launch', 'rviz.launch'])
class TestLook:
    def test_nodes_and_parameters(self, name):
        nodes, params = load(name)
        assert {node.name: (node.package, node.type) for node in nodes.values()} == {
            'joint_state_publisher': ('joint_state_publisher',) * 2,
            'robot_state_publisher': ('robot_state_publisher',) * 2, 'rviz': ('m2wr_view', 'rviz_window')}
        assert not nodes['rviz'].required       # without a display all the rest is still of use
        assert params['/use_sim_time'] is False
        assert '<robot name="m2wr"' in params['/robot_description']

    def test_rviz_can_be_left_out(self, name):
        for left_out in ('rviz:=false', 'gui:=false'):
            nodes, _ = load(name, left_out)
            assert sorted(nodes) == ['joint_state_publisher', 'robot_state_publisher']

    def test_rviz_configuration_exists_and_can_be_chosen(self, name):
        nodes, _ = load(name)
        assert os.path.isfile(shlex.split(nodes['rviz'].args)[-1])
        nodes, _ = load(name, 'config:=/other.rviz')
        assert shlex.split(nodes['rviz'].args) == ['-d', '/other.rviz']

    def test_rvis_uses_clock_and_joints_of_a_simulation(self, name):
        nodes, params = load(name, 'virtual_display:=true')
        words = shlex.split(nodes['rviz'].args)
        assert words[0] == '--simulation' and os.path.basename(words[1]) == 'm2wr.rviz' and words[2] == '-d'
        assert params['/virtual_display/config'] == words[3]        # there is none here
        for node, there in (('joint_state_publisher', '/joint_states'), ('robot_state_publisher',) * 2):
            prefix = nodes[node].launch_prefix.split()
            assert os.path.basename(prefix[0]) == 'is_there' and prefix[1].strip('/') == there.strip('/')

    def test_a_virtual_display_can_be_had(self, name):
        nodes, params = load(name, 'rviz:=false', 'virtual_display:=true', 'screenshots:=/p')
        assert (nodes['virtual_display'].package, params['/virtual_display/out']) == ('m2wr_view', '/p')


@pytest.mark.parametrize('name, frame, topics', [
    ('model.rviz', 'link_chassis', set()), ('m2wr.rviz', 'odom', {'/m2wr/laser/scan', '/odom'})])
def test_rviz_configuration(name, frame, topics):
    manager = yaml.safe_load((PACKAGE_DIR / 'rviz' / name).read_text())['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == frame
    assert {display['Topic'] for display in manager['Displays'] if 'Topic' in display} == topics
    assert {'rviz/RobotModel', 'rviz/TF', 'rviz/Grid'} <= {display['Class'] for display in manager['Displays']}
