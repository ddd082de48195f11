# SPDX-License-Identifier: BSD-3-Clause
"""Which frontier is next: one strategy a file, one line each in :mod:`m2wr_exploration.registry`."""
