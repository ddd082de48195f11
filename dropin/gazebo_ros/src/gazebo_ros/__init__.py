# SPDX-License-Identifier: BSD-3-Clause
"""The interface of Gazebo's ROS package, implemented by m2wr_sim."""
