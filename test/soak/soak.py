# SPDX-License-Identifier: BSD-3-Clause
"""Lets simulation and mapper run for simulated hours and watches what grows; see docs/endurance.md."""
import sys

import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from m2wr_node.pipes import go_on_unread
from soak_run import main

if __name__ == "__main__":
    go_on_unread()
    sys.exit(main())
