# SPDX-License-Identifier: BSD-3-Clause
"""Protocol of Foxglove, without ROS."""
