# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles of a running simulation: commands that add, list, move and delete them, and clicks in rviz."""
