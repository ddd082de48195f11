# SPDX-License-Identifier: BSD-3-Clause
"""Poses, grids, saved maps and incoming scans that mapping, navigation and exploration share; ROS in ``ros`` only."""
