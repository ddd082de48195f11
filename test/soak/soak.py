# SPDX-License-Identifier: BSD-3-Clause
"""Runs simulation and mapper for simulated hours and measures their growth; see docs/endurance.md."""
import sys

import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from m2wr_node.pipes import ignore_closed_pipes
from soak_run import main

if __name__ == "__main__":
    ignore_closed_pipes()
    sys.exit(main())
