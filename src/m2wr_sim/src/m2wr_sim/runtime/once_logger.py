# SPDX-License-Identifier: BSD-3-Clause
"""A logger of remarks on models and worlds that writes each line once.

Warnings are about things that users can change: elements that are ignored or differ from Gazebo, or parameters that
make a robot drive inaccurately.  Elements that Gazebo also ignores are logged at level INFO.
"""
from __future__ import annotations

import logging
from contextlib import contextmanager
from typing import TYPE_CHECKING, Iterator, Set

if TYPE_CHECKING:
    from m2wr_sim.plugins.base import PluginReader

_MOST = 10000           # lines stored, which bounds the memory

_log = logging.getLogger("m2wr_sim")


class OnceLogger:
    """Logs each line once, also for all simulations that share one."""

    def __init__(self) -> None:
        self._lines: Set[str] = set()

    def log(self, level: int, name: str, text: str, *values: object) -> None:
        """Log a line unless it was logged before, also for a model of another name.

        Parameters
        ----------
        level : int
            As of :mod:`logging`.
        name : str
            Name of the model, which is ignored when lines are compared; empty for the world.
        text, *values : str, objects
            As of :meth:`logging.Logger.log`.
        """
        line = text % values
        key = line.replace(name, "*") if name else line
        if key not in self._lines:
            if len(self._lines) >= _MOST:
                self._lines.clear()
            self._lines.add(key)
            _log.log(level, "%s", line)

    def log_parameters(self, name: str, label: str, reader: PluginReader) -> None:
        """Log the defaults, the invalid values and the unsupported elements of a plugin.

        Parameters
        ----------
        name : str
            Name of the model.
        label : str
            Name of the plugin, for the message.
        reader : PluginReader
            The plugin's tags.
        """
        if reader.defaults:
            self.log(logging.INFO, name, "%s uses defaults for %s", label,
                     ", ".join("%s = %s" % pair for pair in reader.defaults))
        for problem in reader.problems:
            self.log(logging.WARNING, name, "%s: %s", label, problem)
        if reader.unread():             # Gazebo ignores them too
            self.log(logging.INFO, name, "%s: unsupported elements ignored: %s", label,
                     ", ".join("<%s>" % tag for tag in reader.unread()))


@contextmanager
def suppress_warnings(suppress: bool) -> Iterator[None]:
    """Suppress warnings of this package inside the block, if ``suppress``: for a record whose warnings were logged."""
    level = _log.level
    if suppress:
        _log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        _log.setLevel(level)
