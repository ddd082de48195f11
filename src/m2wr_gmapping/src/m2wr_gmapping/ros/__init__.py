# SPDX-License-Identifier: BSD-3-Clause
"""The edges to ROS: the live node and the map saver."""
