# SPDX-License-Identifier: BSD-3-Clause
"""The search path of gzserver for world files."""
import os

import pytest
import rospkg

from gazebo_ros import server, worlds

PACKAGE = '''<package format="2"><name>%s</name><version>1.0.0</version><description>d</description>
<maintainer email="a@b.c">a</maintainer><license>BSD</license>%s</package>'''


@pytest.fixture
def tree(tmp_path):
    """Folders for worlds: the user's, a resource folder, one exported by a package, the installed ones."""
    for name in ('here', 'resources', 'packages/exporter/media', 'packages/gazebo_ros', 'packages/m2wr_sim'):
        (tmp_path / name / 'worlds').mkdir(parents=True)
    media = '<export><gazebo_ros gazebo_media_path="${prefix}/none:${prefix}/media"/></export>'
    for name, export in (('exporter', media), ('gazebo_ros', ''), ('m2wr_sim', '')):
        (tmp_path / 'packages' / name / 'package.xml').write_text(PACKAGE % (name, export))
    (tmp_path / 'packages' / 'broken').mkdir()
    (tmp_path / 'packages' / 'broken' / 'package.xml').write_text('<package><name>broken</name></package>')
    return tmp_path


def find(tree, name):
    environment = {'GAZEBO_RESOURCE_PATH': ':/no/such/folder:%s' % (tree / 'resources')}
    folders = (str(tree / 'here'), str(tree))
    path, searched = worlds.find(name, environment, folders, rospkg.RosPack([str(tree / 'packages')]))
    return (None if path is None else os.path.relpath(path, str(tree))), searched


def test_the_places_in_their_order(tree):
    places = ['here/worlds', 'resources/worlds', 'packages/exporter/media/worlds', 'packages/gazebo_ros/worlds',
              'packages/m2wr_sim/worlds']
    for place in places:
        (tree / place / 'a.world').write_text('')
    for place in places:
        assert find(tree, 'worlds/a.world')[0] == place + '/a.world'
        (tree / place / 'a.world').unlink()
    assert find(tree, 'worlds/a.world')[0] is None


def test_an_absolute_path_is_looked_for_nowhere_else(tree):
    (tree / 'resources' / 'a.world').write_text('')
    path, searched = find(tree, '/no/such/a.world')
    assert path is None and searched == ['/no/such/a.world']


def test_names_of_the_simulators_own_worlds(tree):
    (tree / 'packages' / 'm2wr_sim' / 'worlds' / 'arena.world').write_text('')
    for name in ('arena', 'arena.world', 'worlds/arena.world'):
        assert find(tree, name)[0] == 'packages/m2wr_sim/worlds/arena.world'


def test_a_folder_is_no_world(tree):
    (tree / 'here' / 'worlds' / 'a.world').mkdir()
    assert find(tree, 'worlds/a.world')[0] is None


def test_the_places_that_were_searched_are_returned(tree):
    _, searched = find(tree, 'worlds/gone.world')
    assert str(tree / 'resources' / 'worlds' / 'gone.world') in searched and len(searched) == len(set(searched))


def test_a_missing_world_is_named_and_replaced_by_the_empty_one(capsys):
    path = server.resolve_world('worlds/no_such.world')
    assert path.endswith('m2wr_sim/worlds/empty.world')
    said = capsys.readouterr().err
    assert 'Could not open file[worlds/no_such.world]' in said and 'empty world' in said


@pytest.mark.parametrize('name', ['empty', 'shapes', 'mud', 'rubble', 'willowgarage', 'elevator_ros'])
def test_gazebos_names_are_there(name):
    path, _ = worlds.find('worlds/%s.world' % name, environment={}, folders=('/',))
    assert path is not None
