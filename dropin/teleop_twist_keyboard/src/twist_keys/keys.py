# SPDX-License-Identifier: BSD-3-Clause
"""The meaning of each key.  No ROS, no terminal."""
from __future__ import annotations

from typing import Tuple

#: key: direction (x, y, z, yaw), each -1, 0 or 1
DIRECTIONS = {
    'u': (1, 0, 0, 1), 'i': (1, 0, 0, 0), 'o': (1, 0, 0, -1),
    'j': (0, 0, 0, 1), 'l': (0, 0, 0, -1),
    'm': (-1, 0, 0, -1), ',': (-1, 0, 0, 0), '.': (-1, 0, 0, 1),
    'U': (1, 1, 0, 0), 'I': (1, 0, 0, 0), 'O': (1, -1, 0, 0),
    'J': (0, 1, 0, 0), 'L': (0, -1, 0, 0),
    'M': (-1, 1, 0, 0), '<': (-1, 0, 0, 0), '>': (-1, -1, 0, 0),
    't': (0, 0, 1, 0), 'b': (0, 0, -1, 0),
}
#: key: factors of linear and angular speed
FACTORS = {'q': (1.1, 1.1), 'z': (0.9, 0.9), 'w': (1.1, 1.0), 'x': (0.9, 1.0), 'e': (1.0, 1.1), 'c': (1.0, 0.9)}
QUIT = '\x03'       # Ctrl-C, if it arrives as a key
SHOW_HELP = '?'
_STOPPED = (0, 0, 0, 0)
_HELP_EVERY = 15    # changes of speed

HELP = '''
Keys (the window with this text must have the focus)

   u  i  o      forward and left, forward, forward and right
   j  k  l      turn left, stop, turn right
   m  ,  .      the same backwards

   with Shift, for robots that can drive sideways:
   U  I  O      forward and left, forward, forward and right, without turning
   J  K  L      left, stop, right
   M  <  >      the same backwards

   t  b         up, down
   q  z         both speeds 10 % higher, lower
   w  x         linear speed alone
   e  c         turning speed alone
   ?            stop, and show this again
   any other    stop
   Ctrl-C       stop and quit
'''


class KeyDriver:
    """Stores the direction and the speeds set by the keys.

    Parameters
    ----------
    speed, turn : float
        Linear [m/s] and angular [rad/s] speed of a full direction.
    speed_limit, turn_limit : float
        Largest speeds that the keys can set.
    """

    def __init__(self, speed: float = 0.5, turn: float = 1.0, speed_limit: float = 1000.0,
                 turn_limit: float = 1000.0) -> None:
        self.speed, self.turn = min(speed, speed_limit), min(turn, turn_limit)
        self._limits = (speed_limit, turn_limit)
        self._direction = _STOPPED
        self._changes = 0

    def press(self, key: str) -> str:
        """Process one key; returns a text for the user, often empty."""
        if key in DIRECTIONS:
            self._direction = DIRECTIONS[key]
            return ''
        if key not in FACTORS:
            self._direction = _STOPPED
            return HELP if key == SHOW_HELP else ''
        linear, angular = FACTORS[key]
        said = []
        if self.speed * linear >= self._limits[0] and linear > 1.0:
            said.append('Linear speed limit reached.')
        if self.turn * angular >= self._limits[1] and angular > 1.0:
            said.append('Angular speed limit reached.')
        self.speed = min(self.speed * linear, self._limits[0])
        self.turn = min(self.turn * angular, self._limits[1])
        said.append(self.speeds())
        self._changes += 1
        if self._changes % _HELP_EVERY == 0:
            said.append(HELP)
        return '\n'.join(said)

    def release(self) -> bool:
        """Stop, because there was no key; returns whether this is a change."""
        moved = self._direction != _STOPPED
        self._direction = _STOPPED
        return moved

    def command(self) -> Tuple[float, float, float, float]:
        """Return the velocity: linear x, y, z [m/s] and angular z [rad/s]."""
        x, y, z, yaw = self._direction
        return x * self.speed, y * self.speed, z * self.speed, yaw * self.turn

    def speeds(self) -> str:
        """Return a line with the two speeds."""
        return 'currently:\tspeed %g m/s\tturn %g rad/s' % (self.speed, self.turn)
