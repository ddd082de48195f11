# SPDX-License-Identifier: BSD-3-Clause
"""Poses, pose graphs, grids, saved maps and incoming scans that several packages share; ROS in ``ros`` only."""
