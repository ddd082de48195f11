# SPDX-License-Identifier: BSD-3-Clause
"""The robot model: it expands, its tree is connected, its numbers are the report's, its plugins name real joints."""
import math
import re
import shutil
import subprocess

import numpy as np
import pytest

from model_files import PACKAGE_DIR, expand, robot_of, run_xacro


@pytest.fixture(scope='module')
def robot():
    return robot_of()


def numbers(text):
    return [float(word) for word in text.split()]


def one(element, path):
    """Return the only element of a path; none or several fail the test."""
    found = element.findall(path)
    assert len(found) == 1, '%d times %s' % (len(found), path)
    return found[0]


def inertia_of(robot, link):
    attributes = one(robot, "link[@name='%s']/inertial/inertia" % link).attrib
    return [float(attributes[key]) for key in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')]


def text_of(element, tag):
    return one(element, tag).text.strip()


class TestStructure:
    def test_check_urdf_accepts_the_model(self, tmp_path):
        urdf = tmp_path / 'm2wr.urdf'
        urdf.write_text(expand())
        result = subprocess.run(['check_urdf', str(urdf)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                universal_newlines=True)
        assert result.returncode == 0, result.stdout
        assert 'Successfully Parsed XML' in result.stdout
        assert 'root Link: link_chassis has 3 child(ren)' in result.stdout

    def test_xacro_says_nothing(self):
        assert run_xacro(PACKAGE_DIR / 'urdf' / 'm2wr.xacro').stderr == ''

    def test_links_and_joints(self, robot):
        assert robot.get('name') == 'm2wr'
        links = [link.get('name') for link in robot.findall('link')]
        assert sorted(links) == ['link_chassis', 'link_left_wheel', 'link_right_wheel', 'sensor_laser']
        joints = {joint.get('name'): joint.get('type') for joint in robot.findall('joint')}
        assert joints == {'joint_left_wheel': 'continuous', 'joint_right_wheel': 'continuous',
                          'joint_sensor_laser': 'fixed'}

    def test_tree_is_connected_and_rooted_at_the_chassis(self, robot):
        parent = {}
        for joint in robot.findall('joint'):
            child = one(joint, 'child').get('link')
            assert child not in parent, child + ' has two parents'
            parent[child] = one(joint, 'parent').get('link')
        links = {link.get('name') for link in robot.findall('link')}
        assert set(parent) == links - {'link_chassis'}
        assert set(parent.values()) <= links

    @pytest.mark.parametrize('link', ['link_chassis', 'link_left_wheel', 'link_right_wheel', 'sensor_laser'])
    def test_inertia_is_one_a_body_can_have(self, robot, link):
        ixx, ixy, ixz, iyy, iyz, izz = inertia_of(robot, link)
        principal = np.linalg.eigvalsh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        assert principal[0] > 0
        assert principal[2] <= (principal[0] + principal[1]) * (1 + 1e-9)

    @pytest.mark.parametrize('material', ['blue', 'white'])
    def test_used_material_is_defined(self, robot, material):
        used = {element.get('name') for element in robot.findall('link/visual/material')}
        assert material in used
        assert one(robot, "material[@name='%s']/color" % material) is not None


class TestReportValues:
    @pytest.mark.parametrize('link, mass', [
        ('link_chassis', 5), ('link_left_wheel', 0.2), ('link_right_wheel', 0.2), ('sensor_laser', 1)])
    def test_mass(self, robot, link, mass):
        assert float(one(robot, "link[@name='%s']/inertial/mass" % link).get('value')) == mass

    def test_inertia_of_chassis_and_wheels(self, robot):
        assert inertia_of(robot, 'link_chassis') == [0.0395416666667, 0, 0, 0.106208333333, 0, 0.106208333333]
        for link in ('link_left_wheel', 'link_right_wheel'):
            assert inertia_of(robot, link) == [0.000526666666667, 0, 0, 0.000526666666667, 0, 0.001]

    def test_inertia_of_the_laser_is_that_of_a_cylinder(self, robot):
        """The listing's last macro parameter can be read as the digit 1: that would give 0.0089583."""
        ixx, _, _, iyy, _, izz = inertia_of(robot, 'sensor_laser')
        assert ixx == iyy == pytest.approx(0.00145833, abs=5e-9)
        assert izz == pytest.approx(0.00125, abs=1e-12)

    @pytest.mark.parametrize('link, xyz, rpy', [
        ('link_chassis', [0, 0, 0.1], [0, 0, 0]),
        ('link_left_wheel', [0, 0, 0], [0, 1.5707, 1.5707]),
        ('link_right_wheel', [0, 0, 0], [0, 1.5707, 1.5707]),
        ('sensor_laser', [0, 0, 0], [0, 0, 0])])
    def test_centre_of_mass(self, robot, link, xyz, rpy):
        origin = one(robot, "link[@name='%s']/inertial/origin" % link)
        assert numbers(origin.get('xyz')) == xyz
        assert numbers(origin.get('rpy')) == rpy

    @pytest.mark.parametrize('joint, xyz', [
        ('joint_right_wheel', [-0.05, 0.20, 0]),
        ('joint_left_wheel', [-0.05, -0.20, 0]),
        ('joint_sensor_laser', [0.15, 0, 0.05])])
    def test_joint_offset(self, robot, joint, xyz):
        origin = one(robot, "joint[@name='%s']/origin" % joint)
        assert numbers(origin.get('xyz')) == xyz
        assert numbers(origin.get('rpy')) == [0, 0, 0]

    @pytest.mark.parametrize('joint', ['joint_left_wheel', 'joint_right_wheel'])
    def test_wheel_joint(self, robot, joint):
        element = one(robot, "joint[@name='%s']" % joint)
        assert numbers(one(element, 'axis').get('xyz')) == [0, 1, 0]
        assert one(element, 'limit').attrib == {'effort': '10000', 'velocity': '1000'}
        assert one(element, 'joint_properties').attrib == {'damping': '1.0', 'friction': '1.0'}
        assert one(element, 'child').get('link') == joint.replace('joint', 'link')

    def test_chassis_shapes(self, robot):
        chassis = one(robot, "link[@name='link_chassis']")
        assert text_of(chassis, 'pose') == '0 0 0.1 0 0 0'
        body = one(chassis, "collision[@name='collision_chassis']")
        assert numbers(one(body, 'geometry/box').get('size')) == [0.5, 0.3, 0.07]
        assert body.find('origin') is None
        seen = [visual for visual in chassis.findall('visual') if visual.find('geometry/box') is not None]
        assert len(seen) == 1
        assert numbers(one(seen[0], 'geometry/box').get('size')) == [0.5, 0.3, 0.07]
        assert numbers(one(seen[0], 'origin').get('xyz')) == [0, 0, 0]
        assert one(seen[0], 'material').get('name') == 'blue'

    def test_visual_caster_is_behind_the_collision_shape(self, robot):
        chassis = one(robot, "link[@name='link_chassis']")
        collision = one(chassis, "collision[@name='caster_front_collision']")
        seen = one(chassis, "visual[@name='caster_front_visual']")
        assert numbers(one(collision, 'origin').get('xyz')) == [0.35, 0, -0.05]
        assert numbers(one(seen, 'origin').get('xyz')) == [0.2, 0, -0.05]
        for shape in (collision, seen):
            assert float(one(shape, 'geometry/sphere').get('radius')) == 0.05

    def test_caster_slides(self, robot):
        surface = one(robot, "link/collision[@name='caster_front_collision']/surface/friction/ode")
        assert {child.tag: float(child.text) for child in surface} == {'mu': 0, 'mu2': 0, 'slip1': 1, 'slip2': 1}

    @pytest.mark.parametrize('name', ['link_left_wheel', 'link_right_wheel'])
    def test_wheel_shapes(self, robot, name):
        link = one(robot, "link[@name='%s']" % name)
        assert one(link, 'collision').get('name') == 'link_right_wheel_collision'
        assert one(link, 'visual').get('name') == name + '_visual'
        for kind in ('collision', 'visual'):
            assert one(link, kind + '/geometry/cylinder').attrib == {'length': '0.04', 'radius': '0.1'}
            assert numbers(one(link, kind + '/origin').get('rpy')) == [0, 1.5707, 1.5707]

    def test_laser_shapes(self, robot):
        link = one(robot, "link[@name='sensor_laser']")
        for kind in ('collision', 'visual'):
            assert one(link, kind + '/geometry/cylinder').attrib == {'length': '0.1', 'radius': '0.05'}
            assert numbers(one(link, kind + '/origin').get('xyz')) == [0, 0, 0]
        assert one(link, 'visual/material').get('name') == 'white'

    def test_robot_stands_level_on_wheels_and_caster(self, robot):
        """The lowest points of all three are at the same height below the chassis frame."""
        caster = one(robot, "link/collision[@name='caster_front_collision']")
        caster_radius = float(one(caster, 'geometry/sphere').get('radius'))
        caster_bottom = numbers(one(caster, 'origin').get('xyz'))[2] - caster_radius
        wheel_bottom = -float(one(robot, "link[@name='link_left_wheel']/collision/geometry/cylinder").get('radius'))
        assert caster_bottom == pytest.approx(-0.1) and wheel_bottom == pytest.approx(-0.1)

    def test_colours(self, robot):
        expected = {
            'black': [0, 0, 0], 'blue': [0.203125, 0.23828125, 0.28515625], 'green': [0, 0.8, 0],
            'grey': [0.2, 0.2, 0.2], 'orange': [1, 0.423529411765, 0.0392156862745],
            'brown': [0.870588235294, 0.811764705882, 0.764705882353], 'red': [0.80078125, 0.12890625, 0.1328125],
            'white': [1, 1, 1]}
        colours = {element.get('name'): numbers(one(element, 'color').get('rgba'))
                   for element in robot.findall('material')}
        assert colours == {name: rgb + [1] for name, rgb in expected.items()}


class TestGazeboBlocks:
    def test_colours_of_the_simulated_robot(self, robot):
        colours = {block.get('reference'): text_of(block, 'material') for block in robot.findall('gazebo[material]')}
        assert colours == {'link_chassis': 'Gazebo/Red', 'link_left_wheel': 'Gazebo/Black',
                           'link_right_wheel': 'Gazebo/Black'}

    def test_differential_drive(self, robot):
        plugin = one(robot, 'gazebo/plugin')
        assert plugin.attrib == {'filename': 'libgazebo_ros_diff_drive.so', 'name': 'differential_drive_controller'}
        assert {child.tag: child.text for child in plugin} == {
            'alwaysOn': 'true', 'updateRate': '20', 'leftJoint': 'joint_left_wheel', 'rightJoint': 'joint_right_wheel',
            'wheelSeparation': '0.4', 'wheelDiameter': '0.2', 'torque': '0.1', 'commandTopic': 'cmd_vel',
            'odometryTopic': 'odom', 'odometryFrame': 'odom', 'robotBaseFrame': 'link_chassis'}

    @pytest.mark.parametrize('args', [(), ('swap_wheel_joints:=true',)])
    def test_plugin_names_joints_and_links_of_the_robot(self, args):
        robot = robot_of(*args)
        joints = {joint.get('name') for joint in robot.findall('joint')}
        links = {link.get('name') for link in robot.findall('link')}
        plugin = one(robot, 'gazebo/plugin')
        named = {text_of(plugin, 'leftJoint'), text_of(plugin, 'rightJoint')}
        assert len(named) == 2 and named <= joints
        assert text_of(plugin, 'robotBaseFrame') in links
        assert {block.get('reference') for block in robot.findall('gazebo[@reference]')} <= links

    def test_drive_geometry_is_that_of_the_wheels(self, robot):
        """Where they differ, the robot turns or drives by the wrong factor."""
        plugin = one(robot, 'gazebo/plugin')
        left, right = (numbers(one(robot, "joint[@name='%s']/origin" % text_of(plugin, tag)).get('xyz'))
                       for tag in ('leftJoint', 'rightJoint'))
        distance = math.hypot(left[0] - right[0], left[1] - right[1])
        assert distance == pytest.approx(float(text_of(plugin, 'wheelSeparation')))
        radius = float(one(robot, "link[@name='link_left_wheel']/collision/geometry/cylinder").get('radius'))
        assert 2 * radius == pytest.approx(float(text_of(plugin, 'wheelDiameter')))

    def test_laser(self, robot):
        sensor = one(robot, "gazebo[@reference='sensor_laser']/sensor")
        assert sensor.attrib == {'type': 'ray', 'name': 'head_hokuyo_sensor'}
        leaves = {element.tag: element.text for element in sensor.iter() if len(element) == 0}
        assert leaves == {
            'pose': '0 0 0 0 0 0', 'visualize': 'false', 'update_rate': '20', 'samples': '720', 'resolution': '0.01',
            'min_angle': '-1.570796', 'max_angle': '1.570796', 'min': '0.10', 'max': '10.0', 'type': 'gaussian',
            'mean': '0.0', 'stddev': '0.01', 'topicName': '/m2wr/laser/scan', 'frameName': 'sensor_laser'}
        assert text_of(sensor, 'ray/scan/horizontal/resolution') == '1'
        assert text_of(sensor, 'ray/noise/type') == 'gaussian'
        plugin = one(sensor, 'plugin')
        assert plugin.attrib == {'filename': 'libgazebo_ros_laser.so', 'name': 'gazebo_ros_head_hokuyo_controller'}


class TestSwapArgument:
    def test_exchanges_the_two_joints_and_nothing_else(self):
        plain, swapped = expand().splitlines(), expand('swap_wheel_joints:=true').splitlines()
        assert len(plain) == len(swapped)
        changed = [(a.strip(), b.strip()) for a, b in zip(plain, swapped) if a != b]
        assert changed == [
            ('<leftJoint>joint_left_wheel</leftJoint>', '<leftJoint>joint_right_wheel</leftJoint>'),
            ('<rightJoint>joint_right_wheel</rightJoint>', '<rightJoint>joint_left_wheel</rightJoint>')]

    @pytest.mark.parametrize('swap, left_is_on_the_left', [('false', False), ('true', True)])
    def test_side_of_the_left_joint(self, swap, left_is_on_the_left):
        robot = robot_of('swap_wheel_joints:=' + swap)
        left = text_of(one(robot, 'gazebo/plugin'), 'leftJoint')
        y = numbers(one(robot, "joint[@name='%s']/origin" % left).get('xyz'))[1]
        assert (y > 0) == left_is_on_the_left


@pytest.mark.parametrize('namespace', ['http://www.ros.org/wiki/xacro', 'http://ros.org/wiki/xacro'])
def test_both_spellings_of_the_xacro_namespace_load(tmp_path, namespace):
    package = tmp_path / 'm2wr_description'
    shutil.copytree(str(PACKAGE_DIR / 'urdf'), str(package / 'urdf'))
    shutil.copy(str(PACKAGE_DIR / 'package.xml'), str(package))
    for path in (package / 'urdf').iterdir():
        text, count = re.subn(r'xmlns:xacro="[^"]*"', 'xmlns:xacro="%s"' % namespace, path.read_text())
        assert count == 1, path
        path.write_text(text)
    text = expand(path=package / 'urdf' / 'm2wr.xacro', package_dir=package)

    def without_banner(urdf):
        return re.sub(r'<!--.*?-->', '', urdf, flags=re.DOTALL)
    assert without_banner(text) == without_banner(expand())


def test_another_robot_may_include_the_plugin_blocks(tmp_path):
    other = tmp_path / 'other.xacro'
    other.write_text('<robot name="other" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include '
                     'filename="$(find m2wr_description)/urdf/m2wr.gazebo"/><link name="link_chassis"/></robot>')
    assert expand(path=other).count('<plugin ') == 2
