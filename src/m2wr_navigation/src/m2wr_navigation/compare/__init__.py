# SPDX-License-Identifier: BSD-3-Clause
"""All planners and methods in one world, measured against the exact shortest path."""
