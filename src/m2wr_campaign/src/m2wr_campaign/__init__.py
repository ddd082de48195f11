# SPDX-License-Identifier: BSD-3-Clause
"""Campaigns: thousands of runs of planners and methods over worlds, robots and seeds. No ROS master is needed."""
