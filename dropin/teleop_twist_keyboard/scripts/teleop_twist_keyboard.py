#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Drive a robot from the keyboard."""
import sys

from m2wr_node.interrupts import interruptible
from twist_keys.node import main

if __name__ == '__main__':
    sys.exit(interruptible(main))
