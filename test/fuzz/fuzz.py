# SPDX-License-Identifier: BSD-3-Clause
"""Feeds the workspace with odd input; see README.md beside this file."""
import sys

import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from command import main
from m2wr_node.pipes import go_on_unread

if __name__ == "__main__":
    go_on_unread()
    sys.exit(main())
