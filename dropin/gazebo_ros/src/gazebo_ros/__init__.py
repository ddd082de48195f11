# SPDX-License-Identifier: BSD-3-Clause
"""What Gazebo's ROS package offers, in front of m2wr_sim."""
