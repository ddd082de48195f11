# SPDX-License-Identifier: BSD-3-Clause
"""Services that tell web pages about the graph of ROS."""
