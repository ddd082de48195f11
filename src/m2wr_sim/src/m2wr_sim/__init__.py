# SPDX-License-Identifier: BSD-3-Clause
"""Simulation of ROS 1 robots on ODE, with the ROS interface of Gazebo classic."""
