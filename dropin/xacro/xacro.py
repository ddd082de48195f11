#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The xacro command under its old name, for launch files written before Noetic; passes all arguments to it."""
import os
import sys

HERE = os.path.dirname(os.path.realpath(__file__))

if __name__ != '__main__':
    # This folder on the module path would hide the module xacro behind this file.
    raise ImportError('%s is a command, not the Python module xacro: take %s off PYTHONPATH' % (__file__, HERE))

os.execv(os.path.join(HERE, 'xacro'), ['xacro'] + sys.argv[1:])
