# SPDX-License-Identifier: BSD-3-Clause
"""A logger of remarks on models and worlds that writes each line once.

A warning is for what its reader can change: what is left out, differs from Gazebo, or drives a robot astray.
What Gazebo does not apply either is told at level INFO.
"""
import logging

_MOST = 10000           # lines remembered, so that years of spawning take no memory

_log = logging.getLogger("m2wr_sim")


class OnceLogger:
    """Logs each line once, also for all simulations that share one."""

    def __init__(self):
        self._lines = set()

    def log(self, level, name, text, *values):
        """Log a line unless the same was logged before, also of a model by another name.

        Parameters
        ----------
        level : int
            As of :mod:`logging`.
        name : str
            Name of the model, which does not count when lines are compared; empty for the world.
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

    def log_parameters(self, name, label, reader):
        """Log the defaults, the invalid values and the unsupported elements of a plugin.

        Parameters
        ----------
        name : str
            Of the model.
        label : str
            Which plugin.
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
