# SPDX-License-Identifier: BSD-3-Clause
"""Bridges between ROS and web pages, Foxglove and MCAP."""
