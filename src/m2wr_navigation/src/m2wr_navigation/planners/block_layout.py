# SPDX-License-Identifier: BSD-3-Clause
"""Size of the blocks of cells by which a search of a large grid is limited to a corridor."""
from __future__ import annotations

BLOCK = 8           # cells along a side
