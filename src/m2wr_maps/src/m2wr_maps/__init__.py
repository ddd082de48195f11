# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses, occupancy grids and saved maps that mapping, navigation and exploration share."""
