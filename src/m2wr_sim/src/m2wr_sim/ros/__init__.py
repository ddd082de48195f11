# SPDX-License-Identifier: BSD-3-Clause
"""The interface to ROS: parameters, topics, services."""
