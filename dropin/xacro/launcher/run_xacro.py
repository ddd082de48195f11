# SPDX-License-Identifier: BSD-3-Clause
"""Runs the Python module xacro as a command.

It is in a folder of its own, because Python puts a script's folder first on the module path: next to ``xacro.py`` it
would import that file instead of the module.
"""
from __future__ import annotations

import os
import signal
import sys
import xml.parsers.expat  # noqa: F401  the module catches its error without importing it
from typing import Any

PACKAGE_DIR = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))


def arrange_path() -> None:
    """Make the modules available without a setup file, and remove the folder that would hide the module xacro."""
    sys.path[:] = [entry for entry in sys.path if os.path.realpath(entry or os.getcwd()) != PACKAGE_DIR]
    sys.path.append(os.path.join(PACKAGE_DIR, 'src'))                                           # source space
    sys.path.append(os.path.join(PACKAGE_DIR, '..', '..', 'lib', 'python3', 'dist-packages'))   # install space


def main() -> Any:
    """Run xacro with this process's arguments; return its exit code, or 1 if the module is missing."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)        # Ctrl-C in a launch file's terminal: no traceback
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)       # nor after it has ended roslaunch, which reads the output
    arrange_path()
    try:
        import xacro
        run = xacro.main
    except (ImportError, AttributeError) as error:      # a folder named xacro imports as an empty module
        sys.stderr.write('xacro: the Python module xacro does not load in %s: %s.\n'
                         'Run `make setup` in the workspace, or source its setup file if the workspace is elsewhere.\n'
                         % (sys.executable, error))
        return 1
    sys.argv[0] = 'xacro'
    return run()


if __name__ == '__main__':
    sys.exit(main())
