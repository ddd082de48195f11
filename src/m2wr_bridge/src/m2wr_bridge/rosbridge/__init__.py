# SPDX-License-Identifier: BSD-3-Clause
"""Protocol of rosbridge, version 2, without ROS."""
