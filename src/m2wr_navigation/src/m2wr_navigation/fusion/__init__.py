# SPDX-License-Identifier: BSD-3-Clause
"""Pose, velocity and acceleration of a robot from odometry, IMU and other sensors: an extended Kalman filter."""
