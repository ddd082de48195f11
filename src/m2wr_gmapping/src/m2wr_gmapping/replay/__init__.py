# SPDX-License-Identifier: BSD-3-Clause
"""Mapping from a recorded bag, without a ROS master."""
