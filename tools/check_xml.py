#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks that every XML file named on the command line is well formed; each fault is printed with file and line."""
from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from typing import List


def main(paths: List[str]) -> int:
    """Parse each file; returns the number of files that are not well formed."""
    faults = 0
    for path in paths:
        try:
            ElementTree.parse(path)
        except (ElementTree.ParseError, OSError) as error:
            print("{}: not well-formed XML: {}".format(path, error), file=sys.stderr)
            faults += 1
    return faults


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("check_xml.py: no file given")
    sys.exit(1 if main(sys.argv[1:]) else 0)
