# SPDX-License-Identifier: BSD-3-Clause
"""gzserver's command line, as private parameters of the simulation node.  No ROS here."""
from __future__ import annotations

import os
from typing import List, NamedTuple, Optional, Sequence, Tuple


class Option(NamedTuple):
    """An option of gzserver: spellings, number of values, and effect.

    ``effect`` is an entry of ServerCommand, or the reason why there is none; empty if the user need not know.
    """

    names: Tuple[str, ...]
    values: int
    effect: str


OPTIONS = (
    Option(('-u', '--pause'), 0, 'paused'),
    Option(('-e', '--physics'), 1, 'engine'),
    Option(('-s', '--server-plugin'), 1, 'plugins'),
    Option(('--seed',), 1, 'seed'),
    Option(('-v', '--version'), 0, 'version'),
    Option(('-h', '--help'), 0, 'help'),
    Option(('--verbose',), 0, ''),
    Option(('-q', '--quiet'), 0, ''),
    Option(('--lockstep',), 0, 'sensors and physics are always synchronous'),
    Option(('--minimal_comms',), 0, 'there is no Gazebo transport'),
    Option(('-p', '--play'), 1, "no state log can be played; replay a bag with rosbag"),
    Option(('-r', '--record'), 0, 'no state log is written; record topics with rosbag'),
    Option(('--record_encoding',), 1, 'no state log is written'),
    Option(('--record_path',), 1, 'no state log is written'),
    Option(('--record_period',), 1, 'no state log is written'),
    Option(('--record_filter',), 1, 'no state log is written'),
    Option(('--record_resources',), 0, 'no state log is written'),
    Option(('--iters',), 1, 'the number of steps cannot be limited'),
    Option(('-g', '--gui-plugin', '--gui-client-plugin'), 1, 'there is no Gazebo window that could load it'),
    Option(('-o', '--profile'), 1, 'physics profiles are not supported; use the settings of <physics>'),
)
_BY_NAME = {name: option for option in OPTIONS for name in option.names}
BUILT_IN_PLUGINS = ('libgazebo_ros_api_plugin.so', 'libgazebo_ros_paths_plugin.so', 'libgazebo_ros_init.so',
                    'libgazebo_ros_factory.so')


class UsageError(Exception):
    """The command line cannot be parsed; the message gives the reason."""


class ServerCommand:
    """The contents of a command line.

    Attributes
    ----------
    world : str or None
        World file as written.
    paused : bool
    seed : int or None
    remaps : list of str
        Words with ``:=``, for ROS.
    notes : list of str
        A sentence for each argument without effect.
    wants : str or None
        ``help`` or ``version`` if requested.
    """

    def __init__(self) -> None:
        self.world: Optional[str] = None
        self.seed: Optional[int] = None
        self.wants: Optional[str] = None
        self.paused = False
        self.remaps: List[str] = []
        self.notes: List[str] = []


def parse(words: Sequence[str]) -> ServerCommand:
    """Read gzserver's command line; returns a :class:`ServerCommand`.

    Options may be anywhere, as ``--name value`` or ``--name=value``; single letters may be joined (``-ur``).  The
    world is the first other word, unless it may be the value of an unknown option and there is another word.
    Remaining words are noted.

    Raises
    ------
    UsageError
        If a value is missing or not a number.
    """
    command = ServerCommand()
    words = list(words)
    worlds: List[str] = []
    doubtful: List[str] = []
    behind_unknown = False
    while words:
        word = words.pop(0)
        if ':=' in word:
            command.remaps.append(word)
        elif not word.startswith('-') or word == '-':
            if word:                # otherwise an empty launch argument
                (doubtful if behind_unknown else worlds).append(word)
        else:
            behind_unknown = not _take_option(command, word, words) and '=' not in word
            continue
        behind_unknown = False
    candidates = worlds + doubtful
    command.world = candidates[0] if candidates else None
    command.notes.extend('"%s" has no effect' % word for word in candidates[1:])
    return command


def _take_option(command: ServerCommand, word: str, words: List[str]) -> bool:
    """Apply one option, whose value is in the word or the first of ``words``; returns whether it is known."""
    name, equals, value = word.partition('=')
    option = _BY_NAME.get(name)
    if option is None and not word.startswith('--') and len(word) > 2 and word[:2] in _BY_NAME:
        option, name = _BY_NAME[word[:2]], word[:2]
        if option.values:
            equals, value = '=', word[2:]               # -eode
        else:
            words.insert(0, '-' + word[2:])             # -ur
    if option is None:
        command.notes.append('option %s is not known and has no effect' % name)
        return False
    if option.values and not equals:
        if not words or ':=' in words[0]:
            raise UsageError('option %s needs a value' % name)
        value = words.pop(0)
    _apply(command, option, name, value)
    return True


def _apply(command: ServerCommand, option: Option, name: str, value: str) -> None:
    if option.effect == 'paused':
        command.paused = True
    elif option.effect in ('help', 'version'):
        command.wants = command.wants or option.effect
    elif option.effect == 'seed':
        try:
            command.seed = int(value)
        except ValueError:
            raise UsageError('option %s is "%s"; expected a whole number' % (name, value)) from None
        if command.seed < 0:
            raise UsageError('option %s is %s; expected at least 0' % (name, value))
    elif option.effect == 'engine':
        if value != 'ode':
            command.notes.append('physics engine "%s" is not available, ODE is used' % value)
    elif option.effect == 'plugins':
        if os.path.basename(value) not in BUILT_IN_PLUGINS:
            command.notes.append('system plugin %s is not known and left out' % value)
    elif option.effect:
        command.notes.append('option %s has no effect: %s' % (name, option.effect))


def usage() -> str:
    """Return the help text."""
    lines = ['usage: gzserver [options] [world file] [name:=value ...]', '',
             'Starts the simulation node of m2wr_sim under the name gazebo. A word with := goes to ROS: a remapping,',
             'or _parameter:=value (the parameters are in docs/reference.md).', '',
             'options of Gazebo with an effect:']
    acting = {'paused': 'start paused', 'engine': 'physics engine: only ode', 'seed': 'seed of all sensor noise',
              'plugins': 'system plugins: the ROS ones are built in', 'version': 'print the version',
              'help': 'print this'}
    for option in OPTIONS:
        if option.effect in acting:
            lines.append('  %-28s %s' % (', '.join(option.names), acting[option.effect]))
    lines.append('accepted without effect:')
    lines.append('  ' + ' '.join(option.names[0] for option in OPTIONS if option.effect not in acting))
    return '\n'.join(lines) + '\n'
