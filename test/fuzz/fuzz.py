# SPDX-License-Identifier: BSD-3-Clause
"""Sends invalid and unusual input to the workspace; see README.md beside this file."""
import sys

import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from command import main
from m2wr_node.pipes import ignore_closed_pipes

if __name__ == "__main__":
    ignore_closed_pipes()
    sys.exit(main())
