# SPDX-License-Identifier: BSD-3-Clause
"""gzserver's command line: options with an effect, notes, and errors."""
import pytest

from gazebo_ros.command_line import OPTIONS, UsageError, parse, usage
from gazebo_ros.server import node_arguments, prepare


def test_the_line_that_roslaunch_makes():
    command = parse('-u --verbose -e ode worlds/empty.world __name:=gazebo __log:=/tmp/x.log'.split())
    assert command.paused and command.world == 'worlds/empty.world' and command.seed is None
    assert command.remaps == ['__name:=gazebo', '__log:=/tmp/x.log'] and command.notes == []


def test_an_empty_command_line():
    command = parse([])
    assert (command.world, command.paused, command.notes, command.remaps) == (None, False, [], [])


def test_empty_words_are_no_world():
    assert parse(['', '-e', 'ode', '']).world is None


@pytest.mark.parametrize('words', [['--seed', '7'], ['--seed=7']])
def test_values_stand_behind_a_blank_or_an_equals_sign(words):
    assert parse(words).seed == 7


def test_letters_may_be_joined_and_carry_their_value():
    command = parse(['-uq', '-eode', 'a.world'])
    assert command.paused and command.world == 'a.world' and command.notes == []


def test_the_ros_plugins_are_built_in_and_others_are_named():
    command = parse(['-s', 'libgazebo_ros_api_plugin.so', '-s', '/opt/x/libgazebo_ros_paths_plugin.so',
                     '--server-plugin=libmine.so'])
    assert command.notes == ['system plugin libmine.so is not known and left out']


def test_another_engine_is_named():
    assert parse(['-e', 'bullet']).notes == ['physics engine "bullet" is not available, ODE is used']


@pytest.mark.parametrize('words', [
    ['-r'], ['--record_path', '/tmp/x'], ['-p', 'state.log'], ['--iters', '100'], ['-g', 'libgui.so'],
    ['-o', 'fast'], ['--lockstep'], ['--minimal_comms']])
def test_options_without_effect_are_named_with_their_value(words):
    command = parse(words + ['a.world'])
    assert command.world == 'a.world' and len(command.notes) == 1 and words[0] in command.notes[0]


def test_values_of_unknown_options_are_not_worlds():
    command = parse(['--sparkle', 'bright', '-k', 'a.world', '__name:=g'])
    assert command.world == 'bright'            # both may be values, so the first is the world
    command = parse(['--sparkle', 'bright', '-e', 'ode', 'a.world'])
    assert command.world == 'a.world' and len(command.notes) == 2
    assert 'option --sparkle is not known' in command.notes[0] and '"bright"' in command.notes[1]
    assert parse(['--sparkle=bright', 'a.world']).world == 'a.world'


@pytest.mark.parametrize('words, said', [
    (['-e'], '-e needs a value'), (['--seed', '__name:=x'], '--seed needs a value'),
    (['--seed', 'many'], 'expected a whole number'), (['--seed', '-1'], 'at least 0')])
def test_wrong_values_are_refused(words, said):
    with pytest.raises(UsageError) as caught:
        parse(words)
    assert said in str(caught.value)


def test_wrong_usage_exits_as_in_gazebo_and_shows_the_usage(capsys):
    assert prepare(['--seed', 'many']) == 255
    said = capsys.readouterr().err
    assert 'expected a whole number' in said and 'usage: gzserver' in said


@pytest.mark.parametrize('words, said', [(['-h'], 'usage: gzserver'), (['--version'], 'm2wr_sim')])
def test_help_and_version_exit_with_0(words, said, capsys):
    assert prepare(words) == 0
    assert said in capsys.readouterr().out


def test_every_option_is_in_the_help():
    text = usage()
    for option in OPTIONS:
        assert option.names[0] in text


def test_arguments_of_the_user_have_priority():
    words = node_arguments(parse(['-u', '--seed', '3', '_paused:=false', '__name:=g']), '/w.world')
    assert words[-2:] == ['_paused:=false', '__name:=g']
    assert words[:2] == ['_world:=/w.world', '_paused:=true'] and '_seed:=3' in words


def test_pausing_is_always_written():
    """A value left on the parameter server by an earlier run must be ignored."""
    assert '_paused:=false' in node_arguments(parse([]), '/w.world')
