# SPDX-License-Identifier: BSD-3-Clause
"""The nodes and what they use of ROS."""
