# SPDX-License-Identifier: BSD-3-Clause
"""The edge to ROS: parameters, topics, services."""
